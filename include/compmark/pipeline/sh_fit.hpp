// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One explicit Gaussian for every Gaussian slot (anchor, k) of a model, valid from all cameras: colour as spherical harmonics fitted to what
// the decoder says from many cameras, opacity, scale and rotation averaged. The mean of a slot does not depend on the view, so it is exact.
//
// Weights. A Gaussian counts in a view by what it contributes there, w = sum over pixels of (alpha * transmittance): occluded views, in which
// the networks were never trained, do not count. That sum is the gradient of the image's sum by the Gaussian's colour, so one backward pass
// of the rasterizer with an image gradient of one gives it for all.
//   colour    min_f  sum_v w_v |1/2 + sum_i f_i Y_i(d_v) - c_v|^2 + ridge W / (4 pi) sum_i (l_i (l_i + 1))^2 |f_i|^2,   W = sum_v w_v
//             (the ridge is the squared Laplacian on the sphere: a slot seen from few sides keeps its mean colour and stays smooth elsewhere)
//   opacity   sum_v m_v max(o_v, 0) / sum_v m_v,  m_v = w_v / o_v, what the view would show of it at opacity one. A view where the decoder
//             switches the slot off (o_v <= 0) counts as zero, with the m of its anchor's other slots.
//   scale     exp of the weighted mean of the logarithm;  rotation: eigenvector of the largest eigenvalue of sum_v w_v q q^T (sign-free).
//
// Cost: one forward, backward and (anchors / block) decodes a view, and 190 doubles a slot of one block. Memory: 8 bytes for each slot and
// view that contribute, plus block_anchors * K * 1.6 kB.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/math/spherical_harmonics.hpp"
#include "compmark/math/symmetric.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/pipeline.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"

namespace compmark::inline v0 {

struct ShFitSettings {
  int degree = 3;
  double ridge = 1e-4;            ///< weight of the smoothness term
  double min_opacity = 0.005;     ///< slots whose averaged opacity is below are dropped
  double min_contribution = 0.05; ///< and those whose contribution, summed over all views, is below this many pixels
  std::size_t appearance_view = 0;   ///< row of the appearance table, if the recipe has one
  std::size_t block_anchors = 1024;  ///< anchors fitted at a time
};

struct ShFitReport {
  std::size_t slots = 0;     ///< anchors * K
  std::size_t kept = 0;
  std::size_t faint = 0;     ///< dropped by min_opacity
  std::size_t unseen = 0;    ///< dropped by min_contribution
  double color_rms = 0;      ///< contribution-weighted root mean square of the colour residual, all channels
};

namespace detail {

/// Sums over views of one slot. 10 + 9 + 136 + 48 doubles.
struct SlotSums {
  double weight = 0;          // sum w
  double reach = 0;           // sum m
  double reach_opacity = 0;   // sum m max(o, 0)
  double color_energy = 0;    // sum w |c - 1/2|^2
  std::array<double, 3> log_scale{};
  std::array<double, 10> quaternion{};
  std::array<double, 136> normal{};  // packed lower triangle of sum w Y Y^T
  std::array<double, 48> right{};    // [16, 3] sum w Y (c - 1/2)
};

/// What one view shows of each slot: ascending slots and their contributions.
struct ViewContributions {
  std::vector<std::uint32_t> visible;  // anchor rows
  std::vector<std::pair<std::uint32_t, float>> slots;
};

/// Fits one slot's colour; coefficient i of channel c goes to coefficients[3 i + c]. Returns the weighted squared residual.
[[nodiscard]] inline double fit_color(SlotSums& sums, const ShFitSettings& settings, std::array<double, 48>& coefficients) {
  const std::size_t n = sh_count(settings.degree);
  const double unit = sums.weight * sh_constant * sh_constant;  // the diagonal of sum w Y Y^T for directions all over the sphere
  std::array<double, 136> lower{};
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) lower[packed_index(i, j)] = sums.normal[packed_index(i, j)];
    const double laplacian = sh_band(i) * (sh_band(i) + 1);
    lower[packed_index(i, i)] += unit * (settings.ridge * laplacian * laplacian + 1e-9);
    for (std::size_t c = 0; c < 3; ++c) coefficients[3 * i + c] = sums.right[3 * i + c];
  }
  if (!solve_positive(lower, n, std::span<double>(coefficients).first(3 * n), 3)) {
    coefficients = {};
    for (std::size_t c = 0; c < 3; ++c) coefficients[c] = sums.right[c] / (sums.weight * sh_constant * sh_constant);
  }
  // |r|^2 = energy - 2 f.b + f^T A f, clamped: it is a difference of large numbers when the fit is good
  double residual = sums.color_energy;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      double product = 0;
      for (std::size_t j = 0; j < n; ++j) {
        product += sums.normal[i >= j ? packed_index(i, j) : packed_index(j, i)] * coefficients[3 * j + c];
      }
      residual += coefficients[3 * i + c] * (product - 2 * sums.right[3 * i + c]);
    }
  }
  return std::max(residual, 0.0);
}

