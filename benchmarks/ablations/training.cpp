// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "ablations/training.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>

#include "compmark/codec/hac/hac_decoder.hpp"
#include "compmark/codec/hac/hac_encoder.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/scene/extent.hpp"
#include "compmark/scene/open.hpp"
#include "compmark/scene/procedural_write.hpp"

namespace ablation {

using namespace compmark;

namespace {

constexpr std::size_t first_points = 3000;  // few: scenes of 96 pixels a side

/// A mark in the positions has moved anchors off the grid on which they are coded: the codec's rounding of positions.
void round_positions(Model<Base>& model) {
  const MatrixView<float> position = anchor_values(model.arena, model.anchors).position;
  for (float& place : position.flat()) {
    place = static_cast<float>(std::round(static_cast<double>(place) / model.voxel_size) * model.voxel_size);
  }
}

}  // namespace

Result<std::unique_ptr<Scene>> open_scene(const std::filesystem::path& folder, std::string name) {
  auto scene = std::make_unique<Scene>();
  scene->name = std::move(name);
  DatasetSettings settings;
  settings.random_points = first_points;
  for (int round = 0; round < 2; ++round) {
    Result<Dataset> opened = open_dataset(folder, settings);
    if (!opened) return opened.error();
    scene->dataset = std::move(*opened);
    int side = 0;
    for (const View& view : scene->dataset.views) side = std::max({side, view.camera.width, view.camera.height});
    if (round == 0 && side <= longest_side) break;
    if (round == 0) settings.downscale = std::ceil(static_cast<double>(side) / longest_side);
  }
  scene->store = std::make_unique<ImageStore>(scene->dataset, settings);
  scene->train = {&scene->dataset, scene->store.get(), scene->dataset.indices(Split::train)};
  scene->test = {&scene->dataset, scene->store.get(), scene->dataset.indices(Split::test)};
  for (const Views* views : {&scene->train, &scene->test}) {
    if (views->size() == 0) {
      return Error{ErrorKind::invalid, folder.string(), views == &scene->train ? "train split" : "test split",
                   "holds no view", "give a dataset with training and test views"};
    }
  }
  scene->extent = scene_extent(scene->dataset).radius;
  return scene;
}

Result<std::vector<std::unique_ptr<Scene>>> built_in_scenes(const std::filesystem::path& folder,
                                                            ThreadExecutor& executor) {
  std::vector<std::unique_ptr<Scene>> scenes;
  for (const bool closer : {false, true}) {
    ProceduralSettings settings;
    settings.views_train = 40;
    settings.views_test = 8;
    settings.width = settings.height = built_in_side;
    settings.seed = closer ? 1 : 0;
    if (closer) settings.camera_angle_x = 0.45;
    const std::string name = closer ? "closer" : "still_life";
    const std::filesystem::path at = folder / name;
    std::error_code none;
    if (!std::filesystem::exists(at / "transforms_train.json", none)) {  // written last
      if (Result<Done> written = write_procedural_scene(at, settings, executor); !written) return written.error();
    }
    Result<std::unique_ptr<Scene>> scene = open_scene(at, name);
    if (!scene) return scene.error();
    scenes.push_back(std::move(*scene));
  }
  return scenes;
}

Result<Record> train_row(const Row& row, Scene& scene, std::int64_t iterations, std::uint64_t seed,
                         const std::filesystem::path& scratch, ThreadExecutor& executor) {
  TrainSettings settings = row_settings(row, iterations, seed);
  if (scene.dataset.kind != "blender") {  // points that were measured say how fine the scene is
    settings.voxel_size = 0;
    settings.init_factor = 16;
  }
  const Decoder decoder = fourier_decoder(row.bits, seed);
  const std::vector<std::uint8_t> bits = message_bits(row.bits, seed);
  Record record;
  record.scene = scene.name;
  record.row = row.name;
  record.seed = seed;
  record.settings = settings_json(scene, iterations);
  const auto begin = std::chrono::steady_clock::now();
  Result<Model<Base>> unmarked = train_base(row, scene, settings, decoder, bits, executor);
  if (!unmarked) return unmarked.error();
  record.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  record.anchors = unmarked->anchor_count();
  const Decoder* const reader = row.message ? &decoder : nullptr;
  const Result<Measured> before = measure(*unmarked, scene, reader, bits, executor);
  if (!before) return before.error();
  record.before = *before;

  if (row.target == AnchorAttribute::position) round_positions(*unmarked);
  ModelInfo info;
  info.recipe = "hac";
  info.profile = settings.profile;
  info.iterations = settings.iterations;
  info.seed = settings.seed;
  info.base_step = {settings.rate.feature_step, settings.rate.scaling_step, settings.rate.offset_step};
  const Result<CodecModel> coded = coded_model(*unmarked, info);
  if (!coded) return coded.error();
  const Result<CodecEncoded> encoded = encode_hac(*coded, CodecEncodeSettings{}, executor);
  if (!encoded) return encoded.error();
  if (const Result<Done> written = write_file(scratch, encoded->bytes); !written) return written.error();
  const Result<std::vector<std::byte>> bytes = read_file(scratch);
  if (!bytes) return bytes.error();
  const Result<CodecDecoded> decoded = decode_hac(*bytes, scratch.string(), CodecDecodeSettings{}, executor);
  if (!decoded) return decoded.error();
  const Result<LoadedModel<Base>> loaded = model_from<Base>(decoded->model);
  if (!loaded) return loaded.error();
  record.file_bytes = bytes->size();
  const Result<Measured> after = measure(loaded->model, scene, reader, bits, executor);
  if (!after) return after.error();
  record.after = *after;
  return record;
}

}  // namespace ablation
