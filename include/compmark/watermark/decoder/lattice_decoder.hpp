// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The lattice decoder: Fourier features of local contrast or of colour, averaged over the image, and a linear head.
// With u_i and the gates w_i of lattice_positions.hpp,
//   p_k = sum_i w_i cos 2 pi (phase_k + frequency_k . u_i) / (sum_i w_i + floor N),
//   logits = head p + bias  (- cover(p)).
// Each Fourier feature is dither modulation (quantization index modulation; Chen and Wornell, IEEE Trans. Information
// Theory 47, 2001) of one direction of contrast. A crop, a rotation or a shift leaves the mean over positions in place,
// and contrast of logarithms does not change with brightness. The period of a feature is short against the contrast of
// photographs: their own phases are nearly uniform and interfere little with the message. Averaged responses of
// convolutions lack that, and the lattice decoder reads more at 38 dB, for 0.1 % of their cost
// (docs/decoder_training.md).
// With a limit, a region R of the image whose logits exceed it counts less: its sums over the features, s_R, and its
// gates, g_R, are weighted by
//   c_R = min(1, limit / |t_R|),   t_R = (head s_R + bias g_R) / (sum_i w_i + floor N),
//   p = sum_R c_R s_R / (sum_R c_R g_R + floor N),
// Huber's weight of an M-estimator of the mean (Annals of Mathematical Statistics 35, 1964), one step from all weights
// 1. A glare in a corner that no fitted view had gives large logits in one place, while the message gives small ones
// everywhere (docs/notebook/watermark_experiments.md). It is a weighted mean: where the logits of all regions are
// large, none loses weight against the others. The prediction of the cover interference is no part of t.
// Cost: (3 octaves + 22) features operations a position, a position for every stride^2 pixels; the gradient twice that.
// A limit: regions x bits x features more, an image.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/decoder/cover_prediction.hpp"
#include "compmark/watermark/decoder/lattice_kernel.hpp"
#include "compmark/watermark/decoder/lattice_positions.hpp"

namespace compmark {

/// All that trains; row-major. Frequencies and phases are in turns.
template <class T>
struct LatticeWeights {
  std::vector<T> frequency;  ///< [features, dimensions]
  std::vector<T> phase;      ///< [features]
  std::vector<T> head;       ///< [bits, features]
  std::vector<T> bias;       ///< [bits]
  CoverPrediction<T> cover;  ///< of a decoder for one scene; does not train

  LatticeWeights() = default;
  explicit LatticeWeights(const LatticeSettings& s)
      : frequency(static_cast<std::size_t>(s.features) * s.dimensions()),
        phase(static_cast<std::size_t>(s.features)),
        head(static_cast<std::size_t>(s.bits) * static_cast<std::size_t>(s.features)),
        bias(static_cast<std::size_t>(s.bits)) {}
};

template <class T>
class LatticeDecoder {
 public:
  using Scalar = T;
  using Settings = LatticeSettings;

  struct Context {
    LatticePositions<T> positions;
    std::vector<T> pooled, d_pooled;  ///< p, dL/dp
    std::vector<T> slope, offset;     ///< [regions, features] dL/dsum, [regions] -dL/dgate
    Buffer<T> partial;                ///< of every chunk of positions
    T gate_sum = T(0);                ///< the denominator of p
    T all_gates = T(0);               ///< that of t, with a limit
    /// With a limit: [regions, features] s, [regions] g, [regions, bits] t, [regions] |t|, [regions] c.
    std::vector<T> region_sum, region_gate, region_says, region_norm, region_share;
    typename CoverPrediction<T>::Context cover;
  };

  LatticeDecoder() = default;
  LatticeDecoder(Settings settings, LatticeWeights<T> weights)
      : settings_(std::move(settings)),
        weights_(std::move(weights)) {
    COMPMARK_ASSERT(settings_.dimensions() >= 3 && settings_.dimensions() <= 24,
                    "LatticeDecoder: 2 to 9 blurs for contrast, 1 to 8 for colour");
    COMPMARK_ASSERT(
        weights_.frequency.size() == static_cast<std::size_t>(settings_.features) * settings_.dimensions() &&
            weights_.head.size() == weights_.bias.size() * weights_.phase.size() &&
            weights_.cover.direction.size() == weights_.cover.coordinates() * weights_.phase.size() &&
            weights_.cover.coefficient.size() == weights_.cover.centres() * weights_.bias.size(),
        "LatticeDecoder: weights");
    COMPMARK_ASSERT(settings_.regions >= 1 && settings_.region_limit >= 0, "LatticeDecoder: regions and their limit");
  }

  [[nodiscard]] int bits() const { return settings_.bits; }
  [[nodiscard]] int minimum_size() const { return 2 * settings_.stride; }
  [[nodiscard]] double logit_scale() const { return settings_.logit_scale; }
  [[nodiscard]] const Settings& settings() const { return settings_; }
  [[nodiscard]] const LatticeWeights<T>& weights() const { return weights_; }
  [[nodiscard]] LatticeWeights<T>& weights() { return weights_; }

