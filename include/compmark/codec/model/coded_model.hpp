// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Converts between a model that renders and a CodecModel: coded_model() turns a trained Model of a recipe with an
// entropy model into a CodecModel, model_from() turns a decoded one back. Anchors must lie on the voxel grid, as those
// of every recipe without a contracted space do. Scales are stored, the table holds their logarithms: both ways go
// through double, once, so that the same file gives the same bits. A decoded model renders; the context that predicted
// it stays with the file. Cost: one copy of the model. Longer than 300 lines: both ways side by side, so that what the
// one stores the other reads, and what is wrong is told field by field.
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

#include "compmark/codec/container/codec_model.hpp"
#include "compmark/codec/model/coded_context.hpp"
#include "compmark/codec/model/coded_views.hpp"
#include "compmark/codec/model/grid_anchors.hpp"
#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/codec/rate/stages/rate.hpp"
#include "compmark/core/result.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/model_file.hpp"

namespace compmark {

struct CodedModelSettings {
  TensorStorage networks = TensorStorage::half;
  StoredCameras cameras = StoredCameras::test;
  bool intra = false;                        ///< the codec is HAC-plus, which codes what was trained for HAC
  std::optional<CoarseSteps> first_level{};  ///< with `intra`: CodecModel::first_level
};

namespace detail {

/// Smallest scale a model is given, world units: a scale of zero has no logarithm.
inline constexpr double least_coded_scale = 1e-6;

}  // namespace detail

/// The cells that a model's anchors lie in, in their order. Cost: linear.
template <Recipe R>
[[nodiscard]] Result<std::vector<Voxel>> anchor_voxels(const Model<R>& model) {
  const auto columns = model.columns();
  std::vector<Voxel> voxels;
  voxels.reserve(model.anchor_count());
  for (std::size_t i = 0; i < model.anchor_count(); ++i) {
    Voxel voxel{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto [cell, in_range, on_grid] =
          detail::anchor_cell(static_cast<double>(columns.position(i, axis)), model.voxel_size);
      if (!on_grid) {
        return detail::coded_error("anchor.position[" + std::to_string(i) + "]",
                                   "does not lie on the grid of cells of " + std::to_string(model.voxel_size),
                                   "fit a codec to it, which moves its anchors there: compmark fit-codec");
      }
      voxel[axis] = static_cast<std::int32_t>(cell);
    }
    voxels.push_back(voxel);
  }
  return voxels;
}

/// The CodecModel of a trained model, with its context. `base_step` is that of the training (RateNumbers).
template <Recipe R>
  requires present<typename R::EntropyModel>
[[nodiscard]] Result<CodecModel> coded_model(const Model<R>& model, const ModelInfo& info,
                                             const CodedModelSettings& settings = {}) {
  using Scalar = typename R::Scalar;
  constexpr DecoderShape shape = R::AnchorModel::shape;
  if constexpr (present<typename R::Space>) {
    return detail::coded_error("space", "is contracted: its anchors do not lie on a grid, which is how they are coded",
                               "fit a codec to it, which moves its anchors onto one: compmark fit-codec");
  }
  CodecModel coded;
  coded.voxel_size = model.voxel_size;
  coded.feature_dim = shape.feature_dim;
  coded.offset_count = shape.offsets;
  coded.base_step = info.base_step;

  const AnchorColumns<const Scalar> columns = model.columns();
  const MatrixView<const Scalar> mask = model.arena.values(model.template blocks<RateStage>().mask);
  const std::size_t rows = model.anchor_count();
  Result<std::vector<Voxel>> voxels = anchor_voxels(model);
  if (!voxels) return voxels.error();
  coded.voxels = std::move(*voxels);
  coded.mask.reserve(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    std::uint32_t unmasked = 0;
    for (std::size_t k = 0; k < mask.columns; ++k) unmasked |= is_unmasked(mask(i, k)) ? 1u << k : 0u;
    coded.mask.push_back(unmasked);
  }
  coded.feature = detail::coded_floats(columns.feature);
  coded.offset = detail::coded_floats(columns.offset);
  coded.scale.resize(rows * 6);
  for (std::size_t i = 0; i < coded.scale.size(); ++i) {
    coded.scale[i] = static_cast<float>(std::exp(static_cast<double>(columns.scaling.data[i])));
  }

  if (const Result<Done> stored = detail::store_context(model, coded); !stored) return stored.error();
  if (settings.intra && !coded.trained)
    return detail::coded_error("recipe", info.recipe + " is not trained for hac, whose models hac_plus codes",
                               "train with --codec hac");
  if (settings.intra) {
    coded.intra.emplace();
    coded.first_level = settings.first_level;
  }

  for (const ArenaLayout::Block& part : model.arena.layout().blocks()) {
    if (part.kind != RowKind::fixed || part.role == BlockRole::context) continue;
    const std::span<const Scalar> values = model.arena.all_values().subspan(part.offset, part.size());
    CodecTensor tensor;
    tensor.name = part.name;
    tensor.shape = {static_cast<std::uint32_t>(part.rows), static_cast<std::uint32_t>(part.columns)};
    for (const Scalar value : values) tensor.values.push_back(static_cast<float>(value));
    tensor.storage = settings.networks;
    coded.networks.push_back(std::move(tensor));
  }
  coded.metadata = {{"recipe", info.recipe},
                    {"profile", info.profile},
                    {"iterations", info.iterations},
                    {"seed", static_cast<std::int64_t>(info.seed)},
                    {"effects", detail::names_text(info.effects)},
                    {"train_views", static_cast<std::int64_t>(model.train_views)},
                    {"near_plane", model.render.near_plane},
                    {"blur_variance", model.render.blur_variance},
                    {"background", detail::packed_doubles(model.render.background)}};
  if (info.origin != std::array<double, 3>{0, 0, 0}) coded.metadata["origin"] = detail::packed_doubles(info.origin);
  if (info.unit != 1) coded.metadata["unit"] = info.unit;
  if (info.up) coded.metadata["up"] = detail::packed_doubles(*info.up);
  if (cameras_are_made_up(info)) coded.metadata["around_splats"] = std::int64_t{1};
  if (info.spread_side > 0) coded.metadata["spread_side"] = info.spread_side;
  detail::store_views(info, settings.cameras, coded);
  return coded;
}

/// Name of the recipe that a compressed model was trained with, to choose the type to render it with.
[[nodiscard]] inline Result<std::string> model_recipe(const CodecModel& coded) {
  const auto found = coded.metadata.find("recipe");
  if (found == coded.metadata.end() || !std::holds_alternative<std::string>(found->second)) {
    return detail::coded_error("META.recipe", "is missing", "encode the model again");
  }
  return std::get<std::string>(found->second);
}

/// The provenance of a compressed model, from its file.
template <class Json = nlohmann::json>
[[nodiscard]] Result<ModelInfo> model_info(const CodecModel& coded) {
  ModelInfo info;
  const auto fail = [](const char* key) {
    return detail::coded_error(std::string("META.") + key, "is missing or of another type", "encode the model again");
  };
  const auto get = [&](const char* key, auto& value) {
    const auto found = coded.metadata.find(key);
    if (found == coded.metadata.end()) return false;
    const auto* stored = std::get_if<std::remove_cvref_t<decltype(value)>>(&found->second);
    if (stored != nullptr) value = *stored;
    return stored != nullptr;
  };
  std::int64_t seed = 0;
  std::int64_t around_splats = 0;
  std::string effects, origin, up;
  if (!get("recipe", info.recipe)) return fail("recipe");
  if (!get("profile", info.profile)) return fail("profile");
  if (!get("iterations", info.iterations)) return fail("iterations");
  if (!get("seed", seed)) return fail("seed");
  if (!get("effects", effects)) return fail("effects");
  info.seed = static_cast<std::uint64_t>(seed);
  const Json list = json_from<Json>(effects);
  if (!list.is_array()) return fail("effects");
  for (const Json& effect : list) {
    if (!effect.is_string()) return fail("effects");
    info.effects.push_back(effect.template get<std::string>());
  }
  if (get("origin", origin)) {
    const std::vector<double> numbers = detail::unpacked_doubles(origin);
    if (numbers.size() != 3 || !std::isfinite(numbers[0] + numbers[1] + numbers[2])) return fail("origin");
    std::copy_n(numbers.begin(), 3, info.origin.begin());
  }
  if (coded.metadata.contains("unit") && (!get("unit", info.unit) || !(info.unit > 0) || !std::isfinite(info.unit)))
    return fail("unit");
  if (coded.metadata.contains("up")) {
    if (!get("up", up)) return fail("up");
    const std::vector<double> numbers = detail::unpacked_doubles(up);
    if (numbers.size() != 3 || !(std::abs(std::hypot(numbers[0], numbers[1], numbers[2]) - 1) < 1e-6))
      return fail("up");
    std::copy_n(numbers.begin(), 3, info.up.emplace().begin());
  }
  if (coded.metadata.contains("spread_side") &&
      (!get("spread_side", info.spread_side) || !(info.spread_side > 0) || !std::isfinite(info.spread_side)))
    return fail("spread_side");
  info.around_splats = get("around_splats", around_splats) && around_splats != 0;
  info.base_step = coded.base_step;
  Result<std::vector<StoredView>> views = detail::read_views<Json>(coded);
  if (!views) return views.error();
  info.views = std::move(*views);
  return info;
}

/// The model of a decoded file. Every shape and number is checked before it is used.
template <Recipe R>
  requires present<typename R::EntropyModel>
[[nodiscard]] Result<LoadedModel<R>> model_from(const CodecModel& coded) {
  using Scalar = typename R::Scalar;
  constexpr DecoderShape shape = R::AnchorModel::shape;
  Result<ModelInfo> info = model_info(coded);
  if (!info) return info.error();
  if (coded.feature_dim != shape.feature_dim || coded.offset_count != shape.offsets) {
    return detail::coded_error("META.shape", "is not that of recipe " + info->recipe, "encode the model again");
  }
  if (const Result<Done> whole = detail::check_codec_model(coded); !whole)
    return detail::coded_error(whole.error().field, whole.error().problem, "encode the model again");
  const auto number = [&](const char* key) -> const double* {
    const auto found = coded.metadata.find(key);
    return found == coded.metadata.end() ? nullptr : std::get_if<double>(&found->second);
  };
  const auto views = coded.metadata.find("train_views");
  const auto* const train_views = views == coded.metadata.end() ? nullptr : std::get_if<std::int64_t>(&views->second);
  const double* const near_plane = number("near_plane");
  const double* const blur_variance = number("blur_variance");
  const auto color = coded.metadata.find("background");
  const auto* const background = color == coded.metadata.end() ? nullptr : std::get_if<std::string>(&color->second);
  if (train_views == nullptr || *train_views < 0 || *train_views > (std::int64_t{1} << 24) || near_plane == nullptr ||
      !(*near_plane > 0 && std::isfinite(*near_plane)) || blur_variance == nullptr ||
      !(*blur_variance >= 0 && std::isfinite(*blur_variance)) || background == nullptr || background->size() != 24) {
    return detail::coded_error("META", "a render setting is missing or out of range", "encode the model again");
  }
  for (const auto& [name, rows_a_view] : Model<R>::blocks_of_views()) {
    const auto tensor = std::find_if(coded.networks.begin(), coded.networks.end(),
                                     [&, &block = name](const CodecTensor& t) { return t.name == block; });
    if (tensor == coded.networks.end() || tensor->shape.empty() ||
        tensor->shape[0] != rows_a_view * static_cast<std::uint64_t>(*train_views)) {
      return detail::coded_error("NETR." + name, "has not the rows of " + std::to_string(*train_views) + " views",
                                 "encode the model again");
    }
  }
  LoadedModel<R> loaded;
  loaded.info = std::move(*info);
  Model<R>& model = loaded.model;
  const std::size_t rows = coded.anchors();
  model.create(rows, static_cast<std::size_t>(*train_views));
  model.voxel_size = coded.voxel_size;
  model.render.near_plane = *near_plane;
  model.render.blur_variance = *blur_variance;
  const std::vector<double> rgb = detail::unpacked_doubles(*background);
  for (std::size_t c = 0; c < 3; ++c) {
    if (!std::isfinite(rgb[c]))
      return detail::coded_error("META.background", "is not finite", "encode the model again");
    model.render.background[c] = rgb[c];
  }

  const AnchorColumns<Scalar> columns = anchor_values(model.arena, model.anchors);
  const MatrixView<Scalar> mask = model.arena.values(model.template blocks<RateStage>().mask);
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      columns.position(i, axis) = static_cast<Scalar>(voxel_position(coded.voxels[i][axis], coded.voxel_size));
    }
    for (std::size_t k = 0; k < mask.columns; ++k) {
      mask(i, k) = static_cast<Scalar>((coded.mask[i] >> k & 1u) != 0 ? 0.0 : 2 * mask_threshold);
    }
  }
  std::copy(coded.feature.begin(), coded.feature.end(), columns.feature.data);
  std::copy(coded.offset.begin(), coded.offset.end(), columns.offset.data);
  for (std::size_t i = 0; i < coded.scale.size(); ++i) {
    const double scale = std::max(static_cast<double>(coded.scale[i]), detail::least_coded_scale);
    columns.scaling.data[i] = static_cast<Scalar>(std::log(scale));
  }

  if constexpr (requires {
                  model.template blocks<RateStage>().hyperprior;
                }) {  // nothing reads it; it is what it was, though
    const MatrixView<Scalar> z = model.arena.values(model.template blocks<RateStage>().hyperprior);
    if (coded.hyperprior.size() == z.size()) {
      for (std::size_t i = 0; i < z.size(); ++i) z.data[i] = static_cast<Scalar>(coded.hyperprior[i]);
    }
  }

  for (const ArenaLayout::Block& part : model.arena.layout().blocks()) {
    if (part.kind != RowKind::fixed || part.role == BlockRole::context) continue;
    const auto tensor = std::find_if(coded.networks.begin(), coded.networks.end(),
                                     [&](const CodecTensor& t) { return t.name == part.name; });
    if (tensor == coded.networks.end() ||
        tensor->shape != std::vector<std::uint32_t>{static_cast<std::uint32_t>(part.rows),
                                                    static_cast<std::uint32_t>(part.columns)} ||
        tensor->values.size() != part.size()) {
      return detail::coded_error("NETR." + part.name,
                                 "is missing or has another shape than recipe " + loaded.info.recipe + " needs",
                                 "encode the model again");
    }
    std::copy(tensor->values.begin(), tensor->values.end(),
              model.arena.all_values().begin() + static_cast<std::ptrdiff_t>(part.offset));
  }
  return loaded;
}

}  // namespace compmark
