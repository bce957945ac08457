// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <compmark/core/random.hpp>
#include <compmark/io/atomic_file.hpp>
#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/far_field.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "support/scene_files.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using Json = nlohmann::json;
using compmark::testing::ring_camera;
using compmark::testing::TemporaryFolder;

constexpr std::size_t row_count = 21, view_count = 3;
struct Appearance : DefaultRecipe<float, DecoderShape{.appearance_dim = 16}> {};

/// One number of a tensor: a function of name and place, so that a block has the same values in every model.
float value_of(const std::string& tensor, std::size_t i) {
  return static_cast<float>(Random(3, 0, random_stage(tensor)).centered(i));
}

/// Whoever writes a model by hand, from the sentences of model_file.hpp and the shapes of Scaffold-GS (D = 32, K = 10): no type of the
/// library but the camera is in it, and no name of an effect.
struct HandWritten {
  using Shape = std::array<std::size_t, 2>;
  std::map<std::string, Shape> tensors{{"anchor.position", {row_count, 3}},
                                       {"anchor.offset", {row_count, 30}},
                                       {"anchor.scaling", {row_count, 6}},
                                       {"anchor.feature", {row_count, 32}}};
  std::map<std::string, std::vector<double>> doubles;
  Json info;

  HandWritten() {
    for (const auto& [name, outputs] :
         std::map<std::string, std::size_t>{{"opacity", 10}, {"covariance", 70}, {"color", 30}}) {
      tensors["mlp_" + name + ".0.weight"] = {32, 32 + 3};  // feature and direction
      tensors["mlp_" + name + ".0.bias"] = {1, 32};
      tensors["mlp_" + name + ".2.weight"] = {outputs, 32};
      tensors["mlp_" + name + ".2.bias"] = {1, outputs};
    }
    info = {
        {"recipe", "r"},
        {"profile", "scaffold"},
        {"iterations", 1234},
        {"seed", 77},
        {"effects", Json::array()},
        {"shape",
         {{"feature_dim", 32}, {"offsets", 10}, {"distance", false}, {"feature_bank", false}, {"appearance_dim", 0}}},
        {"voxel_size", 0.125},
        {"train_views", view_count},
        {"near_plane", 0.2},
        {"blur_variance", 0.3},
        {"background", {0.0, 0.0, 0.0}},
        {"views", Json::array()}};
    std::vector<double>& table = doubles["camera.table"];
    for (std::size_t i = 0; i < view_count; ++i) {
      const Camera<double> c = ring_camera(i, view_count, 64, 48);
      info["views"].push_back({{"name", "view " + std::to_string(i)}, {"test", i == 2}});
      table.insert(table.end(), {64, 48, c.fx, c.fy, c.cx, c.cy});
      table.insert(table.end(), c.rotation_camera_world.begin(), c.rotation_camera_world.end());
      table.insert(table.end(), c.center_world.begin(), c.center_world.end());
    }
  }

  /// Length of the header, header, padding to 64 bytes, the doubles by name, the floats by name.
  [[nodiscard]] std::string file(const std::string& checksum = "") const {
    Json header;
    header["__metadata__"] = {{"format", "compmark.model"}, {"version", "1"}, {"info", info.dump()}};
    if (!checksum.empty()) header["__metadata__"]["checksum"] = checksum;  // files of before have none
    std::string data;
    const auto add = [&](const std::string& name, const char* type, std::size_t count, std::size_t columns,
                         const void* from, std::size_t bytes) {
      header[name] = {
          {"dtype", type}, {"shape", {count, columns}}, {"data_offsets", {data.size(), data.size() + bytes}}};
      data.append(static_cast<const char*>(from), bytes);
    };
    for (const auto& [name, values] : doubles)
      add(name, "F64", view_count, values.size() / view_count, values.data(), 8 * values.size());
    for (const auto& [name, shape] : tensors) {
      std::vector<float> values(shape[0] * shape[1]);
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = value_of(name, i);
      add(name, "F32", shape[0], shape[1], values.data(), 4 * values.size());
    }
    std::string text = header.dump();
    text.append((64 - (text.size() + 8) % 64) % 64, ' ');
    const std::uint64_t length = text.size();
    std::string bytes(8, '\0');
    std::memcpy(bytes.data(), &length, 8);
    return bytes + text + data;
  }
  [[nodiscard]] std::size_t blocks() const { return tensors.size(); }
  [[nodiscard]] std::size_t parameters() const {
    std::size_t sum = 0;
    for (const auto& [name, shape] : tensors) sum += shape[0] * shape[1];
    return sum;
  }
};

ModelInfo info_of_views() {
  ModelInfo info{"r", "scaffold", 1234, 77, {}, {}};
  for (std::size_t i = 0; i < view_count; ++i)
    info.views.push_back({"view " + std::to_string(i), i == 2, ring_camera(i, view_count, 64, 48)});
  return info;
}

