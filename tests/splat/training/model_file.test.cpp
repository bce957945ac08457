// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <compmark/io/atomic_file.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <filesystem>
#include <limits>

#include "support/small_scene.hpp"

namespace {

using namespace compmark;
struct StoredRecipe : DefaultRecipe<float, DecoderShape{.feature_dim = 8, .offsets = 4}> {};
struct WiderRecipe : DefaultRecipe<float, DecoderShape{.feature_dim = 12, .offsets = 4}> {};

std::filesystem::path temporary(const char* name) {
  return std::filesystem::temp_directory_path() / (std::string("compmark-model-file-") + name);
}

Model<StoredRecipe> example() {
  Model<StoredRecipe> model;
  model.create(21, 3);
  StoredRecipe::GaussianDecoder::initialise(model.arena, model.decoder, 5);
  const Random random(1, 2, 3);
  const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
  for (std::size_t i = 0; i < columns.feature.size(); ++i) columns.feature.data[i] = random.centered(i);
  model.render.background = {0.25, 0.5, 1};
  model.voxel_size = 0.125;
  return model;
}
ModelInfo example_info() {
  ModelInfo info{"small", "scaffold", 1234, 77, {}, {}};
  for (std::size_t i = 0; i < 3; ++i)
    info.views.push_back({"view " + std::to_string(i), i == 2, compmark::testing::ring_camera(i, 3, 64, 48)});
  return info;
}

}  // namespace

TEST_CASE("training/model_file: what is written is read back, bit for bit, and the same model gives the same bytes") {
  const std::filesystem::path path = temporary("a.safetensors");
  const Model<StoredRecipe> model = example();
  const ModelInfo info = example_info();
  REQUIRE(write_model(path, model, info).ok());
  const Result<LoadedModel<StoredRecipe>> loaded = read_model<StoredRecipe>(path);
  REQUIRE(loaded.ok());
  CHECK(std::equal(model.arena.all_values().begin(), model.arena.all_values().end(),
                   loaded->model.arena.all_values().begin(), loaded->model.arena.all_values().end()));
  CHECK(loaded->model.render.background == model.render.background);
  CHECK(loaded->model.voxel_size == model.voxel_size);
  CHECK(loaded->info.iterations == 1234);
  REQUIRE(loaded->info.views.size() == 3);
  CHECK(loaded->info.views[2].test);
  CHECK(loaded->info.views[1].camera.center_world == info.views[1].camera.center_world);
  const std::filesystem::path again = temporary("b.safetensors");
  REQUIRE(write_model(again, loaded->model, loaded->info).ok());
  CHECK(*read_file(path) == *read_file(again));
  std::filesystem::remove(path);
  std::filesystem::remove(again);
}

