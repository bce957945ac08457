// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Any change of a checkpoint, its checksum made right: refused, or a state from which a run takes one more step.
#include <compmark/core/executor.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>

#include "any_tensors.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
/// With a row of numbers for each training view, which a state must have too.
struct FuzzRecipe
    : DefaultRecipe<float, DecoderShape{.feature_dim = 8, .offsets = 3, .feature_bank = true, .appearance_dim = 4}> {};
using Run = Trainer<FuzzRecipe, SerialExecutor>;

TrainSettings settings_of_run() {
  TrainSettings settings;
  settings.iterations = 20;
  settings.voxel_size = 0.3;
  settings.statistics_after = 0;
  settings.grow_after = 1;
  settings.grow_interval = 3;
  return settings;
}
constexpr testing::BlobViews views{2, 8, 8};

testing::LooseTensors good_file(const std::filesystem::path& path, SerialExecutor& executor) {
  Run trainer(settings_of_run(), views.size(), 3.3, executor);
  if (!trainer.initialise(testing::cloud(12, 1))) std::abort();
  for (int i = 0; i < 2; ++i) {
    if (!trainer.step(views)) std::abort();
  }
  if (!write_checkpoint(path, trainer.state(), settings_of_run(), ModelInfo{}, 1)) std::abort();
  return testing::LooseTensors(*read_safetensors(path));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path = testing::fuzz_folder() / "a.safetensors";
  static SerialExecutor executor;
  static const std::vector<testing::LooseTensors> good{good_file(path, executor)};
  testing::FuzzInput input(data, size);
  const bool own = input.byte() % 2 == 1;  // compared to what it says itself, so that what follows is reached
  const std::vector<std::byte> bytes = testing::any_tensor_file(good, input);
  if (bytes.empty()) return 0;
  ModelInfo info;
  if (own) {
    const Result<SafetensorsFile> file = parse_safetensors(bytes, "fuzz");
    if (!file) std::abort();
    Result<LoadedModel<FuzzRecipe>> model = detail::model_from<FuzzRecipe>(*file);
    if (!model) {
      testing::require_words(model.error());
      return 0;
    }
    info = std::move(model->info);
  }
  testing::put_bytes(path, bytes);
  auto checkpoint = read_checkpoint<Trainer<FuzzRecipe, SerialExecutor>>(path, settings_of_run(), info);
  if (!checkpoint) {
    testing::require_words(checkpoint.error());
    return 0;
  }
  if (checkpoint->state.model.anchor_count() > 100 || checkpoint->state.model.train_views > 100) return 0;
  Run trainer(settings_of_run(), views.size(), 3.3, executor);
  trainer.restore(std::move(checkpoint->state));
  if (trainer.state().iteration < settings_of_run().iterations) static_cast<void>(trainer.step(views));
  return 0;
}
