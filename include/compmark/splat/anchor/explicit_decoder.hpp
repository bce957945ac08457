// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ExplicitDecoder, the GaussianDecoder of models without networks: an anchor is one Gaussian, and its feature holds the
// numbers that a 3DGS file stores (docs/spec/formats.md, 1; Kerbl et al., SIGGRAPH 2023).
//   mean = x + o exp(S[0:3]),  scale = exp(S[3:6]),  opacity = sigmoid(l),  rotation = q / |q|,
//   color = max(0, 1/2 + sum_i f_i Y_i(d)),  d = (mean - camera centre) normalised
//   feature = [opacity, rotation w x y z, red's, green's, blue's coefficients], each in a unit of its own:
//     l = 5 v - ln 9,  q = (1, 0, 0, 0) + 2/15 v,  f_0 = v / 3,  f_i = v / 60 else
// The units give each number the published learning rate at the one rate of the feature (Adam moves v by the rate), and
// zeros mean what 3DGS begins with: opacity 0.1, no rotation, grey. So growing, marking, coding and attacking, which
// know anchors and features, work as they do for Scaffold-GS. A colour held at zero passes no gradient, as published.
// The mean's path through the view direction is there (docs/spec/numerics.md, SH1). S[0:3] is the unit of the moves o
// and is not trained. Cost: one pass over the features of the visible anchors, no products of matrices.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/spherical_harmonics.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/decoder_shape.hpp"

namespace compmark {

/// Where the numbers of a Gaussian are in its feature, and their units.
template <int sh_degree>
struct ExplicitLayout {
  static_assert(sh_degree >= 0 && sh_degree <= max_sh_degree, "ExplicitLayout: spherical harmonics of degree 0 to 3");
  static constexpr std::size_t coefficients = sh_count(sh_degree);
  static constexpr std::size_t opacity = 0, rotation = 1, color = 5;
  static constexpr std::size_t width = color + 3 * coefficients;
  static constexpr double opacity_unit = 5, opacity_zero = -2.1972245773362196;  // ln(0.1 / 0.9)
  static constexpr double rotation_unit = 2.0 / 15;
  [[nodiscard]] static constexpr double color_unit(std::size_t i) { return i == 0 ? 1.0 / 3 : 1.0 / 60; }

  /// Zeroes the coefficients above `degree` in every row of [N, width].
  template <class T>
  static void clear_harmonics_above(int degree, MatrixView<T> rows) {
    const std::size_t kept = sh_count(degree);
    if (kept >= coefficients) return;
    for (std::size_t row = 0; row < rows.rows; ++row) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        T* const of_channel = rows.row(row) + color + channel * coefficients;
        std::fill(of_channel + kept, of_channel + coefficients, T(0));
      }
    }
  }
};

template <class T, int sh_degree = 3>
class ExplicitDecoder {
 public:
  using Scalar = T;
  using Layout = ExplicitLayout<sh_degree>;
  static constexpr DecoderShape shape{.feature_dim = static_cast<int>(Layout::width), .offsets = 1};
  /// No networks.
  struct Handles {};
  struct Settings {
    double min_distance = 1e-12;  ///< world units; nearer to the camera a Gaussian has no direction: (0, 0, 1) (PR9)
  };
  /// What forward leaves for backward and statistics. `visible` and `decoded` are views of the caller's list and batch.
  struct Context {
    std::span<const std::uint32_t> visible;
    GaussianColumns<const T> decoded;
    std::size_t gaussians = 0;
    std::size_t non_finite_anchors = 0;  ///< visible anchors with a NaN or infinity: they gave no Gaussian
    Buffer<T> opacity_sum;               ///< [visible]
    Buffer<std::uint32_t> slot;          ///< [Gaussians] anchor row
    Buffer<std::uint32_t> chunk_first;
    [[nodiscard]] std::size_t memory_bytes() const {
      return opacity_sum.capacity_bytes() + slot.capacity_bytes() + chunk_first.capacity_bytes();
    }
  };

  ExplicitDecoder() = default;
  explicit ExplicitDecoder(const Settings& settings) : settings_(settings) {}

  static Handles add_parameters(ParameterArena<T>& /*arena*/, std::size_t /*train_views*/) { return {}; }
  static void initialise(ParameterArena<T>& /*arena*/, const Handles& /*handles*/, std::uint64_t /*seed*/) {}