/// Contributions of every slot in one view: forward, then backward of sum(image).
template <Recipe R, Executor E>
[[nodiscard]] ViewContributions view_contributions(const Pipeline<R>& pipeline, const Model<R>& model, const Camera<double>& camera,
                                                   std::size_t appearance_view, typename Pipeline<R>::Context& context, E& executor) {
  using T = typename R::Scalar;
  pipeline.forward(model, camera, appearance_view, context, executor);
  context.d_image_storage.resize(context.image.size(), T(1));
  context.d_gaussians.resize(context.gaussians.size());
  context.d_gaussians.set_zero();
  const ImageView<const T> ones{context.d_image_storage.data(), 3, camera.height, camera.width};
  pipeline.rasterizer(model.render)
      .backward(std::as_const(context.gaussians).columns(), camera.template cast<T>(), pipeline.background(model.render), ones,
                context.d_gaussians.columns(), context.raster, executor);
  ViewContributions view;
  view.visible.assign(context.visible.begin(), context.visible.end());
  const std::span<const std::uint32_t> slot = pipeline.decoder().statistics(context.decoder).gaussian_slot;
  const GaussianColumns<const T> gradient = std::as_const(context.d_gaussians).columns();
  for (std::size_t p = 0; p < gradient.count; ++p) {
    const float weight = static_cast<float>(gradient.color[0][p]);  // all three channels have the same
    if (weight > 1e-4f) view.slots.emplace_back(slot[p], weight);
  }
  std::sort(view.slots.begin(), view.slots.end());
  return view;
}

}  // namespace detail

