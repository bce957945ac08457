// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ReferenceDecoder: MlpDecoder's interface and order of Gaussians in plain loops over one anchor at a time, for any
// scalar, on one thread whatever the executor. It is written from the formulas (docs/spec/method.md, 1.3, 1.5, 1.6) and
// shares no kernel with the fast one, optional inputs included; tests hold the two against each other and both against
// central differences. Kept for ever. Cost: about 30 times that of MlpDecoder in float on one core. Longer than 300
// lines: forward and backward pass are meant to be read in one place.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/decoder_parameters.hpp"

namespace compmark {

namespace detail {

/// Linear -> ReLU -> Linear of one input, remembering what backward needs.
template <class T>
struct ReferenceHead {
  std::vector<T> input, hidden, output;

  void forward(const HeadViews<const T>& head) {
    hidden.assign(head.weight1.rows, T(0));
    output.assign(head.weight2.rows, T(0));
    for (std::size_t h = 0; h < hidden.size(); ++h) {
      T sum = head.bias1(0, h);
      for (std::size_t i = 0; i < input.size(); ++i) sum += head.weight1(h, i) * input[i];
      hidden[h] = sum < T(0) ? T(0) : sum;
    }
    for (std::size_t o = 0; o < output.size(); ++o) {
      output[o] = head.bias2(0, o);
      for (std::size_t h = 0; h < hidden.size(); ++h) output[o] += head.weight2(o, h) * hidden[h];
    }
  }
  /// Adds the gradients of the network; returns that of the input.
  [[nodiscard]] std::vector<T> backward(const HeadViews<const T>& head, const std::vector<T>& d_output,
                                        const HeadViews<T>& d_head) const {
    std::vector<T> d_input(input.size(), T(0));
    for (std::size_t o = 0; o < output.size(); ++o) {
      d_head.bias2(0, o) += d_output[o];
      for (std::size_t h = 0; h < hidden.size(); ++h) d_head.weight2(o, h) += d_output[o] * hidden[h];
    }
    for (std::size_t h = 0; h < hidden.size(); ++h) {
      if (!(hidden[h] > T(0))) continue;
      T d_hidden = 0;
      for (std::size_t o = 0; o < output.size(); ++o) d_hidden += d_output[o] * head.weight2(o, h);
      d_head.bias1(0, h) += d_hidden;
      for (std::size_t i = 0; i < input.size(); ++i) {
        d_head.weight1(h, i) += d_hidden * input[i];
        d_input[i] += d_hidden * head.weight1(h, i);
      }
    }
    return d_input;
  }
};

}  // namespace detail

template <class T, DecoderShape decoder_shape = DecoderShape{}>
class ReferenceDecoder {
 public:
  using Scalar = T;
  static constexpr DecoderShape shape = decoder_shape;
  using Handles = DecoderHandles<shape>;

  struct Settings {
    double min_distance = 1e-12;  ///< as in MlpDecoder
  };

  /// Everything of one visible anchor.
  struct Anchor {
    detail::ReferenceHead<T> opacity, covariance, color, bank;
    std::array<T, 3> direction{}, scale{}, base{};
    T distance = 0;
    std::array<T, 3> weight{};  // of the feature bank
    bool finite = true;
  };
  struct Gaussian {
    std::size_t anchor = 0;  // index into the visible list
    std::size_t k = 0;
  };
  struct Context {
    std::span<const std::uint32_t> visible;
    std::vector<Anchor> anchors;
    std::vector<Gaussian> gaussians;
    std::vector<T> opacity_sum;
    std::vector<std::uint32_t> slot;
    std::size_t non_finite_anchors = 0;
  };

  ReferenceDecoder() = default;
  explicit ReferenceDecoder(const Settings& settings) : settings_(settings) {}

  static Handles add_parameters(ParameterArena<T>& arena, std::size_t train_views) {
    return add_decoder_blocks<shape>(arena, train_views);
  }
  static void initialise(ParameterArena<T>& arena, const Handles& handles, std::uint64_t seed) {
    initialise_decoder<shape>(arena, handles, seed);
  }