  /// Fills `out` (resized) with a Gaussian for each finite row of `visible`, in their order; returns their number.
  template <Executor E>
  std::size_t forward(const AnchorColumns<const T>& anchors, std::span<const std::uint32_t> visible,
                      const std::array<double, 3>& camera_center, std::size_t /*view_index*/,
                      const ParameterArena<T>& /*arena*/, const Handles& /*handles*/, GaussianBatch<T>& out,
                      Context& context, E& executor) const {
    check(anchors);
    context.visible = visible;
    context.opacity_sum.resize(visible.size());
    const std::size_t chunks = chunk_count(visible.size(), grain);
    context.chunk_first.resize(chunks + 1);
    executor.for_chunks(visible.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::uint32_t count = 0;
      for (std::size_t i = begin; i < end; ++i) count += is_finite(anchors, visible[i]) ? 1 : 0;
      context.chunk_first[begin / grain + 1] = count;
    });
    context.chunk_first[0] = 0;
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) context.chunk_first[chunk + 1] += context.chunk_first[chunk];
    context.gaussians = context.chunk_first[chunks];
    context.non_finite_anchors = visible.size() - context.gaussians;
    out.resize(context.gaussians);
    context.slot.resize(context.gaussians);
    const GaussianColumns<T> columns = out.columns();
    executor.for_chunks(visible.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::size_t at = context.chunk_first[begin / grain];
      for (std::size_t i = begin; i < end; ++i) {
        context.opacity_sum[i] = T(0);
        if (!is_finite(anchors, visible[i])) continue;
        write(anchors, visible[i], camera_center, columns, at);
        context.opacity_sum[i] = columns.opacity[at];
        context.slot[at++] = visible[i];
      }
    });
    context.decoded = std::as_const(out).columns();
    return context.gaussians;
  }

  /// ADDS the gradients into the rows of d_anchors that the last forward read; there are no networks.
  template <Executor E>
  void backward(const AnchorColumns<const T>& anchors, [[maybe_unused]] std::span<const std::uint32_t> visible,
                const std::array<double, 3>& camera_center, std::size_t /*view_index*/, ParameterArena<T>& /*arena*/,
                const Handles& /*handles*/, const GaussianColumns<const T>& d_gaussians,
                const AnchorColumns<T>& d_anchors, Context& context, E& executor) const {
    check(anchors);
    COMPMARK_ASSERT(visible.size() == context.visible.size(),
                    "ExplicitDecoder::backward: not the anchors of the last forward");
    executor.for_chunks(context.gaussians, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i)
        add_gradients(anchors, context.slot[i], camera_center, context.decoded, d_gaussians, d_anchors, i);
    });
  }

  /// What growing reads; valid until the next forward and as long as the list of visible anchors.
  [[nodiscard]] DecodedStatistics<T> statistics(const Context& context) const {
    return {context.visible,
            {context.opacity_sum.data(), context.visible.size()},
            {context.slot.data(), context.gaussians}};
  }

 private:
  static constexpr std::size_t grain = 512;  // anchors
  static constexpr std::size_t coefficients = Layout::coefficients;

  static void check([[maybe_unused]] const AnchorColumns<const T>& anchors) {
    COMPMARK_ASSERT(anchors.feature.columns == Layout::width && anchors.offset.columns == 3,
                    "ExplicitDecoder: the table has another width");
  }
  [[nodiscard]] static bool is_finite(const AnchorColumns<const T>& anchors, std::size_t row) {
    T zeros = T(0);  // x - x is NaN where x is not finite
    const auto look = [&zeros](const T* values, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) zeros += values[i] - values[i];
    };
    look(anchors.position.row(row), 3);
    look(anchors.offset.row(row), 3);
    look(anchors.scaling.row(row), 6);
    look(anchors.feature.row(row), Layout::width);
    return zeros == T(0);
  }

  struct Seen {
    std::array<T, 3> direction;
    T distance;  ///< from the camera; 0: no direction
  };
  [[nodiscard]] Seen seen(const std::array<T, 3>& mean, const std::array<double, 3>& center) const {
    std::array<double, 3> v{};
    for (std::size_t axis = 0; axis < 3; ++axis) v[axis] = static_cast<double>(mean[axis]) - center[axis];
    const double length = std::hypot(v[0], v[1], v[2]);
    if (!(length > settings_.min_distance)) return {{T(0), T(0), T(1)}, T(0)};
    return {{static_cast<T>(v[0] / length), static_cast<T>(v[1] / length), static_cast<T>(v[2] / length)},
            static_cast<T>(length)};
  }
  /// The quaternion before it is normalised, and its norm.
  [[nodiscard]] static std::pair<std::array<T, 4>, T> quaternion(const T* feature) {
    std::array<T, 4> q{};
    T square = T(0);
    for (std::size_t k = 0; k < 4; ++k) {
      q[k] = static_cast<T>(Layout::rotation_unit) * feature[Layout::rotation + k] + T(k == 0 ? 1 : 0);
      square += q[k] * q[k];
    }
    return {q, std::sqrt(square)};
  }

  void write(const AnchorColumns<const T>& anchors, std::size_t row, const std::array<double, 3>& center,
             const GaussianColumns<T>& out, std::size_t at) const {
    const T *const x = anchors.position.row(row), *const o = anchors.offset.row(row),
                   *const s = anchors.scaling.row(row), *const f = anchors.feature.row(row);
    std::array<T, 3> mean{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      mean[axis] = x[axis] + o[axis] * std::exp(s[axis]);
      out.mean[axis][at] = mean[axis];
      out.scale[axis][at] = std::exp(s[3 + axis]);
    }
    const T logit = static_cast<T>(Layout::opacity_unit) * f[Layout::opacity] + static_cast<T>(Layout::opacity_zero);
    out.opacity[at] = T(1) / (T(1) + std::exp(-logit));
    const auto [q, norm] = quaternion(f);
    for (std::size_t k = 0; k < 4; ++k) out.rotation[k][at] = norm > T(0) ? q[k] / norm : T(k == 0 ? 1 : 0);
    std::array<T, 16> basis = sh_basis(seen(mean, center).direction);
    for (std::size_t i = 0; i < coefficients; ++i) basis[i] *= static_cast<T>(Layout::color_unit(i));
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const T* const of_channel = f + Layout::color + channel * coefficients;
      T value = T(0.5);
      for (std::size_t i = 0; i < coefficients; ++i) value += basis[i] * of_channel[i];
      out.color[channel][at] = value > T(0) ? value : T(0);
    }
  }

  void add_gradients(const AnchorColumns<const T>& anchors, std::size_t row, const std::array<double, 3>& center,
                     const GaussianColumns<const T>& g, const GaussianColumns<const T>& d, const AnchorColumns<T>& to,
                     std::size_t at) const {
    const T *const s = anchors.scaling.row(row), *const f = anchors.feature.row(row);
    T* const d_feature = to.feature.row(row);
    const T opacity = g.opacity[at];
    d_feature[Layout::opacity] += static_cast<T>(Layout::opacity_unit) * d.opacity[at] * opacity * (T(1) - opacity);
    const auto [q, norm] = quaternion(f);
    T along = T(0);
    for (std::size_t k = 0; k < 4; ++k) along += g.rotation[k][at] * d.rotation[k][at];
    for (std::size_t k = 0; k < 4 && norm > T(0); ++k) {
      d_feature[Layout::rotation + k] +=
          static_cast<T>(Layout::rotation_unit) * (d.rotation[k][at] - g.rotation[k][at] * along) / norm;
    }
    const Seen from = seen({g.mean[0][at], g.mean[1][at], g.mean[2][at]}, center);
    const std::array<T, 16> basis = sh_basis(from.direction);
    std::array<T, 16> pulled{};  // sum over channels of d color * f_i
    for (std::size_t channel = 0; channel < 3; ++channel) {
      if (!(g.color[channel][at] > T(0))) continue;
      const T d_color = d.color[channel][at];
      const std::size_t first = Layout::color + channel * coefficients;
      for (std::size_t i = 0; i < coefficients; ++i) {
        const T unit = static_cast<T>(Layout::color_unit(i));
        d_feature[first + i] += unit * basis[i] * d_color;
        pulled[i] += unit * f[first + i] * d_color;
      }
    }
    std::array<T, 3> d_mean{d.mean[0][at], d.mean[1][at], d.mean[2][at]};
    if (coefficients > 1 && from.distance > T(0)) {
      const std::array<T, 3> v = sh_gradient(from.direction, pulled.data(), coefficients);
      const T radial = v[0] * from.direction[0] + v[1] * from.direction[1] + v[2] * from.direction[2];
      for (std::size_t axis = 0; axis < 3; ++axis)
        d_mean[axis] += (v[axis] - radial * from.direction[axis]) / from.distance;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      to.position.row(row)[axis] += d_mean[axis];
      to.offset.row(row)[axis] += d_mean[axis] * std::exp(s[axis]);
      to.scaling.row(row)[3 + axis] += d.scale[axis][at] * g.scale[axis][at];
    }
  }

  Settings settings_{};
};

}  // namespace compmark
