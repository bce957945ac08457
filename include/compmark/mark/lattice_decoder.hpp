// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message decoder that reads local contrast modulo a lattice. With a_0 ... a_n the image blurred at growing sigmas and thinned out,
//   u = (log(a_0 + e) - log(a_1 + e), ..., log(a_(n-1) + e) - log(a_n + e))      per position: octaves x 3 colours
//   p_k = sum_i w_i cos 2 pi (phase_k + frequency_k . u_i) / (sum_i w_i + floor N),     logits = head p + bias.
// Each wave is dither modulation (Chen and Wornell, IEEE Trans. Information Theory 47, 2001) of one direction of contrast, and the mean over
// positions is what a crop, a rotation or a shift leaves in place; contrast of logarithms does not see a change of brightness. The gate w
// fades out black and white, where noise is clipped to one side and a background would speak for most positions. A wave is short against the
// contrast of photographs, so that their own contrast hides the message no more than a uniform phase does: that is what the averaged
// responses of convolutions lack, and why an embedding of 38 dB moves every logit by several standard deviations.
// Cost: (3 octaves + 22) features operations a position, a position for every stride^2 pixels; the gradient twice that.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/mark/lattice_kernel.hpp"
#include "compmark/math/separable_map.hpp"

namespace compmark::inline v0 {

struct LatticeSettings {
  int bits = 48;
  int features = 192;
  std::vector<double> sigma{3, 6, 12};  ///< of the blurs, in pixels, growing
  int stride = 4;                       ///< pixels between positions
  double epsilon = 0.1;                 ///< added before the logarithm
  double gate = 0.12;                   ///< distance from black and white at which a position counts
  double floor = 0.02;                  ///< share of the positions that are added to the sum of gates

  [[nodiscard]] std::size_t dimensions() const { return 3 * (sigma.size() - 1); }
  bool operator==(const LatticeSettings&) const = default;
};

/// All that trains; row-major. Frequencies and phases are in turns.
template <class T>
struct LatticeWeights {
  std::vector<T> frequency;  ///< [features, dimensions]
  std::vector<T> phase;      ///< [features]
  std::vector<T> head;       ///< [bits, features]
  std::vector<T> bias;       ///< [bits]

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
    int height = 0, width = 0;  ///< of the image the maps are for
    std::vector<SeparableMap<T>> maps;
    std::vector<Buffer<T>> levels;  ///< a_b, then log(a_b + epsilon) in place; the last one's linear values apart
    Buffer<T> coarse, u, gate, d_u, d_gate, d_level, d_finer, row;
    Buffer<T> partial;      ///< [chunk, features]
    std::vector<T> pooled;  ///< p
    std::vector<T> d_pooled, slope;
    T gate_sum = T(0);
    int rows = 0, columns = 0;
    std::size_t positions = 0, stride = 0;
  };

  LatticeDecoder() = default;
  LatticeDecoder(Settings settings, LatticeWeights<T> weights)
      : settings_(std::move(settings)),
        weights_(std::move(weights)) {
    COMPMARK_ASSERT(settings_.sigma.size() >= 2 && settings_.dimensions() <= 24, "LatticeDecoder: 2 to 9 blurs");
    COMPMARK_ASSERT(
        weights_.frequency.size() == static_cast<std::size_t>(settings_.features) * settings_.dimensions() &&
            weights_.head.size() == weights_.bias.size() * weights_.phase.size(),
        "LatticeDecoder: weights");
  }

