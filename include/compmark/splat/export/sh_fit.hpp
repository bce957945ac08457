// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One explicit Gaussian for every Gaussian slot (anchor, k) of a model, valid from all cameras: colour as spherical
// harmonics fitted to the decoder's colours for many cameras, opacity, scale and rotation averaged. The mean of a slot
// does not depend on the view, so it is exact.
//
// Weights. A Gaussian counts in a view by its contribution there, w = sum over pixels of (alpha * transmittance):
// occluded views, in which the networks were never trained, do not count. That sum is the gradient of the image's sum
// by the Gaussian's colour, so one backward pass of the rasterizer with an image gradient of one gives it for all.
//   colour    min_f  sum_v w_v |1/2 + sum_i f_i Y_i(d_v) - c_v|^2 + ridge W / (4 pi) sum_i (l_i (l_i + 1))^2 |f_i|^2,
//             W = sum_v w_v
//             (the ridge is the squared Laplacian on the sphere: a slot seen from few sides keeps its mean colour and
//               stays smooth elsewhere)
//   opacity   sum_v m_v max(o_v, 0) / sum_v m_v,  m_v = w_v / o_v, the contribution to the view at opacity one. A view
//             where the decoder switches the slot off (o_v <= 0) counts as zero, with the m of its anchor's other
//               slots.
//   scale     exp of the weighted mean of the logarithm
//   rotation  eigenvector of the largest eigenvalue of sum_v w_v q q^T (sign-free)
//
// Cost: one forward, backward and (anchors / block) decodes a view, and 190 doubles a slot of one block. Memory: 8
// bytes for each slot and view that contribute, plus block_anchors * K * 1.6 kB.
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
#include "compmark/core/result.hpp"
#include "compmark/math/spherical_harmonics.hpp"
#include "compmark/math/symmetric.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"
#include "compmark/splat/effect/concept.hpp"
#include "compmark/splat/export/contributions.hpp"
#include "compmark/splat/training/model.hpp"

namespace compmark {

struct ShFitSettings {
  int degree = 3;
  double ridge = 1e-3;             ///< weight of the smoothness term
  double min_opacity = 0.005;      ///< slots whose averaged opacity is below are dropped
  double min_contribution = 0.05;  ///< and those whose contribution, summed over all views, is below this many pixels
  std::size_t appearance_view = unseen_view;  ///< whose appearance and exposure, if the recipe has them
  std::size_t block_anchors = 1024;           ///< anchors fitted at a time
};

struct ShFitReport {
  std::size_t slots = 0;  ///< anchors * K
  std::size_t kept = 0;
  std::size_t faint = 0;   ///< dropped by min_opacity
  std::size_t unseen = 0;  ///< dropped by min_contribution
  double color_rms = 0;    ///< contribution-weighted root mean square of the colour residual, all channels
};

namespace detail {

/// Sums over views of one slot. 10 + 9 + 136 + 48 doubles.
struct SlotSums {
  double weight = 0;         // sum w
  double reach = 0;          // sum m
  double reach_opacity = 0;  // sum m max(o, 0)
  double color_energy = 0;   // sum w |c - 1/2|^2
  std::array<double, 3> log_scale{};
  std::array<double, 10> quaternion{};
  std::array<double, 136> normal{};  // packed lower triangle of sum w Y Y^T
  std::array<double, 48> right{};    // [16, 3] sum w Y (c - 1/2)
};

/// Fits one slot's colour; coefficient i of channel c goes to coefficients[3 i + c]. Returns the weighted squared
/// residual.
[[nodiscard]] inline double fit_color(const SlotSums& sums, const ShFitSettings& settings,
                                      std::array<double, 48>& coefficients) {
  const std::size_t n = sh_count(settings.degree);
  const double unit =
      sums.weight * sh_constant * sh_constant;  // the diagonal of sum w Y Y^T for directions all over the sphere
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

/// Adds one view's values of a block of anchors to the sums of its slots. Buffers are kept between calls.
template <Recipe R>
class SlotAccumulator {
 public:
  using T = typename R::Scalar;
  SlotAccumulator(const Model<R>& model, const ShFitSettings& settings) : model_(model), settings_(settings) {}

  /// Starts the block of anchors [begin, end).
  void start(std::size_t begin, std::size_t end) {
    begin_ = begin;
    end_ = end;
    sums_.assign((end - begin) * per_anchor, {});
  }
  template <Executor E>
  void add(const ViewContributions& view, const std::array<double, 3>& center, E& executor) {
    const std::size_t first_slot = begin_ * per_anchor, slots = sums_.size();
    const auto low = std::lower_bound(view.visible.begin(), view.visible.end(), begin_);
    const auto high = std::lower_bound(low, view.visible.end(), end_);
    if (low == high) return;
    weights_.assign(slots, 0.0f);
    for (auto entry = std::lower_bound(view.slots.begin(), view.slots.end(),
                                       std::pair{static_cast<std::uint32_t>(first_slot), 0.0f});
         entry != view.slots.end() && entry->first < first_slot + slots; ++entry) {
      weights_[entry->first - first_slot] = entry->second;
    }
    const std::span<const std::uint32_t> visible =
        std::span(view.visible)
            .subspan(static_cast<std::size_t>(low - view.visible.begin()), static_cast<std::size_t>(high - low));
    decoder_.forward(model_.columns(), visible, center, settings_.appearance_view, model_.arena, model_.decoder, batch_,
                     context_, executor);
    const std::span<const std::uint32_t> slot = decoder_.statistics(context_).gaussian_slot;
    gaussian_of_.assign(slots, -1);
    for (std::size_t p = 0; p < batch_.size(); ++p) gaussian_of_[slot[p] - first_slot] = static_cast<std::int64_t>(p);
    executor.for_chunks(visible.size(), 16, [&](std::size_t chunk_begin, std::size_t chunk_end, std::size_t) {
      for (std::size_t a = chunk_begin; a < chunk_end; ++a) add_anchor((visible[a] - begin_) * per_anchor, center);
    });
  }
  [[nodiscard]] std::span<SlotSums> sums() { return sums_; }

  static constexpr std::size_t per_anchor = static_cast<std::size_t>(R::AnchorModel::shape.offsets);

 private:
  void add_anchor(std::size_t first, const std::array<double, 3>& center) {
    const GaussianColumns<const T> g = std::as_const(batch_).columns();
    double reach_sum = 0, reach_count = 0;
    for (std::size_t s = first; s < first + per_anchor; ++s) {
      if (weights_[s] == 0.0f || gaussian_of_[s] < 0) continue;
      const double reach = add_gaussian(sums_[s], static_cast<double>(weights_[s]), g,
                                        static_cast<std::size_t>(gaussian_of_[s]), center);
      reach_sum += reach;
      reach_count += 1;
    }
    if (reach_count == 0) return;
    for (std::size_t s = first; s < first + per_anchor; ++s) {
      if (gaussian_of_[s] < 0) sums_[s].reach += reach_sum / reach_count;  // switched off here: opacity zero
    }
  }
  double add_gaussian(SlotSums& sum, double w, const GaussianColumns<const T>& g, std::size_t p,
                      const std::array<double, 3>& center) const {
    const double opacity = static_cast<double>(g.opacity[p]), reach = w / std::max(opacity, 1e-3);
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
        sum.quaternion[packed_index(i, j)] +=
            w * static_cast<double>(g.rotation[i][p]) * static_cast<double>(g.rotation[j][p]);
      }
    }
    const std::array<double, 16> basis = sh_basis(direction);
    for (std::size_t i = 0; i < sh_count(settings_.degree); ++i) {
      const double wy = w * basis[i];
      for (std::size_t j = 0; j <= i; ++j) sum.normal[packed_index(i, j)] += wy * basis[j];
      for (std::size_t c = 0; c < 3; ++c) sum.right[3 * i + c] += wy * color[c];
    }
    return reach;
  }

