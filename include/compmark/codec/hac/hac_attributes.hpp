// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The scalars of one anchor in HacModel: feature [D], scale l = exp(scaling) [6], offset [3 K]. Each group has a step
// q of its own (docs/spec/compression.md, 1.3, 1.4). Distortion adds noise, x~ = x + q u with u uniform in (-1/2, 1/2),
// or the error of rounding to whole steps where training rounds (then with the steps of the file, below). l~ stays
// above a small positive least, and its table holds the logarithm. The rate predicts each scalar by a Gaussian of mean
// m + d mu and deviation d 2^s: (m, d) are the mean and deviation of that scalar over all anchors, (mu, s) the outputs
// of the network. HAC uses both outputs raw, so that a negative deviation has no gradient and the outputs of different
// channels have very different sizes. Cost an anchor: D + 6 + 3 K random numbers, exponentials and logarithms of 6;
// where its rate counts, the bits of all scalars.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "compmark/codec/integer/integer_functions.hpp"
#include "compmark/codec/rate/gaussian_rate.hpp"
#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

template <class T, int feature_dim, int offset_count>
struct HacAttributes {
  static constexpr int W = native_width<T>;
  static constexpr int D = feature_dim, K = offset_count;
  static constexpr int scalars = D + 6 + 3 * K;              ///< of an anchor, in the order feature, scale, offset
  static constexpr int row = (scalars + W - 1) / W * W + W;  ///< stride of scratch that packs may overrun
  static constexpr std::array<int, 4> begin{0, D, D + 6, scalars};
  static constexpr int outputs = 2 * scalars + 3;  ///< mu_f, s_f, mu_l, s_l, mu_o, s_o, r_f, r_l, r_o
  static constexpr double most_log2 = 24;          ///< of a deviation over d, either way

  /// Settings of one attribute group, as HAC has them.
  static constexpr std::array<double, 3> published_steps{1, 0.001, 0.2};
  static constexpr double least_step = 0x1p-6;  ///< in units of Q0: index -96 of the coded 16 log2(q / Q0)

  /// q = 2 Q0 sigmoid(2 r) of the three groups, at least Q0 / 64 (math/adaptive_step.hpp in packs). `raw` and the
  /// result have 3 + W scalars.
  static void steps(const T* raw, const std::array<T, 3>& base, T* q) {
    using P = Pack<T, W>;
    T doubled[3 + W] = {}, least[3 + W] = {};
    for (std::size_t g = 0; g < 3; ++g) {
      doubled[g] = 2 * base[g];
      least[g] = static_cast<T>(least_step) * base[g];
    }
    for (int g = 0; g < 3; g += W) {
      const P r = P::load(raw + g, P::MaskType::first(3 - g));
      max(P::load(doubled + g) * sigmoid(r + r), P::load(least + g)).store(q + g);
    }
  }
  /// The steps of the file, whole sixteenths of an octave. With any other step, values near the border of two symbols
  /// would be rounded differently in training and in the file. It is the coder's own function of r
  /// (integer_functions.hpp), of a float instead of a whole number of 2^-16. The gradient passes straight through, as
  /// that of the step itself. It is zero at the greatest step, 2 Q0, so that a step which reaches it while training
  /// rounds stays there.
  static void coded_steps(const T* raw, const std::array<T, 3>& base, T* q) {
    constexpr double unit = 1 << StepGrid::r_bits;
    for (std::size_t g = 0; g < 3; ++g) {
      const double r = static_cast<double>(raw[g]);
      if (!(std::abs(r) < 64)) {  // beyond every border; a NaN stays one
        q[g] = r > 0 ? 2 * base[g] : r < 0 ? static_cast<T>(least_step) * base[g] : raw[g];
        continue;
      }
      const std::int64_t ratio = step_ratio(step_index(static_cast<std::int32_t>(std::lround(r * unit))));
      q[g] = static_cast<T>(static_cast<double>(ratio) * (static_cast<double>(base[g]) * 0x1p-24));
    }
  }
  /// d loss / dr, dq / dr = q (2 - q / Q0). Where the step is at its least, only a gradient that increases it passes
  /// (case EN2).
  [[nodiscard]] static T pull_step(T q, T base, T d_step) {
    const bool held = q <= static_cast<T>(least_step) * base;
    return held && d_step > T(0) ? T(0) : d_step * q * (2 - q / base);
  }

  /// u of all scalars: SplitMix64 from a start that is keyed by the anchor, two numbers of 23 bits from one draw.
  static void draw(const Random& random, std::uint32_t anchor, T* u) {
    const std::uint64_t start = random.bits(anchor);
    for (int c = 0; c < scalars; c += 2) {  // an odd count writes one more, into the padding
      const std::uint64_t bits = mix_bits(start + static_cast<std::uint64_t>(c / 2) * 0x9E3779B97F4A7C15ull);
      u[c] = static_cast<T>((static_cast<float>(static_cast<std::int32_t>(bits >> 41)) + 0.5f) * 0x1p-23f - 0.5f);
      u[c + 1] = static_cast<T>(
          (static_cast<float>(static_cast<std::int32_t>(bits >> 18 & 0x7FFFFF)) + 0.5f) * 0x1p-23f - 0.5f);
    }
  }