  template <Executor E>
  void forward(ImageView<const T> image, std::span<T> logits, Context& context, E& executor) const {
    pool(image, context, executor);
    const std::size_t features = context.pooled.size();
    for (std::size_t b = 0; b < logits.size(); ++b) {
      T sum = weights_.bias[b];
      for (std::size_t k = 0; k < features; ++k) sum += weights_.head[b * features + k] * context.pooled[k];
      logits[b] = sum;
    }
    if (!weights_.cover.empty()) weights_.cover.subtract(context.pooled, logits, context.cover);
  }

  /// The features p alone, in context.pooled; backward() is not to follow.
  template <Executor E>
  void pool(ImageView<const T> image, Context& context, E& executor) const {
    COMPMARK_ASSERT(image.channels == 3 && std::min(image.height, image.width) >= minimum_size(),
                    "LatticeDecoder: an RGB image of at least minimum_size()");
    LatticePositions<T>& at = context.positions;
    at.read(image, settings_, executor);
    const std::size_t features = static_cast<std::size_t>(settings_.features);
    context.partial.resize(at.chunks.size() * features);
    const detail::FourierFeatures<T> fourier = fourier_of(context);
    executor.for_chunks(at.chunks.size(), 1, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t c = begin; c < end; ++c)
        fourier.sum(at.chunks[c].begin, at.chunks[c].end, context.partial.data() + c * features);
    });
    context.gate_sum = static_cast<T>(settings_.floor) * static_cast<T>(at.count);
    if (settings_.limited()) return pool_limited(context, executor);
    for (std::size_t i = 0; i < at.stride; ++i) context.gate_sum += at.gate[i];
    context.pooled.assign(features, T(0));
    for (std::size_t c = 0; c < at.chunks.size(); ++c) {
      for (std::size_t k = 0; k < features; ++k) context.pooled[k] += context.partial[c * features + k];
    }
    for (T& p : context.pooled) p /= context.gate_sum;
  }

  /// Adds to d_image.
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& context, E& executor) const {
    pooled_gradient(d_logits, context);
    const std::size_t features = context.pooled.size();
    T mean_slope(0);  // of the quotient: the gates are in its denominator too
    for (std::size_t k = 0; k < features; ++k) mean_slope += context.d_pooled[k] * context.pooled[k];
    LatticePositions<T>& at = context.positions;
    context.slope.resize(at.regions * features);
    context.offset.assign(at.regions, mean_slope / context.gate_sum);
    for (std::size_t r = 0; r < at.regions; ++r) {
      for (std::size_t k = 0; k < features; ++k)
        context.slope[r * features + k] = context.d_pooled[k] / context.gate_sum;
    }
    if (settings_.limited()) limit_gradient(context);
    at.d_u.resize(settings_.dimensions() * at.stride);
    at.d_gate.resize(at.stride);
    const detail::FourierFeatures<T> fourier = fourier_of(context);
    executor.for_chunks(at.chunks.size(), 1, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t c = begin; c < end; ++c) {
        const auto& [first, last, region] = at.chunks[c];
        fourier.input_gradient(first, last, context.slope.data() + region * features, at.d_u.data(), at.d_gate.data());
        for (std::size_t i = first; i < last; ++i) at.d_gate[i] -= context.offset[region];
      }
    });
    at.scatter(d_image, settings_, executor);
  }

  /// Adds dL/dweights to `gradient`, without a limit, after the forward of the same context.
  template <Executor E>
  void add_weight_gradient(std::span<const T> d_logits, LatticeWeights<T>& gradient, Context& context,
                           E& executor) const {
    COMPMARK_ASSERT(!settings_.limited(), "LatticeDecoder: weights train without a limit");
    pooled_gradient(d_logits, context);
    const std::size_t features = context.pooled.size(), dimensions = settings_.dimensions();
    for (std::size_t b = 0; b < d_logits.size(); ++b) {
      gradient.bias[b] += d_logits[b];
      for (std::size_t k = 0; k < features; ++k) gradient.head[b * features + k] += d_logits[b] * context.pooled[k];
    }
    const LatticePositions<T>& at = context.positions;
    const std::size_t chunks = at.chunks.size(), block = features * (1 + dimensions);
    context.partial.resize(chunks * block);
    std::fill_n(context.partial.data(), chunks * block, T(0));
    const detail::FourierFeatures<T> fourier = fourier_of(context);
    executor.for_chunks(chunks, 1, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t c = begin; c < end; ++c) {
        T* const sums = context.partial.data() + c * block;
        fourier.weight_sums(at.chunks[c].begin, at.chunks[c].end, sums, sums + features);
      }
    });
    for (std::size_t c = 0; c < chunks; ++c) {
      const T* const sums = context.partial.data() + c * block;
      for (std::size_t k = 0; k < features; ++k) {
        const T scale = -2 * std::numbers::pi_v<T> * context.d_pooled[k] / context.gate_sum;
        gradient.phase[k] += scale * sums[k];
        for (std::size_t j = 0; j < dimensions; ++j)
          gradient.frequency[k * dimensions + j] += scale * sums[features + k * dimensions + j];
      }
    }
  }

 private:
  [[nodiscard]] detail::FourierFeatures<T> fourier_of(const Context& context) const {
    const LatticePositions<T>& at = context.positions;
    return {weights_.frequency.data(), weights_.phase.data(),  at.u.data(), at.gate.data(),
            weights_.phase.size(),     settings_.dimensions(), at.stride};
  }

  /// Logits of the regions, their weights, and the weighted features p. On entry gate_sum is the floor alone.
  template <Executor E>
  void pool_limited(Context& context, E& executor) const {
    const LatticePositions<T>& at = context.positions;
    const std::size_t features = static_cast<std::size_t>(settings_.features), bits = weights_.bias.size();
    context.region_sum.assign(at.regions * features, T(0));
    context.region_gate.assign(at.regions, T(0));
    context.region_says.resize(at.regions * bits);
    context.region_norm.resize(at.regions);
    context.region_share.resize(at.regions);
    context.all_gates = context.gate_sum;
    for (std::size_t c = 0; c < at.chunks.size(); ++c) {
      const auto& [begin, end, r] = at.chunks[c];
      for (std::size_t k = 0; k < features; ++k)
        context.region_sum[r * features + k] += context.partial[c * features + k];
      for (std::size_t i = begin; i < end; ++i) context.region_gate[r] += at.gate[i];
    }
    for (const T gate : context.region_gate) context.all_gates += gate;
    const T limit = static_cast<T>(settings_.region_limit);
    executor.for_chunks(at.regions, 1, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t r = first; r < last; ++r) {
        const T* const sum = context.region_sum.data() + r * features;
        T square(0);
        for (std::size_t b = 0; b < bits; ++b) {
          T says = weights_.bias[b] * context.region_gate[r];
          for (std::size_t k = 0; k < features; ++k) says += weights_.head[b * features + k] * sum[k];
          says /= context.all_gates;
          context.region_says[r * bits + b] = says;
          square += says * says;
        }
        context.region_norm[r] = std::sqrt(square);
        context.region_share[r] = context.region_norm[r] > limit ? limit / context.region_norm[r] : T(1);
      }
    });
    context.pooled.assign(features, T(0));
    for (std::size_t r = 0; r < at.regions; ++r) {
      const T share = context.region_share[r];
      context.gate_sum += share * context.region_gate[r];
      for (std::size_t k = 0; k < features; ++k) context.pooled[k] += share * context.region_sum[r * features + k];
    }
    for (T& p : context.pooled) p /= context.gate_sum;
  }

  /// From gradients of the weighted sums (slope, offset) to those of the regions' sums, through the weights c too.
  void limit_gradient(Context& context) const {
    const std::size_t features = context.pooled.size(), bits = weights_.bias.size();
    T d_all_gates(0);
    for (std::size_t r = 0; r < context.region_share.size(); ++r) {
      const T share = context.region_share[r];
      if (!(share < T(1))) continue;
      T* const slope = context.slope.data() + r * features;
      T d_share = -context.offset[r] * context.region_gate[r];
      for (std::size_t k = 0; k < features; ++k) d_share += slope[k] * context.region_sum[r * features + k];
      for (std::size_t k = 0; k < features; ++k) slope[k] *= share;
      context.offset[r] *= share;
      // c = limit / |t|: dc = -c t . dt / |t|^2, and t is a quotient by all gates.
      const T norm = context.region_norm[r], scale = -d_share * share / (norm * norm * context.all_gates);
      for (std::size_t b = 0; b < bits; ++b) {
        const T d_says = scale * context.region_says[r * bits + b];
        for (std::size_t k = 0; k < features; ++k) slope[k] += d_says * weights_.head[b * features + k];
        context.offset[r] -= d_says * weights_.bias[b];
      }
      d_all_gates += d_share * share / context.all_gates;
    }
    for (T& offset : context.offset) offset -= d_all_gates;
  }

  void pooled_gradient(std::span<const T> d_logits, Context& context) const {
    const std::size_t features = context.pooled.size();
    context.d_pooled.assign(features, T(0));
    for (std::size_t b = 0; b < d_logits.size(); ++b) {
      for (std::size_t k = 0; k < features; ++k) context.d_pooled[k] += weights_.head[b * features + k] * d_logits[b];
    }
    if (!weights_.cover.empty()) weights_.cover.backward(d_logits, context.d_pooled, context.cover);
  }

  Settings settings_;
  LatticeWeights<T> weights_;
};

}  // namespace compmark
