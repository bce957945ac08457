// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder that reads local contrast, or colour, modulo a lattice: with u_i and the gates w_i of lattice_positions.hpp,
//   p_k = sum_i w_i cos 2 pi (phase_k + frequency_k . u_i) / (sum_i w_i + floor N),     logits = head p + bias  (- host(p)).
// Each wave is dither modulation (Chen and Wornell, IEEE Trans. Information Theory 47, 2001) of one direction of contrast; the mean over
// positions is what a crop, a rotation or a shift leaves in place, and contrast of logarithms does not see a change of brightness. A wave is
// short against the contrast of photographs, whose own phases are therefore nearly uniform and hide the message little. The averaged responses
// of convolutions lack that, which is why this decoder reads more at 38 dB, for 0.1 % of their cost (docs/decoder_training.md).
// Cost: (3 octaves + 22) features operations a position, a position for every stride^2 pixels; the gradient twice that.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/mark/host_prediction.hpp"
#include "compmark/mark/lattice_kernel.hpp"
#include "compmark/mark/lattice_positions.hpp"

namespace compmark::inline v0 {

/// All that trains; row-major. Frequencies and phases are in turns.
template <class T>
struct LatticeWeights {
  std::vector<T> frequency;  ///< [features, dimensions]
  std::vector<T> phase;      ///< [features]
  std::vector<T> head;       ///< [bits, features]
  std::vector<T> bias;       ///< [bits]
  HostPrediction<T> host;    ///< of a decoder for one scene; does not train

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
    std::vector<T> pooled, d_pooled, slope;  ///< p, dL/dp, dL/dsum
    Buffer<T> partial;                       ///< of every chunk of positions
    T gate_sum = T(0);
    typename HostPrediction<T>::Context host;
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
            weights_.host.direction.size() == weights_.host.coordinates() * weights_.phase.size() &&
            weights_.host.coefficient.size() == weights_.host.centres() * weights_.bias.size(),
        "LatticeDecoder: weights");
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
    if (!weights_.host.empty()) weights_.host.subtract(context.pooled, logits, context.host);
  }

  /// The features p alone, in context.pooled; backward() is not to follow.
  template <Executor E>
  void pool(ImageView<const T> image, Context& context, E& executor) const {
    COMPMARK_ASSERT(image.channels == 3 && std::min(image.height, image.width) >= minimum_size(),
                    "LatticeDecoder: an RGB image of at least minimum_size()");
    LatticePositions<T>& at = context.positions;
    at.read(image, settings_, executor);
    const std::size_t features = static_cast<std::size_t>(settings_.features);
    const std::size_t chunks = chunk_count(at.stride, grain);
    context.partial.resize(chunks * features);
    const detail::LatticeWaves<T> waves = waves_of(context);
    executor.for_chunks(at.stride, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      waves.sum(begin, end, context.partial.data() + begin / grain * features);
    });
    context.gate_sum = static_cast<T>(settings_.floor) * static_cast<T>(at.count);
    for (std::size_t i = 0; i < at.count; ++i) context.gate_sum += at.gate[i];
    context.pooled.assign(features, T(0));
    for (std::size_t c = 0; c < chunks; ++c) {
      for (std::size_t k = 0; k < features; ++k) context.pooled[k] += context.partial[c * features + k];
    }
    for (T& p : context.pooled) p /= context.gate_sum;
  }

  /// Adds to d_image.
  template <Executor E>
  void backward(std::span<const T> d_logits, ImageView<T> d_image, Context& context, E& executor) const {
    pooled_gradient(d_logits, context);
    T mean_slope(0);  // of the quotient: the gates are in its denominator too
    for (std::size_t k = 0; k < context.pooled.size(); ++k) mean_slope += context.d_pooled[k] * context.pooled[k];
    context.slope.resize(context.pooled.size());
    for (std::size_t k = 0; k < context.slope.size(); ++k) context.slope[k] = context.d_pooled[k] / context.gate_sum;
    const T offset = mean_slope / context.gate_sum;
    LatticePositions<T>& at = context.positions;
    at.d_u.resize(settings_.dimensions() * at.stride);
    at.d_gate.resize(at.stride);
    const detail::LatticeWaves<T> waves = waves_of(context);
    executor.for_chunks(at.stride, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      waves.input_gradient(begin, end, context.slope.data(), at.d_u.data(), at.d_gate.data());
    });
    for (std::size_t i = 0; i < at.count; ++i) at.d_gate[i] -= offset;
    at.scatter(d_image, settings_, executor);
  }

  /// Adds dL/dweights to `gradient`, after the forward of the same context.
  template <Executor E>
  void add_weight_gradient(std::span<const T> d_logits, LatticeWeights<T>& gradient, Context& context,
                           E& executor) const {
    pooled_gradient(d_logits, context);
    const std::size_t features = context.pooled.size(), dimensions = settings_.dimensions();
    for (std::size_t b = 0; b < d_logits.size(); ++b) {
      gradient.bias[b] += d_logits[b];
      for (std::size_t k = 0; k < features; ++k) gradient.head[b * features + k] += d_logits[b] * context.pooled[k];
    }
    const LatticePositions<T>& at = context.positions;
    const std::size_t chunks = chunk_count(at.stride, grain), block = features * (1 + dimensions);
    context.partial.resize(chunks * block);
    std::fill_n(context.partial.data(), chunks * block, T(0));
    const detail::LatticeWaves<T> waves = waves_of(context);
    executor.for_chunks(at.stride, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      T* const sums = context.partial.data() + begin / grain * block;
      waves.weight_sums(begin, end, sums, sums + features);
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

  static constexpr std::size_t grain = 512;  ///< positions: 27 octave planes of them fit the first cache

 private:
  [[nodiscard]] detail::LatticeWaves<T> waves_of(const Context& context) const {
    const LatticePositions<T>& at = context.positions;
    return {weights_.frequency.data(), weights_.phase.data(),  at.u.data(), at.gate.data(),
            weights_.phase.size(),     settings_.dimensions(), at.stride};
  }

  void pooled_gradient(std::span<const T> d_logits, Context& context) const {
    const std::size_t features = context.pooled.size();
    context.d_pooled.assign(features, T(0));
    for (std::size_t b = 0; b < d_logits.size(); ++b) {
      for (std::size_t k = 0; k < features; ++k) context.d_pooled[k] += weights_.head[b * features + k] * d_logits[b];
    }
    if (!weights_.host.empty()) weights_.host.backward(d_logits, context.d_pooled, context.host);
  }

  Settings settings_;
  LatticeWeights<T> weights_;
};

}  // namespace compmark::inline v0