  /// Tests whether every attribute of an anchor is finite: the sum of zeros is a NaN otherwise.
  [[nodiscard]] static bool finite(const T* feature, const T* scaling, const T* offset) {
    T sum{};
    for (int c = 0; c < D; ++c) sum += T(0) * feature[c];
    for (int c = 0; c < 6; ++c) sum += T(0) * scaling[c] + (scaling[c] < T(80) ? T(0) : T(1));  // exp is finite
    for (int c = 0; c < 3 * K; ++c) sum += T(0) * offset[c];
    return sum == T(0);
  }
  /// Leaves an anchor as it is, and its gradients too.
  static void leave(T* noise, T* scales) {
    std::fill_n(noise, row, T(0));
    std::fill_n(scales, 12, T(1));
  }

  /// Distorts one anchor in place. `noise` [row] is read, or written where `round`; scales [12] receives l and d
  /// log(l~) / dl~; values [row], if wanted, the distorted scalars with l~ before its least.
  static void distort(bool round, const std::array<T, 3>& q, T least_scale, T* feature, T* scaling, T* offset, T* noise,
                      T* scales, T* values) {
    const auto group = [&](T* from, int first, int count, T step) {
      if (round) {
        const T inverse = 1 / step;
        for (int c = 0; c < count; ++c) noise[first + c] = std::nearbyint(from[c] * inverse) - from[c] * inverse;
      }
      for (int c = 0; c < count; ++c) from[c] += step * noise[first + c];
      if (values != nullptr) std::copy_n(from, count, values + first);
    };
    group(feature, begin[0], D, q[0]);
    group(offset, begin[2], 3 * K, q[2]);
    using P = Pack<T, W>;
    T scale[6 + W], slope[6 + W];
    for (int c = 0; c < 6; c += W) exp(P::load(scaling + c, P::MaskType::first(6 - c))).store(scale + c);
    std::copy_n(scale, 6, scales);
    group(scale, begin[1], 6, q[1]);
    for (int c = 0; c < 6; c += W) {
      const auto six = P::MaskType::first(6 - c);
      const P noisy = P::load(scale + c), least(least_scale);
      const auto free = noisy > least;
      const P held = select(free, noisy, least);
      (detail::log2_positive(held) * P(T(0.693147180559945309417L))).store(scaling + c, six);
      keep(free, P(T(1)) / held).store(slope + c);
    }
    std::copy_n(slope, 6, scales + 6);
  }

  /// The backward pass, in place: from gradients by the distorted table rows to those by the rows before. `rate` [row],
  /// if any, holds gradients by the distorted scalars and is added. Returns the gradients by the three steps.
  static std::array<T, 3> pull_back(const T* noise, const T* scales, const T* rate, T* d_feature, T* d_scaling,
                                    T* d_offset) {
    std::array<T, 3> d_step{};
    T d_scale[6];
    for (int c = 0; c < 6; ++c) d_scale[c] = d_scaling[c] * scales[6 + c];
    const auto group = [&](T* d, int first, int count) {
      if (rate != nullptr) {
        for (int c = 0; c < count; ++c) d[c] += rate[first + c];
      }
      constexpr int lanes = 8;
      T sums[lanes] = {};
      int c = 0;
      for (; c + lanes <= count; c += lanes) {
        for (int i = 0; i < lanes; ++i) sums[i] += d[c + i] * noise[first + c + i];
      }
      for (; c < count; ++c) sums[c % lanes] += d[c] * noise[first + c];
      return ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
    };
    d_step[0] = group(d_feature, begin[0], D);
    d_step[1] = group(d_scale, begin[1], 6);
    d_step[2] = group(d_offset, begin[2], 3 * K);
    for (int c = 0; c < 6; ++c) d_scaling[c] = d_scale[c] * scales[c];
    return d_step;
  }

  /// Scratch of rate().
  struct Scratch {
    alignas(64) T values[row], mean_output[row], log_output[row], center[row], spread[row], steps[row];
    alignas(64) T bits[row], d_value[row], d_mean_output[row], d_log_output[row], d_step[row];
  };
  /// Weighted bits of one anchor by group.
  struct Bits {
    std::array<double, 3> weighted{};
    int unmasked = 0;  ///< offsets
  };
  /// Constant over an iteration: the scratch's copy of the statistics [2, scalars].
  static void load_statistics(MatrixView<const T> statistics, Scratch& s) {
    std::fill(std::begin(s.values), std::end(s.values), T(0));
    std::fill(std::begin(s.mean_output), std::end(s.mean_output), T(0));
    std::fill(std::begin(s.log_output), std::end(s.log_output), T(0));
    std::fill(std::begin(s.center), std::end(s.center), T(0));
    std::fill(std::begin(s.spread), std::end(s.spread), T(1));
    std::fill(std::begin(s.steps), std::end(s.steps), T(1));
    std::copy_n(statistics.row(0), scalars, s.center);
    std::copy_n(statistics.row(1), scalars, s.spread);
  }