TEST_CASE(
    "training/model_file: lenses, origin and unit are kept where there are any, and take no byte where there are "
    "none") {
  const std::filesystem::path path = temporary("e.safetensors");
  const Model<StoredRecipe> model = example();
  ModelInfo info = example_info();
  REQUIRE(write_model(path, model, info).ok());
  const Result<SafetensorsFile> plain = read_safetensors(path);
  REQUIRE(plain.ok());
  CHECK(!plain->has("camera.lens"));
  CHECK(plain->text_of("info")->find("origin") == std::string::npos);
  CHECK(plain->text_of("info")->find("unit") == std::string::npos);
  const Result<LoadedModel<StoredRecipe>> old =
      read_model<StoredRecipe>(path);  // as files from before there was either
  REQUIRE(old.ok());
  CHECK(old->info.origin == std::array<double, 3>{0, 0, 0});
  CHECK(old->info.unit == 1);
  CHECK(is_pinhole(old->info.views[1].lens));

  info.origin = {5e5, -1.0 / 3, 12};
  info.unit = 0x1p-10;
  info.views[1].lens = {LensModel::opencv, {0.1, -0.2, 1e-3, 0.3}};
  REQUIRE(write_model(path, model, info).ok());
  const Result<LoadedModel<StoredRecipe>> loaded = read_model<StoredRecipe>(path);
  REQUIRE(loaded.ok());
  CHECK(loaded->info.origin == info.origin);
  CHECK(loaded->info.unit == 0x1p-10);
  for (std::size_t i = 0; i < 3; ++i) CHECK(loaded->info.views[i].lens == info.views[i].lens);

  for (const double unit : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    CAPTURE(unit);
    info.unit = unit;
    REQUIRE(write_model(path, model, info).ok());
    const Result<LoadedModel<StoredRecipe>> refused = read_model<StoredRecipe>(path);
    REQUIRE_FALSE(refused.ok());
    // JSON has no number that is not finite: there it is of another type.
    CHECK(refused.error().field == (std::isfinite(unit) ? "__metadata__.info.unit" : "__metadata__.info"));
  }
  info.unit = 1;

  info.views[2].lens.parameters[3] = std::numeric_limits<double>::infinity();
  REQUIRE(write_model(path, model, info).ok());
  CHECK(read_model<StoredRecipe>(path).error().field == "camera.lens");
  info.views[2].lens = {static_cast<LensModel>(lens_model_count), {}};
  REQUIRE(write_model(path, model, info).ok());
  CHECK(read_model<StoredRecipe>(path).error().field == "camera.lens");
  std::filesystem::remove(path);
}

TEST_CASE("training/model_file: a name that is no UTF-8 loses its wrong bytes, not the model") {
  const std::filesystem::path path = temporary("f.safetensors");
  ModelInfo info = example_info();
  info.views[1].name = "caf\xE9";
  REQUIRE(write_model(path, example(), info).ok());
  const Result<LoadedModel<StoredRecipe>> loaded = read_model<StoredRecipe>(path);
  REQUIRE(loaded.ok());
  CHECK(loaded->info.views[1].name == "caf\xEF\xBF\xBD");
  std::filesystem::remove(path);
}

TEST_CASE("training/model_file: every truncation of a file is an error with the file's name, and no crash") {
  const std::filesystem::path path = temporary("c.safetensors");
  REQUIRE(write_model(path, example(), example_info()).ok());
  const std::vector<std::byte> bytes = *read_file(path);
  for (std::size_t size = 0; size < bytes.size(); size += std::max<std::size_t>(1, bytes.size() / 400)) {
    REQUIRE(write_file(path, std::span<const std::byte>(bytes).first(size)).ok());
    const Result<LoadedModel<StoredRecipe>> loaded = read_model<StoredRecipe>(path);
    REQUIRE(!loaded.ok());
    CHECK(loaded.error().line().find(path.string()) != std::string::npos);
    CHECK(!loaded.error().remedy.empty());
  }
  std::filesystem::remove(path);
}

TEST_CASE("training/model_file: another shape, another format and a value that is not finite are told by field") {
  const std::filesystem::path path = temporary("d.safetensors");
  Model<StoredRecipe> model = example();
  REQUIRE(write_model(path, model, example_info()).ok());
  const Result<LoadedModel<WiderRecipe>> wider = read_model<WiderRecipe>(path);
  REQUIRE(!wider.ok());
  CHECK(wider.error().field.find("shape") != std::string::npos);

  anchor_values(model.arena, model.anchors).scaling.data[3] = std::numeric_limits<float>::quiet_NaN();
  REQUIRE(write_model(path, model, example_info()).ok());
  const Result<LoadedModel<StoredRecipe>> poisoned = read_model<StoredRecipe>(path);
  REQUIRE(!poisoned.ok());
  CHECK(poisoned.error().field == "anchor.scaling");

  SafetensorsWriter other;
  other.metadata = {{"format", "something else"}};
  REQUIRE(other.write(path).ok());
  const Result<LoadedModel<StoredRecipe>> foreign = read_model<StoredRecipe>(path);
  REQUIRE(!foreign.ok());
  CHECK(foreign.error().field == "__metadata__.format");
  std::filesystem::remove(path);
}
