// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Models of explicit Gaussians (splat/anchor/explicit_decoder.hpp) as the table that a 3DGS file holds, and back: the
// same numbers in other units, so that nothing is lost on the way to a viewer, and any splat file becomes a model that
// can be rendered, trained on, marked and compressed. Cost: one pass.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/splat_table.hpp"
#include "compmark/splat/anchor/explicit_decoder.hpp"
#include "compmark/splat/training/model.hpp"

namespace compmark {

namespace detail {
template <class Decoder>
inline constexpr int explicit_degree = -1;
template <class T, int degree>
inline constexpr int explicit_degree<ExplicitDecoder<T, degree>> = degree;
}  // namespace detail

/// A recipe whose model is a table of Gaussians.
template <class R>
concept ExplicitModelRecipe = Recipe<R> && detail::explicit_degree<typename R::GaussianDecoder>
>= 0;

/// Row i is anchor i. Exact but for the rounding of one product and sum a number.
template <ExplicitModelRecipe R>
[[nodiscard]] SplatTable explicit_splats(const Model<R>& model) {
  using Layout = typename R::GaussianDecoder::Layout;
  const auto columns = model.columns();
  SplatTable table;
  table.resize(columns.rows(), detail::explicit_degree<typename R::GaussianDecoder>);
  for (std::size_t row = 0; row < table.count; ++row) {
    const auto* const feature = columns.feature.row(row);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      table.mean[axis][row] = static_cast<float>(columns.position(row, axis) +
                                                 columns.offset(row, axis) * std::exp(columns.scaling(row, axis)));
      table.log_scale[axis][row] = static_cast<float>(columns.scaling(row, 3 + axis));
    }
    for (std::size_t k = 0; k < 4; ++k) {
      table.rotation[k][row] = static_cast<float>(
          Layout::rotation_unit * static_cast<double>(feature[Layout::rotation + k]) + (k == 0 ? 1 : 0));
    }
    table.opacity[row] =
        static_cast<float>(Layout::opacity_unit * static_cast<double>(feature[Layout::opacity]) + Layout::opacity_zero);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      for (std::size_t i = 0; i < Layout::coefficients; ++i) {
        table.color(channel, i)[row] = static_cast<float>(
            Layout::color_unit(i) * static_cast<double>(feature[Layout::color + channel * Layout::coefficients + i]));
      }
    }
  }
  return table;
}

/// What a table may hold and a model may not: a model's numbers are finite.
struct SplatLimits {
  double least_log_scale = -30;  ///< 1e-13 world units: flat
  double most_logit = 30;        ///< opaque to 1e-13
};

/// The model of a table of at most the recipe's degree; an anchor's moves are in units of its largest scale. The
/// rotations are normalised. An Error where the table has more coefficients than the recipe, or no rows.
template <ExplicitModelRecipe R>
[[nodiscard]] Result<Model<R>> model_from_splats(const SplatTable& table, const RenderSettings& render = {},
                                                 const SplatLimits& limits = {}) {
  using T = typename R::Scalar;
  using Layout = typename R::GaussianDecoder::Layout;
  constexpr int degree = detail::explicit_degree<typename R::GaussianDecoder>;
  if (table.degree > degree) {
    return Error{ErrorKind::unsupported,
                 {},
                 "f_rest",
                 "are spherical harmonics of degree " + std::to_string(table.degree) + ", the recipe holds degree " +
                     std::to_string(degree),
                 "use a recipe of that degree"};
  }
  if (table.count == 0) return Error{ErrorKind::invalid, {}, "vertex", "has no rows", "export the file again"};
  Model<R> model;
  model.create(table.count, 0);
  model.render = render;
  const AnchorColumns<T> columns = anchor_values(model.arena, model.anchors);
  for (std::size_t row = 0; row < table.count; ++row) {
    T* const feature = columns.feature.row(row);
    double largest = limits.least_log_scale, norm = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double scale = std::max(limits.least_log_scale, static_cast<double>(table.log_scale[axis][row]));
      columns.position(row, axis) = static_cast<T>(table.mean[axis][row]);
      columns.scaling(row, 3 + axis) = static_cast<T>(scale);
      largest = std::max(largest, scale);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) columns.scaling(row, axis) = static_cast<T>(largest);
    for (std::size_t k = 0; k < 4; ++k) norm = std::hypot(norm, static_cast<double>(table.rotation[k][row]));
    for (std::size_t k = 0; k < 4; ++k) {
      const double q = norm > 0 ? static_cast<double>(table.rotation[k][row]) / norm : (k == 0 ? 1 : 0);
      feature[Layout::rotation + k] = static_cast<T>((q - (k == 0 ? 1 : 0)) / Layout::rotation_unit);
    }
    const double logit = std::clamp(static_cast<double>(table.opacity[row]), -limits.most_logit, limits.most_logit);
    feature[Layout::opacity] = static_cast<T>((logit - Layout::opacity_zero) / Layout::opacity_unit);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      for (std::size_t i = 0; i < table.coefficients(); ++i) {
        feature[Layout::color + channel * Layout::coefficients + i] =
            static_cast<T>(static_cast<double>(table.color(channel, i)[row]) / Layout::color_unit(i));
      }
    }
  }
  return model;
}

}  // namespace compmark