  /// No rate and no gradient of one.
  static void drop(T* d_value, T* d_output, std::array<T, 3>& d_step, T* d_mask) {
    std::fill_n(d_value, scalars, T(0));
    std::fill_n(d_output, 2 * scalars, T(0));
    std::fill_n(d_mask, K, T(0));
    d_step = {};
  }
  /// Bits of s.values under the network's `output` and the steps q, and the gradients of unit * weighted bits: by the
  /// distorted scalars (d_value [scalars]), the outputs (d_output, the steps' not), the steps, and the straight-through
  /// masks (d_mask [K], before their slope). Offsets count where they are unmasked; features and scales where any does,
  /// if `anchor_mask`, else always.
  static Bits rate(const T* output, const std::array<T, 3>& q, const T* mask, bool anchor_mask, T unit, Scratch& s,
                   T* d_value, T* d_output, std::array<T, 3>& d_step, T* d_mask) {
    using P = Pack<T, W>;
    for (std::size_t g = 0; g < 3; ++g) {
      const int first = begin[g], count = begin[g + 1] - first;
      std::copy_n(output + 2 * first, count, s.mean_output + first);
      std::copy_n(output + 2 * first + count, count, s.log_output + first);
      std::fill_n(s.steps + first, count, q[g]);
    }
    constexpr T ln2 = T(0.693147180559945309417L);
    for (int c = 0; c < scalars; c += W) {
      const P spread = P::load(s.spread + c), raw = P::load(s.log_output + c), most(static_cast<T>(most_log2));
      const P held = max(-most, min(most, raw));
      const P sigma = spread * exp(held * P(ln2)),
              mean = fma(spread, P::load(s.mean_output + c), P::load(s.center + c));
      const auto bits = gaussian_bits(P::load(s.values + c), mean, sigma, P::load(s.steps + c));
      bits.bits.store(s.bits + c);
      bits.d_value.store(s.d_value + c);
      (-bits.d_value * spread).store(s.d_mean_output + c);
      const P d_log = bits.d_sigma * sigma * P(ln2);
      // at the limit: only a gradient that leads back passes
      select(raw > most, max(d_log, P(T(0))), select(raw < -most, min(d_log, P(T(0))), d_log))
          .store(s.d_log_output + c);
      bits.d_step.store(s.d_step + c);
    }
    Bits result;
    for (int k = 0; k < K; ++k) result.unmasked += is_unmasked(mask[k]) ? 1 : 0;
    if (const P total = sum_of(s.bits); !std::isfinite(reduce_add(total))) {  // a bad attribute or weight: no gradient
      drop(d_value, d_output, d_step, d_mask);
      return result;
    }
    const T share = !anchor_mask || result.unmasked > 0 ? T(1) : T(0);
    double geometry = 0;  // feature and scale, whatever the masks
    for (int c = 0; c < begin[2]; ++c) geometry += static_cast<double>(s.bits[c]);
    for (std::size_t g = 0; g < 2; ++g) {
      double sum = 0;
      T sum_step = 0;
      for (int c = begin[g]; c < begin[g + 1]; ++c) {
        sum += static_cast<double>(s.bits[c]);
        sum_step += s.d_step[c];
        weigh(unit * share, c, s);
      }
      result.weighted[g] = static_cast<double>(share) * sum;
      d_step[g] = unit * share * sum_step;
    }
    d_step[2] = 0;
    for (int k = 0; k < K; ++k) {
      const T weight = is_unmasked(mask[k]) ? T(1) : T(0);
      double sum = 0;
      for (int c = begin[2] + 3 * k; c < begin[2] + 3 * k + 3; ++c) {
        sum += static_cast<double>(s.bits[c]);
        d_step[2] += unit * weight * s.d_step[c];
        weigh(unit * weight, c, s);
      }
      result.weighted[2] += static_cast<double>(weight) * sum;
      d_mask[k] = unit * static_cast<T>(sum + (anchor_mask ? geometry / K : 0.0));
    }
    std::copy_n(s.d_value, scalars, d_value);
    for (std::size_t g = 0; g < 3; ++g) {
      const int first = begin[g], count = begin[g + 1] - first;
      std::copy_n(s.d_mean_output + first, count, d_output + 2 * first);
      std::copy_n(s.d_log_output + first, count, d_output + 2 * first + count);
    }
    return result;
  }

 private:
  [[nodiscard]] static Pack<T, W> sum_of(const T* bits) {
    Pack<T, W> sum(T(0));
    for (int c = 0; c < scalars; c += W) {
      sum = sum + Pack<T, W>::load(bits + c, Pack<T, W>::MaskType::first(scalars - c));
    }
    return sum;
  }
  static void weigh(T weight, int c, Scratch& s) {
    s.d_value[c] *= weight;
    s.d_mean_output[c] *= weight;
    s.d_log_output[c] *= weight;
  }
};

}  // namespace compmark