  template <Executor E>
  std::size_t forward(const AnchorColumns<const T>& table, std::span<const std::uint32_t> visible,
                      const std::array<double, 3>& camera_center, std::size_t view_index,
                      const ParameterArena<T>& arena, const Handles& handles, GaussianBatch<T>& out, Context& context,
                      E& /*executor*/) const {
    const auto params = decoder_values<shape>(arena, handles);
    context.visible = visible;
    context.anchors.assign(visible.size(), Anchor{});
    context.gaussians.clear();
    context.opacity_sum.assign(visible.size(), T(0));
    context.slot.clear();
    context.non_finite_anchors = 0;
    for (std::size_t n = 0; n < visible.size(); ++n) {
      decode(table, visible[n], camera_center, view_index, params, context.anchors[n]);
      if (!context.anchors[n].finite) ++context.non_finite_anchors;
      for (std::size_t k = 0; k < offsets; ++k) {
        if (exists(context.anchors[n], k)) context.opacity_sum[n] += std::tanh(context.anchors[n].opacity.output[k]);
      }
    }
    for (std::size_t block = 0; block < visible.size(); block += 16) {
      for (std::size_t k = 0; k < offsets; ++k) {
        for (std::size_t n = block; n < std::min(block + 16, visible.size()); ++n) {
          if (!exists(context.anchors[n], k)) continue;
          context.gaussians.push_back({n, k});
          context.slot.push_back(visible[n] * static_cast<std::uint32_t>(offsets) + static_cast<std::uint32_t>(k));
        }
      }
    }
    out.resize(context.gaussians.size());
    const GaussianColumns<T> columns = out.columns();
    for (std::size_t row = 0; row < context.gaussians.size(); ++row) {
      const auto [n, k] = context.gaussians[row];
      const Anchor& anchor = context.anchors[n];
      const Quaternion rotation = quaternion(anchor, k);
      columns.opacity[row] = std::tanh(anchor.opacity.output[k]);
      for (std::size_t i = 0; i < 3; ++i) {
        columns.mean[i][row] = table.position(visible[n], i) + table.offset(visible[n], 3 * k + i) * anchor.scale[i];
        columns.scale[i][row] = anchor.base[i] * logistic(anchor.covariance.output[7 * k + i]);
        columns.color[i][row] = logistic(anchor.color.output[3 * k + i]);
      }
      for (std::size_t i = 0; i < 4; ++i) columns.rotation[i][row] = rotation.unit[i];
    }
    return context.gaussians.size();
  }

