// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any change of a model file, its checksum made right: an answer, never a crash. What is accepted is finite, and is
// written and read again the same.
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>

#include <cmath>

#include "any_tensors.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using FuzzRecipe = testing::SmallRecipe;

testing::LooseTensors good_file(const std::filesystem::path& path, bool lens) {
  Model<FuzzRecipe> model;
  model.create(5, 2);
  FuzzRecipe::GaussianDecoder::initialise(model.arena, model.decoder, 5);
  ModelInfo info{"small", "scaffold", 12, 7, {}, {}};
  for (std::size_t i = 0; i < 2; ++i)
    info.views.push_back({"v" + std::to_string(i), i == 1, testing::ring_camera(i, 2, 8, 6)});
  if (lens) {
    info.views[1].lens = {LensModel::opencv, {0.1, -0.2, 1e-3, 0.3}};
    info.origin = {1, 2, 3};
    info.unit = 0.5;
  }
  if (!write_model(path, model, info)) std::abort();
  return testing::LooseTensors(*read_safetensors(path));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path = testing::fuzz_folder() / "a.safetensors";
  static const std::vector<testing::LooseTensors> good{good_file(path, false), good_file(path, true)};
  testing::FuzzInput input(data, size);
  const std::vector<std::byte> bytes = testing::any_tensor_file(good, input);
  if (bytes.empty()) return 0;
  const Result<SafetensorsFile> file = parse_safetensors(bytes, "fuzz");
  if (!file) std::abort();
  const Result<LoadedModel<FuzzRecipe>> model = model_from<FuzzRecipe>(*file);
  if (!model) {
    testing::require_words(model.error());
    return 0;
  }
  for (const float value : model->model.arena.all_values()) {
    if (!std::isfinite(value)) std::abort();
  }
  for (const StoredView& view : model->info.views) {
    if (!(view.camera.fx > 0) || view.camera.width < 1) std::abort();
  }
  if (!write_model(path, model->model, model->info)) std::abort();
  const Result<LoadedModel<FuzzRecipe>> again = read_model<FuzzRecipe>(path);
  if (!again || !std::ranges::equal(again->model.arena.all_values(), model->model.arena.all_values()) ||
      again->info.views.size() != model->info.views.size())
    std::abort();
  return 0;
}
