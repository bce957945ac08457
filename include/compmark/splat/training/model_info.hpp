// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Information in a model file beside the blocks of its model: where it comes from, the views it was trained with, the
// numbers a render needs (fields in model_file.hpp). Nothing here depends on a recipe's type, so that a program
// compiles it once for all recipes. Every number is checked before it is used.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/json_file.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/splat/anchor/decoder_shape.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/view_row.hpp"

namespace compmark {

/// ModelInfo::profile of splats that came without cameras: those of the model were made up round them.
inline constexpr const char* splats_profile = "splats";

/// Where a model comes from.
struct ModelInfo {
  std::string recipe;
  std::string profile;
  std::int64_t iterations = 0;
  std::uint64_t seed = 0;
  std::vector<std::string> effects;
  std::vector<StoredView> views;
  /// Plus `unit` times a position of the model is one in the dataset's files (Dataset::origin, Dataset::unit).
  std::array<double, 3> origin{0, 0, 0};
  double unit = 1;
  std::optional<std::array<double, 3>> up{};  ///< of length 1: of splats without cameras, where somebody says it
  bool around_splats = false;                 ///< trained from splats: its cameras were made up round them
  /// Side of the cubes of spread marks (app/spread.hpp), units of the model, where the file says it: one that stores
  /// not all cameras and anchors of the model that was marked. 0: follows from the model's own.
  double spread_side = 0;
  std::array<double, 3> base_step{1, 0.001, 0.2};  ///< Q0 of features, scales and offsets, with an entropy model
};

/// Whether the cameras of a model are those of no photograph, but were made up round splats.
[[nodiscard]] inline bool cameras_are_made_up(const ModelInfo& info) {
  return info.profile == splats_profile || info.around_splats;
}

namespace detail {

inline constexpr const char* model_format = "compmark.model";

template <class Json = nlohmann::json>
[[nodiscard]] Json shape_json(const DecoderShape& shape) {
  Json json;
  json["feature_dim"] = shape.feature_dim;
  json["offsets"] = shape.offsets;
  json["distance"] = shape.distance;
  json["feature_bank"] = shape.feature_bank;
  json["appearance_dim"] = shape.appearance_dim;
  return json;
}

/// Information of a model file beside its blocks and views. Nothing in it depends on a recipe's type, so that its users
/// are compiled once.
struct ModelNumbers {
  DecoderShape shape;
  double voxel_size = 0;
  std::size_t train_views = 0;
  RenderSettings render;
  bool coded = false;  ///< the recipe has an entropy model, so ModelInfo::base_step counts
};

/// Bytes of a name that are no UTF-8 become U+FFFD; open_dataset refuses such names.
template <class Json = nlohmann::json>
[[nodiscard]] std::string info_text(const ModelNumbers& model, const ModelInfo& info) {
  Json views = Json::array();
  for (const StoredView& view : info.views) {
    Json entry;
    entry["name"] = view.name;
    entry["test"] = view.test;
    views.push_back(std::move(entry));
  }
  Json json;
  json["recipe"] = info.recipe;
  json["profile"] = info.profile;
  json["iterations"] = info.iterations;
  json["seed"] = info.seed;
  json["effects"] = info.effects;
  json["shape"] = shape_json<Json>(model.shape);
  json["voxel_size"] = model.voxel_size;
  json["train_views"] = model.train_views;
  json["near_plane"] = model.render.near_plane;
  json["blur_variance"] = model.render.blur_variance;
  json["background"] = model.render.background;
  json["views"] = views;
  if (info.origin != std::array<double, 3>{0, 0, 0}) json["origin"] = info.origin;
  if (info.unit != 1) json["unit"] = info.unit;
  if (info.up) json["up"] = *info.up;
  if (info.around_splats) json["around_splats"] = true;
  if (info.spread_side > 0) json["spread_side"] = info.spread_side;
  if (model.coded) json["base_step"] = info.base_step;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

inline void add_camera_tensors(SafetensorsWriter& writer, const std::vector<StoredView>& views) {
  if (views.empty()) return;
  std::vector<double> table, lenses;
  for (const StoredView& view : views) {
    append_camera_row(view.camera, table);
    append_lens_row(view.lens, lenses);
  }
  const auto rows = static_cast<std::int64_t>(views.size());
  writer.add_copy<double>("camera.table", {rows, static_cast<std::int64_t>(camera_numbers)}, table);
  if (std::all_of(views.begin(), views.end(), [](const StoredView& view) { return is_pinhole(view.lens); })) return;
  writer.add_copy<double>("camera.lens", {rows, static_cast<std::int64_t>(lens_numbers)}, lenses);
}

[[nodiscard]] inline Error model_error(const SafetensorsFile& file, std::string field, std::string problem) {
  return {ErrorKind::invalid, file.path, std::move(field), std::move(problem),
          "check that this is a model file written by this version or an older one"};
}

/// Numbers of the views' cameras, and of their lenses where the file has any.
[[nodiscard]] inline Result<Done> read_camera_tensors(const SafetensorsFile& file, std::vector<StoredView>& views) {
  if (views.empty()) return Done{};
  const Result<std::vector<double>> table = file.values<double>("camera.table");
  if (!table) return table.error();
  if (table->size() != views.size() * camera_numbers)
    return model_error(file, "camera.table", "does not have 18 numbers a view");
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto row = std::span(*table).subspan(camera_numbers * i).first<camera_numbers>();
    if (!read_camera_row(row, views[i].camera))
      return model_error(file, "camera.table", "view " + views[i].name + " has an impossible camera");
  }
  if (!file.has("camera.lens")) return Done{};
  const Result<std::vector<double>> lenses = file.values<double>("camera.lens");
  if (!lenses) return lenses.error();
  if (lenses->size() != views.size() * lens_numbers)
    return model_error(file, "camera.lens", "does not have 17 numbers a view");
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto row = std::span(*lenses).subspan(lens_numbers * i).first<lens_numbers>();
    if (!read_lens_row(row, views[i].lens))
      return model_error(file, "camera.lens", "view " + views[i].name + " has an impossible lens");
  }
  return Done{};
}

/// Reads the cameras and the info; every number is checked to be finite and in range.
template <class Json>
[[nodiscard]] Result<ModelInfo> read_info(const SafetensorsFile& file, const Json& json) {
  ModelInfo info;
  try {
    info.recipe = json.at("recipe").template get<std::string>();
    info.profile = json.at("profile").template get<std::string>();
    info.iterations = json.at("iterations").template get<std::int64_t>();
    info.seed = json.at("seed").template get<std::uint64_t>();
    info.effects = json.at("effects").template get<std::vector<std::string>>();
    if (json.contains("origin")) info.origin = json["origin"].template get<std::array<double, 3>>();
    if (json.contains("unit")) info.unit = json["unit"].template get<double>();
    if (json.contains("up")) info.up = json["up"].template get<std::array<double, 3>>();
    if (json.contains("around_splats")) info.around_splats = json["around_splats"].template get<bool>();
    if (json.contains("spread_side")) info.spread_side = json["spread_side"].template get<double>();
    if (json.contains("base_step")) info.base_step = json["base_step"].template get<std::array<double, 3>>();
    for (const Json& view : json.at("views")) {
      StoredView stored;
      stored.name = view.at("name").template get<std::string>();
      stored.test = view.at("test").template get<bool>();
      info.views.push_back(std::move(stored));
    }
  } catch (const typename Json::exception& problem) {
    return model_error(file, "__metadata__.info", problem.what());
  }
  for (const double x : info.origin) {
    if (!std::isfinite(x)) return model_error(file, "__metadata__.info.origin", "is not finite");
  }
  if (!(info.unit > 0) || !std::isfinite(info.unit))
    return model_error(file, "__metadata__.info.unit", "is not a positive number");
  if (info.up && !(std::abs(std::hypot((*info.up)[0], (*info.up)[1], (*info.up)[2]) - 1) < 1e-6))
    return model_error(file, "__metadata__.info.up", "is not a direction of length 1");
  if (json.contains("spread_side") && (!(info.spread_side > 0) || !std::isfinite(info.spread_side)))
    return model_error(file, "__metadata__.info.spread_side", "is not a positive number");
  for (const double step : info.base_step) {
    if (!(step > 0)) return model_error(file, "__metadata__.info.base_step", "is not positive");
  }
  if (Result<Done> cameras = read_camera_tensors(file, info.views); !cameras) return cameras.error();
  return info;
}

/// A file's numbers, checked, before any block is made. `shape` is what the recipe wants.
struct ModelHead {
  ModelInfo info;
  ModelNumbers numbers;
  std::size_t rows = 0;  ///< anchors; the file's bytes back this count, so the blocks fit in memory
};

template <class Json = nlohmann::json>
[[nodiscard]] Result<ModelHead> read_head(const SafetensorsFile& file, const DecoderShape& shape) {
  const Result<std::string> text = file.text_of("info");
  if (!text) return text.error();
  const Json json = json_from<Json>(*text);
  if (json.is_discarded() || !json.is_object()) return model_error(file, "__metadata__.info", "is not a JSON object");
  Result<ModelInfo> info = read_info(file, json);
  if (!info) return info.error();
  if (!json.contains("shape") || json["shape"] != shape_json<Json>(shape)) {
    return model_error(file, "__metadata__.info.shape", "is not the shape of recipe " + info->recipe);
  }
  ModelHead head;
  head.info = std::move(*info);
  ModelNumbers& numbers = head.numbers;
  numbers.shape = shape;
  try {
    numbers.train_views = json.at("train_views").template get<std::size_t>();
    numbers.voxel_size = json.at("voxel_size").template get<double>();
    numbers.render.near_plane = json.at("near_plane").template get<double>();
    numbers.render.blur_variance = json.at("blur_variance").template get<double>();
    numbers.render.background = json.at("background").template get<std::array<double, 3>>();
  } catch (const typename Json::exception& problem) {
    return model_error(file, "__metadata__.info", problem.what());
  }
  if (!(numbers.voxel_size > 0) || !(numbers.render.near_plane > 0) || !(numbers.render.blur_variance >= 0) ||
      numbers.train_views > (std::size_t{1} << 24)) {
    return model_error(file, "__metadata__.info", "has a number out of range");
  }
  const Result<SafetensorsTensor> position = file.tensor("anchor.position");
  if (!position) return position.error();
  if (position->shape.size() != 2 || position->shape[1] != 3)
    return model_error(file, "anchor.position", "is not of shape [N, 3]");
  head.rows = static_cast<std::size_t>(position->shape[0]);
  const Result<SafetensorsTensor> feature = file.tensor("anchor.feature");
  if (!feature) return feature.error();
  if (feature->shape.size() != 2 || static_cast<std::size_t>(feature->shape[0]) != head.rows) {
    return model_error(file, "anchor.feature", "has another number of rows than anchor.position");
  }
  return head;
}

}  // namespace detail

/// Name of the recipe that a model file was written with, to choose the type to read it with.
template <class Json = nlohmann::json>
[[nodiscard]] Result<std::string> model_recipe(const SafetensorsFile& file) {
  if (const Result<Done> kind = expect_kind(file, FileKind::model); !kind) return kind.error();
  const Result<std::string> format = file.text_of("format");
  if (!format) return format.error();
  if (*format != detail::model_format)
    return detail::model_error(file, "__metadata__.format", "is \"" + *format + "\"");
  const Result<std::string> text = file.text_of("info");
  if (!text) return text.error();
  const Json json = json_from<Json>(*text);
  if (json.is_discarded() || !json.contains("recipe") || !json["recipe"].is_string()) {
    return detail::model_error(file, "__metadata__.info.recipe", "is missing");
  }
  return json["recipe"].template get<std::string>();
}

}  // namespace compmark