template <class R>
Model<R> filled_model() {
  Model<R> model;
  model.create(row_count, view_count);
  model.voxel_size = 0.125;
  for (const ArenaLayout::Block& block : model.arena.layout().blocks()) {
    const std::span<float> values = model.arena.all_values().subspan(block.offset, block.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = value_of(block.name, i);
  }
  return model;
}

/// Bytes of the model file that the library writes.
template <class R>
std::string written(const Model<R>& model, const ModelInfo& info) {
  const TemporaryFolder folder;
  REQUIRE(write_model(folder.path() / "model.safetensors", model, info).ok());
  const auto bytes = read_file(folder.path() / "model.safetensors");
  REQUIRE(bytes.ok());
  return {reinterpret_cast<const char*>(bytes->data()), bytes->size()};
}

/// The checksum in a model file's metadata: of the content, so no part of what is written by hand.
std::string checksum_of(const std::string& file) {
  const std::size_t begin = file.find("xxh64:");
  REQUIRE(begin != std::string::npos);
  return file.substr(begin, 22);
}

/// Bytes after the header.
std::size_t data_size(const std::string& file) {
  std::uint64_t length = 0;
  std::memcpy(&length, file.data(), 8);
  return file.size() - 8 - length;
}

template <class R>
void check_same(const HandWritten& hand, const ModelInfo& info = info_of_views()) {
  const Model<R> model = filled_model<R>();
  CHECK(model.arena.layout().blocks().size() == hand.blocks());
  std::size_t parameters = 0;
  for (const ArenaLayout::Block& block : model.arena.layout().blocks()) parameters += block.size();
  CHECK(parameters == hand.parameters());
  const std::string file = written(model, info);
  const std::string expected = hand.file(checksum_of(file));
  CHECK(file.size() == expected.size());
  CHECK((file == expected));  // in parentheses: doctest would print them
}

}  // namespace

TEST_CASE_TEMPLATE(
    "training/effects_bytes: a model file without blocks of effects is, byte for byte, one written by hand without "
    "them",
    R, recipes::Scaffold, recipes::ScaffoldMasked, recipes::ScaffoldAlpha, recipes::ScaffoldAntiAliased,
    recipes::ScaffoldAntiAliasedMasked, recipes::ScaffoldAlphaAntiAliased, recipes::ScaffoldLens,
    recipes::ScaffoldFisheye, recipes::ScaffoldFarField) {
  check_same<R>(HandWritten());
}

TEST_CASE_TEMPLATE("training/effects_bytes: exposure adds twelve numbers a view to the file, and nothing else", R,
                   recipes::ScaffoldExposure, recipes::ScaffoldExposureMasked, recipes::ScaffoldFarFieldExposure) {
  HandWritten hand;
  hand.tensors["exposure"] = {view_count, 12};
  check_same<R>(hand);
  CHECK(data_size(hand.file()) == data_size(HandWritten().file()) + 4 * 12 * view_count);
  const std::string file = written(filled_model<R>(), info_of_views());
  CHECK((file != HandWritten().file(checksum_of(file))));  // the control
}

TEST_CASE("training/effects_bytes: a number of views that the file does not bear out is no reason to take memory") {
  const testing::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "model.safetensors";
  const Model<recipes::ScaffoldExposure> model = filled_model<recipes::ScaffoldExposure>();
  auto numbers = detail::numbers_of(model);
  for (const std::size_t views : {numbers.train_views, std::size_t{1} << 24}) {  // 805 MB of exposures
    CAPTURE(views);
    const bool right = views == numbers.train_views;
    numbers.train_views = views;
    REQUIRE(detail::write_model_file(path, model.arena, numbers, info_of_views()).ok());
    const Result<SafetensorsFile> file = read_safetensors(path);
    REQUIRE(file.ok());
    const Result<LoadedModel<recipes::ScaffoldExposure>> loaded = model_from<recipes::ScaffoldExposure>(*file);
    CHECK(loaded.ok() == right);
    if (!right) {
      CHECK(loaded.error().field == "exposure");
      CHECK(loaded.error().problem.find("16777216 views") != std::string::npos);
    }
  }
}

TEST_CASE(
    "training/effects_bytes: the appearance embedding adds its table, its columns of the colour head, and its width") {
  HandWritten hand;
  hand.tensors["appearance"] = {view_count, 16};
  hand.tensors["mlp_color.0.weight"] = {32, 32 + 3 + 16};
  hand.info["shape"]["appearance_dim"] = 16;
  check_same<Appearance>(hand);
  CHECK(data_size(hand.file()) == data_size(HandWritten().file()) + 4 * 16 * (view_count + 32));
}

TEST_CASE("training/effects_bytes: a lens in the projection adds seventeen numbers a view, where a view has one") {
  HandWritten hand;
  ModelInfo info = info_of_views();
  info.views[1].lens = {LensModel::opencv, {0.1, -0.2, 1e-3, 0.3}};
  std::vector<double>& table = hand.doubles["camera.lens"];
  table.resize(17 * view_count);
  for (std::size_t i = 0; i < view_count; ++i) table[17 * i] = static_cast<double>(info.views[i].lens.model);
  std::copy_n(info.views[1].lens.parameters.begin(), 4, table.begin() + 18);
  check_same<recipes::ScaffoldLens>(hand, info);
  CHECK(data_size(hand.file()) == data_size(HandWritten().file()) + 8 * 17 * view_count);
}

TEST_CASE(
    "training/effects_bytes: names of effects are in the file of a model that was trained with them, and in no other") {
  HandWritten hand;
  ModelInfo info = info_of_views();
  info.effects = {"masks", "exposure"};
  const std::string file = written(filled_model<recipes::Scaffold>(), info);
  CHECK((file != hand.file(checksum_of(file))));
  hand.info["effects"] = {"masks", "exposure"};
  check_same<recipes::Scaffold>(hand, info);
}