/// Fits explicit Gaussians to what the model shows from `cameras` (the training cameras; at their own size, or smaller for speed).
template <Recipe R, Executor E>
[[nodiscard]] SplatTable fit_splats(const Model<R>& model, std::span<const Camera<double>> cameras, const ShFitSettings& settings,
                                    ShFitReport& report, E& executor) {
  using T = typename R::Scalar;
  const Pipeline<R> pipeline;
  typename Pipeline<R>::Context context;
  std::vector<detail::ViewContributions> views;
  for (const Camera<double>& camera : cameras) {
    views.push_back(detail::view_contributions(pipeline, model, camera, settings.appearance_view, context, executor));
  }

  const AnchorColumns<const T> anchors = model.columns();
  const std::size_t rows = anchors.rows(), per_anchor = static_cast<std::size_t>(R::AnchorModel::shape.offsets);
  const std::size_t coefficients = sh_count(settings.degree);
  report = {};
  report.slots = rows * per_anchor;
  SplatTable table;
  table.degree = settings.degree;
  table.sh.resize(3 * coefficients);
  std::vector<detail::SlotSums> sums;
  std::vector<float> weights;
  std::vector<std::int64_t> gaussian_of;
  typename R::GaussianDecoder::Context decoder_context;
  GaussianBatch<T> batch;
  double residual_sum = 0, weight_sum = 0;
  for (std::size_t begin = 0; begin < rows; begin += settings.block_anchors) {
    const std::size_t end = std::min(rows, begin + settings.block_anchors);
    const std::size_t first_slot = begin * per_anchor, slots = (end - begin) * per_anchor;
    sums.assign(slots, {});
    for (std::size_t v = 0; v < views.size(); ++v) {
      const detail::ViewContributions& view = views[v];
      const auto low = std::lower_bound(view.visible.begin(), view.visible.end(), begin);
      const auto high = std::lower_bound(low, view.visible.end(), end);
      const auto from = std::lower_bound(view.slots.begin(), view.slots.end(), std::pair{static_cast<std::uint32_t>(first_slot), 0.0f});
      if (low == high || from == view.slots.end() || from->first >= first_slot + slots) continue;
      weights.assign(slots, 0.0f);
      for (auto entry = from; entry != view.slots.end() && entry->first < first_slot + slots; ++entry) {
        weights[entry->first - first_slot] = entry->second;
      }
      const std::span<const std::uint32_t> visible = std::span(view.visible).subspan(
          static_cast<std::size_t>(low - view.visible.begin()), static_cast<std::size_t>(high - low));
      pipeline.decoder().forward(anchors, visible, cameras[v].center_world, settings.appearance_view, model.arena, model.decoder, batch,
                                 decoder_context, executor);
      const std::span<const std::uint32_t> slot = pipeline.decoder().statistics(decoder_context).gaussian_slot;
      gaussian_of.assign(slots, -1);
      for (std::size_t p = 0; p < batch.size(); ++p) gaussian_of[slot[p] - first_slot] = static_cast<std::int64_t>(p);
      const GaussianColumns<const T> g = std::as_const(batch).columns();
      const std::array<double, 3>& center = cameras[v].center_world;

      executor.for_chunks(visible.size(), 16, [&](std::size_t chunk_begin, std::size_t chunk_end, std::size_t) {
        for (std::size_t a = chunk_begin; a < chunk_end; ++a) {
          const std::size_t first = (visible[a] - begin) * per_anchor;
          double reach_sum = 0, reach_count = 0;
          for (std::size_t s = first; s < first + per_anchor; ++s) {
            if (weights[s] == 0.0f || gaussian_of[s] < 0) continue;
            const std::size_t p = static_cast<std::size_t>(gaussian_of[s]);
            const double w = static_cast<double>(weights[s]), opacity = static_cast<double>(g.opacity[p]);
            detail::SlotSums& sum = sums[s];
            const double reach = w / std::max(opacity, 1e-3);
            reach_sum += reach;
            reach_count += 1;
            sum.weight += w;
            sum.reach += reach;
            sum.reach_opacity += reach * opacity;
            std::array<double, 3> direction{}, color{};
            double length = 0;
            for (std::size_t axis = 0; axis < 3; ++axis) {
              direction[axis] = static_cast<double>(g.mean[axis][p]) - center[axis];
              length += direction[axis] * direction[axis];
              color[axis] = static_cast<double>(g.color[axis][p]) - 0.5;
              sum.color_energy += w * color[axis] * color[axis];
              sum.log_scale[axis] += w * std::log(std::max(static_cast<double>(g.scale[axis][p]), 1e-20));
            }
            length = std::sqrt(std::max(length, 1e-30));
            for (double& component : direction) component /= length;
            for (std::size_t i = 0; i < 4; ++i) {
              for (std::size_t j = 0; j <= i; ++j) {
                sum.quaternion[packed_index(i, j)] += w * static_cast<double>(g.rotation[i][p]) * static_cast<double>(g.rotation[j][p]);
              }
            }
            const std::array<double, 16> basis = sh_basis(direction);
            for (std::size_t i = 0; i < coefficients; ++i) {
              const double wy = w * basis[i];
              for (std::size_t j = 0; j <= i; ++j) sum.normal[packed_index(i, j)] += wy * basis[j];
              for (std::size_t c = 0; c < 3; ++c) sum.right[3 * i + c] += wy * color[c];
            }
          }
          if (reach_count == 0) continue;
          for (std::size_t s = first; s < first + per_anchor; ++s) {
            if (gaussian_of[s] < 0) sums[s].reach += reach_sum / reach_count;  // switched off here: opacity zero
          }
        }
      });
    }

    for (std::size_t s = 0; s < slots; ++s) {
      detail::SlotSums& sum = sums[s];
      if (!(sum.weight > settings.min_contribution)) {
        ++report.unseen;
        continue;
      }
      const double opacity = std::clamp(sum.reach_opacity / sum.reach, 1e-6, 1 - 1e-6);
      if (opacity < settings.min_opacity) {
        ++report.faint;
        continue;
      }
      std::array<double, 48> color{};
      residual_sum += detail::fit_color(sum, settings, color);
      weight_sum += sum.weight;
      const std::array<double, 4> rotation = largest_eigenvector<4>(sum.quaternion);
      const std::size_t anchor = begin + s / per_anchor, k = s % per_anchor;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double mean = static_cast<double>(anchors.position(anchor, axis)) +
                            static_cast<double>(anchors.offset(anchor, 3 * k + axis)) * std::exp(static_cast<double>(anchors.scaling(anchor, axis)));
        table.mean[axis].push_back(static_cast<float>(mean));
        table.log_scale[axis].push_back(static_cast<float>(sum.log_scale[axis] / sum.weight));
        for (std::size_t i = 0; i < coefficients; ++i) table.color(axis, i).push_back(static_cast<float>(color[3 * i + axis]));
      }
      for (std::size_t i = 0; i < 4; ++i) table.rotation[i].push_back(static_cast<float>(rotation[i]));
      table.opacity.push_back(static_cast<float>(std::log(opacity / (1 - opacity))));
      ++table.count;
    }
  }
  report.kept = table.count;
  report.color_rms = weight_sum > 0 ? std::sqrt(residual_sum / (3 * weight_sum)) : 0;
  return table;
}

}  // namespace compmark::inline v0