  [[nodiscard]] int bits() const { return settings_.bits; }
  [[nodiscard]] int minimum_size() const { return 2 * settings_.stride; }
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
  }

  /// The features p alone, in context.pooled.
  template <Executor E>
  void pool(ImageView<const T> image, Context& context, E& executor) const {
    COMPMARK_ASSERT(image.channels == 3 && std::min(image.height, image.width) >= minimum_size(),
                    "LatticeDecoder: an RGB image of at least minimum_size()");
    prepare(image, context);
    read_levels(image, context, executor);
    fill_positions(context, executor);
    const std::size_t features = static_cast<std::size_t>(settings_.features);
    const std::size_t chunks = chunk_count(context.stride, grain);
    context.partial.resize(chunks * features);
    const detail::LatticeWaves<T> waves = waves_of(context);
    executor.for_chunks(context.stride, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      waves.sum(begin, end, context.partial.data() + begin / grain * features);
    });
    context.gate_sum = static_cast<T>(settings_.floor) * static_cast<T>(context.positions);
    for (std::size_t i = 0; i < context.positions; ++i) context.gate_sum += context.gate[i];
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
    context.d_u.resize(settings_.dimensions() * context.stride);
    context.d_gate.resize(context.stride);
    const detail::LatticeWaves<T> waves = waves_of(context);
    executor.for_chunks(context.stride, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      waves.input_gradient(begin, end, context.slope.data(), context.d_u.data(), context.d_gate.data());
    });
    for (std::size_t i = 0; i < context.positions; ++i) context.d_gate[i] -= offset;
    scatter(d_image, context, executor);
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
    const std::size_t chunks = chunk_count(context.stride, grain), block = features * (1 + dimensions);
    context.partial.resize(chunks * block);
    std::fill_n(context.partial.data(), chunks * block, T(0));
    const detail::LatticeWaves<T> waves = waves_of(context);
    executor.for_chunks(context.stride, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
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
    return {weights_.frequency.data(), weights_.phase.data(),  context.u.data(), context.gate.data(),
            weights_.phase.size(),     settings_.dimensions(), context.stride};
  }

  /// The first blur thins out, the others work on its grid: sigmas add in squares.
  void prepare(ImageView<const T> image, Context& context) const {
    if (context.height == image.height && context.width == image.width) return;
    context.height = image.height;
    context.width = image.width;
    context.maps.clear();
    const double stride = settings_.stride;
    context.maps.push_back({RunTable<T>::gaussian(image.height, settings_.sigma[0], settings_.stride),
                            RunTable<T>::gaussian(image.width, settings_.sigma[0], settings_.stride)});
    context.rows = context.maps[0].height();
    context.columns = context.maps[0].width();
    for (std::size_t b = 1; b < settings_.sigma.size(); ++b) {
      const double more =
          std::sqrt(settings_.sigma[b] * settings_.sigma[b] - settings_.sigma[b - 1] * settings_.sigma[b - 1]) / stride;
      context.maps.push_back({RunTable<T>::gaussian(context.rows, more), RunTable<T>::gaussian(context.columns, more)});
    }
    context.positions = static_cast<std::size_t>(context.rows) * static_cast<std::size_t>(context.columns);
    constexpr std::size_t lanes = native_width<T>;
    context.stride = (context.positions + lanes - 1) / lanes * lanes;
  }

  [[nodiscard]] static ImageView<T> grid(Buffer<T>& buffer, const Context& context) {
    return {buffer.data(), 3, context.rows, context.columns};
  }

  template <class E>
  void read_levels(ImageView<const T> image, Context& context, E& executor) const {
    const std::size_t count = 3 * context.positions, levels = context.maps.size();
    context.levels.resize(levels);
    ImageView<const T> at = image;
    for (std::size_t b = 0; b < levels; ++b) {
      context.levels[b].resize(count);
      context.maps[b].apply(at, grid(context.levels[b], context), context.row, executor);
      at = grid(context.levels[b], context);
    }
    context.coarse = context.levels.back();
    const T epsilon = static_cast<T>(settings_.epsilon);
    for (Buffer<T>& level : context.levels) {
      executor.for_chunks(count, 4096, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) level[i] = std::log(std::max(level[i], T(0)) + epsilon);
      });
    }
  }

  template <class E>
  void fill_positions(Context& context, E& executor) const {
    const std::size_t n = context.positions, dimensions = settings_.dimensions();
    context.u.resize(dimensions * context.stride);
    context.gate.resize(context.stride);
    executor.for_chunks(dimensions, 1, [&](std::size_t j, std::size_t, std::size_t) {
      const T* fine = context.levels[j / 3].data() + j % 3 * n;
      const T* wide = context.levels[j / 3 + 1].data() + j % 3 * n;
      T* target = context.u.data() + j * context.stride;
      for (std::size_t i = 0; i < n; ++i) target[i] = fine[i] - wide[i];
      std::fill(target + n, target + context.stride, T(0));
    });
    for (std::size_t i = 0; i < n; ++i) context.gate[i] = gate_at(context, i).value;
    std::fill(context.gate.data() + n, context.gate.data() + context.stride, T(0));
  }

  struct Gate {
    T value, slope;
  };
  /// (1 - exp(-(m / g)^2)) (1 - exp(-((1 - m) / g)^2)) of the mean colour m of the widest blur.
  [[nodiscard]] Gate gate_at(const Context& context, std::size_t i) const {
    const T* coarse = context.coarse.data() + i;
    const T mean = (coarse[0] + coarse[context.positions] + coarse[2 * context.positions]) / T(3);
    const T scale = T(1) / static_cast<T>(settings_.gate);
    const T low = mean * scale, high = (T(1) - mean) * scale;
    const T dark = std::exp(-low * low), bright = std::exp(-high * high);
    return {(T(1) - dark) * (T(1) - bright),
            T(2) * scale * (low * dark * (T(1) - bright) - high * bright * (T(1) - dark))};
  }

  void pooled_gradient(std::span<const T> d_logits, Context& context) const {
    const std::size_t features = context.pooled.size();
    context.d_pooled.assign(features, T(0));
    for (std::size_t b = 0; b < d_logits.size(); ++b) {
      for (std::size_t k = 0; k < features; ++k) context.d_pooled[k] += weights_.head[b * features + k] * d_logits[b];
    }
  }

  /// From d_u and d_gate to the image: from the widest blur to the first.
  template <class E>
  void scatter(ImageView<T> d_image, Context& context, E& executor) const {
    const std::size_t n = context.positions, last = context.maps.size() - 1;
    const T epsilon = static_cast<T>(settings_.epsilon);
    context.d_level.resize(3 * n);
    std::fill_n(context.d_level.data(), 3 * n, T(0));
    for (std::size_t i = 0; i < n; ++i) {
      const T share = gate_at(context, i).slope * context.d_gate[i] / T(3);
      for (std::size_t c = 0; c < 3; ++c) context.d_level[c * n + i] = share;
    }
    for (std::size_t b = last + 1; b-- > 0;) {
      for (std::size_t c = 0; c < 3; ++c) {
        const T* value = context.levels[b].data() + c * n;
        T* target = context.d_level.data() + c * n;
        const T* fine = b < last ? context.d_u.data() + (3 * b + c) * context.stride : nullptr;
        const T* wide = b > 0 ? context.d_u.data() + (3 * (b - 1) + c) * context.stride : nullptr;
        const T lowest = std::log(epsilon);
        for (std::size_t i = 0; i < n; ++i) {
          const T sum = (fine != nullptr ? fine[i] : T(0)) - (wide != nullptr ? wide[i] : T(0));
          if (value[i] > lowest) target[i] += sum * std::exp(-value[i]);
        }
      }
      if (b == 0) {
        context.maps[0].add_transposed(grid(context.d_level, context), d_image, context.row, executor);
        return;
      }
      context.d_finer.resize(3 * n);
      std::fill_n(context.d_finer.data(), 3 * n, T(0));
      context.maps[b].add_transposed(grid(context.d_level, context), grid(context.d_finer, context), context.row,
                                     executor);
      std::swap(context.d_level, context.d_finer);
    }
  }

  Settings settings_;
  LatticeWeights<T> weights_;
};

}  // namespace compmark::inline v0