  template <Executor E>
  void backward(const AnchorColumns<const T>& table, std::span<const std::uint32_t> visible,
                const std::array<double, 3>& /*camera_center*/, [[maybe_unused]] std::size_t view_index,
                ParameterArena<T>& arena, const Handles& handles, const GaussianColumns<const T>& d_gaussians,
                const AnchorColumns<T>& d_table, Context& context, E& /*executor*/) const {
    const auto params = decoder_values<shape>(static_cast<const ParameterArena<T>&>(arena), handles);
    const DecoderParams<T, shape> d_params = decoder_gradients<shape>(arena, handles);
    std::vector<Outputs> d_outputs(visible.size());
    for (std::size_t row = 0; row < context.gaussians.size(); ++row) {
      const auto [n, k] = context.gaussians[row];
      const Anchor& anchor = context.anchors[n];
      Outputs& d = d_outputs[n];
      if (d.opacity.empty()) d = {std::vector<T>(offsets), std::vector<T>(7 * offsets), std::vector<T>(3 * offsets)};
      const T opacity = std::tanh(anchor.opacity.output[k]);
      d.opacity[k] = d_gaussians.opacity[row] * (1 - opacity * opacity);
      T radial = 0;
      const Quaternion rotation = quaternion(anchor, k);
      for (std::size_t i = 0; i < 4; ++i) radial += rotation.unit[i] * d_gaussians.rotation[i][row];
      for (std::size_t i = 0; i < 4; ++i) {
        d.covariance[7 * k + 3 + i] =
            (d_gaussians.rotation[i][row] - rotation.unit[i] * radial) * rotation.inverse_norm;
      }
      for (std::size_t i = 0; i < 3; ++i) {
        const T color = logistic(anchor.color.output[3 * k + i]);
        d.color[3 * k + i] = d_gaussians.color[i][row] * color * (1 - color);
        const T fraction = logistic(anchor.covariance.output[7 * k + i]);
        d.covariance[7 * k + i] = d_gaussians.scale[i][row] * anchor.base[i] * fraction * (1 - fraction);
        d_table.scaling(visible[n], 3 + i) += d_gaussians.scale[i][row] * anchor.base[i] * fraction;
        const T d_mean = d_gaussians.mean[i][row];
        d_table.position(visible[n], i) += d_mean;
        d_table.offset(visible[n], 3 * k + i) += d_mean * anchor.scale[i];
        d_table.scaling(visible[n], i) += d_mean * table.offset(visible[n], 3 * k + i) * anchor.scale[i];
      }
    }
    for (std::size_t n = 0; n < visible.size(); ++n) {
      if (d_outputs[n].opacity.empty()) continue;
      const Anchor& anchor = context.anchors[n];
      std::vector<T> d_input = anchor.opacity.backward(params.opacity, d_outputs[n].opacity, d_params.opacity);
      const std::vector<T> d_covariance =
          anchor.covariance.backward(params.covariance, d_outputs[n].covariance, d_params.covariance);
      const std::vector<T> d_color = anchor.color.backward(params.color, d_outputs[n].color, d_params.color);
      for (std::size_t i = 0; i < d_input.size(); ++i) d_input[i] += d_covariance[i] + d_color[i];
      if constexpr (shape.appearance_dim != 0) {
        const std::size_t view = std::min(view_index, params.appearance.rows - 1);
        for (std::size_t i = 0; i < params.appearance.columns; ++i)
          d_params.appearance(view, i) += d_color[d_input.size() + i];
      }
      std::array<T, 4> d_view{};
      for (std::size_t i = 0; i < static_cast<std::size_t>(shape.head_inputs()) - width; ++i)
        d_view[i] = d_input[width + i];
      T* const d_feature = d_table.feature.row(visible[n]);
      if constexpr (shape.feature_bank) {
        const T* const feature = table.feature.row(visible[n]);
        std::array<T, 3> d_weight{};
        for (std::size_t c = 0; c < width; ++c) {
          for (std::size_t level = 0; level < 3; ++level) {
            const std::size_t source = bank_source(c, level);
            d_feature[source] += anchor.weight[level] * d_input[c];
            d_weight[level] += feature[source] * d_input[c];
          }
        }
        std::vector<T> d_logit(3);
        for (std::size_t i = 0; i < 3; ++i) {
          for (std::size_t j = 0; j < 3; ++j) {
            d_logit[i] += d_weight[j] * anchor.weight[j] * ((i == j ? T(1) : T(0)) - anchor.weight[i]);
          }
        }
        const std::vector<T> d_bank = anchor.bank.backward(params.feature_bank, d_logit, d_params.feature_bank);
        for (std::size_t i = 0; i < 4; ++i) d_view[i] += d_bank[i];
      } else {
        for (std::size_t c = 0; c < width; ++c) d_feature[c] += d_input[c];
      }
      if (!(anchor.distance > T(0))) continue;
      T radial = 0;
      for (std::size_t i = 0; i < 3; ++i) radial += anchor.direction[i] * d_view[i];
      for (std::size_t i = 0; i < 3; ++i) {
        d_table.position(visible[n], i) +=
            (d_view[i] - anchor.direction[i] * radial) / anchor.distance + d_view[3] * anchor.direction[i];
      }
    }
  }

  [[nodiscard]] DecodedStatistics<T> statistics(const Context& context) const {
    return {context.visible, context.opacity_sum, context.slot};
  }

 private:
  static constexpr auto width = static_cast<std::size_t>(shape.feature_dim);
  static constexpr auto offsets = static_cast<std::size_t>(shape.offsets);

  struct Outputs {
    std::vector<T> opacity, covariance, color;
  };
  struct Quaternion {
    std::array<T, 4> unit{1, 0, 0, 0};
    T inverse_norm = 0;
  };