  const Model<R>& model_;
  const ShFitSettings& settings_;
  std::size_t begin_ = 0, end_ = 0;
  std::vector<SlotSums> sums_;
  std::vector<float> weights_;
  std::vector<std::int64_t> gaussian_of_;
  [[no_unique_address]] typename R::GaussianDecoder decoder_;
  typename R::GaussianDecoder::Context context_;
  GaussianBatch<T> batch_;
};

}  // namespace detail

/// Fits explicit Gaussians to renders of the model from `cameras` (the training cameras; at their own size, or smaller
/// for speed). An Error where a view shows more than the rasterizer has memory for (RasterReport::error).
template <Recipe R, Executor E>
[[nodiscard]] Result<SplatTable> fit_splats(const Model<R>& model, std::span<const Camera<double>> cameras,
                                            const ShFitSettings& settings, ShFitReport& report, E& executor) {
  std::vector<ViewContributions> views;
  {
    ContributionMeter<R> meter;
    for (const Camera<double>& camera : cameras) {
      Result<ViewContributions> view = meter.measure(model, camera, settings.appearance_view, executor);
      if (!view) return view.error();
      views.push_back(std::move(*view));
    }
  }
  const AnchorColumns<const typename R::Scalar> anchors = model.columns();
  const std::size_t per_anchor = detail::SlotAccumulator<R>::per_anchor, coefficients = sh_count(settings.degree);
  report = {};
  report.slots = anchors.rows() * per_anchor;
  SplatTable table;
  table.resize(0, settings.degree);
  detail::SlotAccumulator<R> accumulator(model, settings);
  double residual_sum = 0, weight_sum = 0;
  for (std::size_t begin = 0; begin < anchors.rows(); begin += settings.block_anchors) {
    accumulator.start(begin, std::min(anchors.rows(), begin + settings.block_anchors));
    for (std::size_t v = 0; v < views.size(); ++v) accumulator.add(views[v], cameras[v].center_world, executor);
    for (std::size_t s = 0; s < accumulator.sums().size(); ++s) {
      const detail::SlotSums& sum = accumulator.sums()[s];
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
                            static_cast<double>(anchors.offset(anchor, 3 * k + axis)) *
                                std::exp(static_cast<double>(anchors.scaling(anchor, axis)));
        table.mean[axis].push_back(static_cast<float>(mean));
        table.log_scale[axis].push_back(static_cast<float>(sum.log_scale[axis] / sum.weight));
        for (std::size_t i = 0; i < coefficients; ++i)
          table.color(axis, i).push_back(static_cast<float>(color[3 * i + axis]));
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

}  // namespace compmark