  static T logistic(T x) { return x < T(0) ? std::exp(x) / (1 + std::exp(x)) : 1 / (1 + std::exp(-x)); }
  static bool exists(const Anchor& anchor, std::size_t k) {
    return anchor.finite && std::tanh(anchor.opacity.output[k]) > T(0);
  }
  static std::size_t bank_source(std::size_t c, std::size_t level) {
    return level == 0 ? 4 * (c % (width / 4)) : (level == 1 ? 2 * (c % (width / 2)) : c);
  }
  static Quaternion quaternion(const Anchor& anchor, std::size_t k) {
    const T* const q = anchor.covariance.output.data() + 7 * k + 3;
    const T largest = std::max({std::abs(q[0]), std::abs(q[1]), std::abs(q[2]), std::abs(q[3])});
    Quaternion result;
    if (largest < 2 * std::numeric_limits<T>::min()) return result;
    T squares = 0;
    for (std::size_t i = 0; i < 4; ++i) squares += (q[i] / largest) * (q[i] / largest);
    const T norm = std::sqrt(squares);
    for (std::size_t i = 0; i < 4; ++i) result.unit[i] = q[i] / largest / norm;
    result.inverse_norm = 1 / norm / largest;
    return result;
  }

  void decode(const AnchorColumns<const T>& table, std::size_t row, const std::array<double, 3>& center,
              [[maybe_unused]] std::size_t view_index, const DecoderParams<const T, shape>& params,
              Anchor& anchor) const {
    // In the wider of T and double, so that the subtraction keeps its digits far from the origin
    // (docs/spec/numerics.md, PR7).
    using Wide = decltype(T{} + double{});
    std::array<Wide, 3> v{};
    for (std::size_t i = 0; i < 3; ++i) v[i] = static_cast<Wide>(table.position(row, i)) - static_cast<Wide>(center[i]);
    const Wide distance = std::hypot(v[0], v[1], v[2]);
    if (distance > static_cast<Wide>(settings_.min_distance)) {
      anchor.distance = static_cast<T>(distance);
      for (std::size_t i = 0; i < 3; ++i) anchor.direction[i] = static_cast<T>(v[i] / distance);
    } else {
      anchor.direction = {0, 0, 1};
    }
    for (std::size_t i = 0; i < 3; ++i) {
      anchor.scale[i] = std::exp(table.scaling(row, i));
      anchor.base[i] = std::exp(table.scaling(row, 3 + i));
    }
    const T* const feature = table.feature.row(row);
    std::vector<T> input(feature, feature + width);
    if constexpr (shape.feature_bank) {
      anchor.bank.input = {anchor.direction[0], anchor.direction[1], anchor.direction[2], anchor.distance};
      anchor.bank.forward(params.feature_bank);
      const auto& logit = anchor.bank.output;
      const T largest = std::max({logit[0], logit[1], logit[2]});
      T total = 0;
      for (const T x : logit) total += std::exp(x - largest);
      for (std::size_t i = 0; i < 3; ++i) anchor.weight[i] = std::exp(logit[i] - largest) / total;
      for (std::size_t c = 0; c < width; ++c) {
        input[c] = 0;
        for (std::size_t level = 0; level < 3; ++level)
          input[c] += anchor.weight[level] * feature[bank_source(c, level)];
      }
    }
    input.insert(input.end(), anchor.direction.begin(), anchor.direction.end());
    if constexpr (shape.distance) input.push_back(anchor.distance);
    for (const T x : input) anchor.finite = anchor.finite && std::isfinite(x);
    anchor.opacity.input = input;
    anchor.covariance.input = input;
    if constexpr (shape.appearance_dim != 0) {
      const T* const embedding = params.appearance.row(std::min(view_index, params.appearance.rows - 1));
      input.insert(input.end(), embedding, embedding + shape.appearance_dim);
    }
    anchor.color.input = input;
    anchor.opacity.forward(params.opacity);
    anchor.covariance.forward(params.covariance);
    anchor.color.forward(params.color);
  }

  Settings settings_{};
};

}  // namespace compmark
