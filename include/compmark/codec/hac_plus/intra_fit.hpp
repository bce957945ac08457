// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Finds the weights of the context inside an anchor (codec/integer/intra_context.hpp) for a finished model: nothing is
// trained again, and the decoded model stays what it is, to the last bit. Least bits of the coded symbols by Adam on
// samples of 128 anchors, with a pull of every weight to zero, from which most of them do not come away. HAC++ trains
// its networks together with the scene; this is done in seconds when a file is written. It may use floats: the weights
// are stored, not found again. Cost: 23 us an anchor of a sample, 3 s for 1,000 samples, on one core, so that the
// weights do not depend on the number of cores.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/codec/integer/intra_context.hpp"
#include "compmark/core/random.hpp"

namespace compmark {

/// Anchors as the context sees them.
struct IntraSample {
  std::size_t channels = 0;
  std::vector<HashPrediction> predicted;  ///< [anchors, channels]
  std::vector<std::int32_t> symbol;       ///< the same
  std::vector<std::uint8_t> coded;        ///< the same: 0 for masked offsets
  std::vector<std::int16_t> near;         ///< the same: NearAnchors::near()
  std::vector<std::uint8_t> has_near;     ///< [anchors]

  [[nodiscard]] std::span<const std::int16_t> near_of(std::size_t anchor) const {
    return std::span<const std::int16_t>(near).subspan(anchor * channels, has_near[anchor] != 0 ? channels : 0);
  }
  [[nodiscard]] std::size_t anchors() const { return channels == 0 ? 0 : symbol.size() / channels; }
};

struct IntraFitSettings {
  std::size_t samples = 1000, anchors = 128;  ///< Adam steps, and anchors of one
  double rate = 0.006;                        ///< of the first step; falls to 0 along a cosine
  double pull = 0.002;                        ///< bits an anchor that a weight of one costs
  double floor = 0x1p-24;                     ///< added to a symbol's probability: what an escape costs
  std::size_t most_channels = 512;            ///< more are left to the hash grid
};

namespace detail {

/// Probability of a bin, and its derivatives by the mean (bins) and by log2 of the deviation.
struct BinMass {
  float mass = 0, by_mean = 0, by_spread = 0;
};
[[nodiscard]] inline BinMass bin_mass(float distance, float log2_sigma) {
  const float inverse = std::exp2(-log2_sigma), a = (distance - 0.5f) * inverse, b = (distance + 0.5f) * inverse;
  const auto upper = [](float x) { return 0.5f * std::erfc(x * (std::numbers::sqrt2_v<float> / 2)); };
  const auto density = [](float x) {
    return std::numbers::inv_sqrtpi_v<float> * (std::numbers::sqrt2_v<float> / 2) * std::exp(-0.5f * x * x);
  };
  const float at_a = density(a), at_b = density(b);
  return {a > 0 ? upper(a) - upper(b) : upper(-b) - upper(-a), (at_a - at_b) * inverse,
          (at_a * a - at_b * b) * std::numbers::ln2_v<float>};
}

/// Adam with a pull to zero, for one array of weights.
class IntraWeights {
 public:
  IntraWeights(std::size_t count, float pull)
      : value(count),
        gradient(count),
        first_(count),
        second_(count),
        pull_(pull) {}
  std::vector<float> value, gradient;

  void step(float rate, float anchors, float correction1, float correction2) {
    for (std::size_t i = 0; i < value.size(); ++i) {
      const float side = value[i] > 0 ? pull_ : value[i] < 0 ? -pull_ : 0.0f, g = gradient[i] / anchors + side;
      first_[i] += 0.1f * (g - first_[i]);
      second_[i] += 0.01f * (g * g - second_[i]);
      value[i] -= rate * first_[i] / correction1 / (std::sqrt(second_[i] / correction2) + 1e-6f);
      gradient[i] = 0;
    }
  }
  [[nodiscard]] std::vector<std::int16_t> rounded() const {
    std::vector<std::int16_t> result;
    result.reserve(value.size());
    constexpr float limit = IntraContext::greatest_weight;
    for (const float weight : value) {
      result.push_back(static_cast<std::int16_t>(
          std::clamp(std::nearbyint(weight * (1 << IntraContext::weight_bits)), -limit, limit)));
    }
    return result;
  }

 private:
  std::vector<float> first_, second_;
  float pull_;
};

}  // namespace detail

/// What the symbols of a sample cost with a context, in bits.
template <class Tables>
[[nodiscard]] double intra_bits(const Tables& tables, const IntraContext& context, const IntraSample& sample) {
  IntraState state(context);
  double bits = 0;
  for (std::size_t anchor = 0; anchor < sample.anchors(); ++anchor) {
    state.begin(sample.near_of(anchor));
    for (std::size_t c = 0; c < sample.channels; ++c) {
      const std::size_t i = anchor * sample.channels + c;
      if (sample.coded[i] == 0) continue;
      bits += ideal_bits(tables, state.model(c, sample.predicted[i]), sample.symbol[i]);
      state.tell(c, sample.predicted[i], sample.symbol[i]);
    }
  }
  return bits;
}

/// The weights for a sample; all zero where there is none or an anchor has too many scalars.
[[nodiscard]] inline IntraContext fit_intra(const IntraSample& sample, const IntraFitSettings& settings = {}) {
  const std::size_t channels = sample.channels, anchors = sample.anchors(), count = IntraContext::weights(channels);
  IntraContext context = IntraContext::none(channels);
  if (anchors == 0 || channels > settings.most_channels) return context;
  const float pull = static_cast<float>(settings.pull);
  detail::IntraWeights mean(count, pull), spread(count, pull), mean_bias(channels, 0), spread_bias(channels, 0),
      near(channels, 0), near_spread(channels, 0);
  std::vector<float> z(channels), size(channels), guess(channels), surprise(channels), d_guess(channels),
      d_surprise(channels);
  std::vector<float> n(channels), near_size(channels);
  constexpr float deviation_unit = 1.0f / (1 << IntraContext::deviation_bits), bin_unit = 1.0f / 32,
                  usual = IntraContext::usual_deviation * deviation_unit,
                  usual_near = IntraContext::usual_near * deviation_unit, greatest = 10;
  const auto floor = static_cast<float>(settings.floor);
  const auto row_of = [&](std::vector<float>& weights, std::size_t s) { return weights.data() + context.row(s); };
  for (std::size_t step = 0; step < settings.samples; ++step) {
    const Random random(1, step, random_stage("intra fit"));
    for (std::size_t draw = 0; draw < settings.anchors; ++draw) {
      const std::size_t anchor =
          std::min(anchors - 1, static_cast<std::size_t>(random.uniform(draw) * static_cast<double>(anchors)));
      const std::size_t first = anchor * channels;
      guess = mean_bias.value;
      surprise = spread_bias.value;
      std::fill(n.begin(), n.end(), 0.0f);
      std::fill(near_size.begin(), near_size.end(), 0.0f);
      const std::span<const std::int16_t> around = sample.near_of(anchor);
      for (std::size_t t = 0; t < around.size(); ++t) {
        n[t] = static_cast<float>(around[t]) * deviation_unit;
        near_size[t] = std::abs(n[t]) - usual_near;
        guess[t] += near.value[t] * n[t];
        surprise[t] += near_spread.value[t] * near_size[t];
      }
      for (std::size_t s = 0; s < channels; ++s) {
        z[s] = size[s] = d_guess[s] = d_surprise[s] = 0;
        if (sample.coded[first + s] == 0) continue;
        const HashPrediction& predicted = sample.predicted[first + s];
        z[s] = static_cast<float>(detail::symbol_deviation(predicted, sample.symbol[first + s])) * deviation_unit;
        size[s] = std::abs(z[s]) - usual;
        const float *const a = row_of(mean.value, s), *const b = row_of(spread.value, s);
        float *const g = guess.data() + s + 1, *const v = surprise.data() + s + 1;
        const float zs = z[s], sizes = size[s];
        for (std::size_t i = 0; i + s + 1 < channels; ++i) {
          g[i] += a[i] * zs;
          v[i] += b[i] * sizes;
        }
        // All that was said of s is there.
        const float e = static_cast<float>(detail::deviation_tables.size[HashPrediction::table(predicted.level)]) *
                        (bin_unit / 256);
        const float least = HashPrediction::least_level / 2048.0f;
        const float level = static_cast<float>(predicted.level) / 2048 + surprise[s];
        const float distance =
            static_cast<float>(static_cast<double>(sample.symbol[first + s]) - predicted.mean / 32.0) - e * guess[s];
        const detail::BinMass bin = detail::bin_mass(distance, std::max(level, least));
        const float slope = -1 / ((bin.mass + floor) * std::numbers::ln2_v<float>);
        d_guess[s] = std::clamp(slope * bin.by_mean * e, -greatest, greatest);
        d_surprise[s] = level < least ? 0 : std::clamp(slope * bin.by_spread, -greatest, greatest);
      }
      for (std::size_t s = 0; s < channels; ++s) {
        mean_bias.gradient[s] += d_guess[s];
        spread_bias.gradient[s] += d_surprise[s];
        near.gradient[s] += d_guess[s] * n[s];
        near_spread.gradient[s] += d_surprise[s] * near_size[s];
        if (sample.coded[first + s] == 0) continue;
        float *const a = row_of(mean.gradient, s), *const b = row_of(spread.gradient, s);
        const float *const g = d_guess.data() + s + 1, *const v = d_surprise.data() + s + 1;
        const float zs = z[s], sizes = size[s];
        for (std::size_t i = 0; i + s + 1 < channels; ++i) {
          a[i] += g[i] * zs;
          b[i] += v[i] * sizes;
        }
      }
    }
    const double done = static_cast<double>(step + 1);
    const auto rate = static_cast<float>(
        settings.rate * 0.5 * (1 + std::cos(std::numbers::pi * done / static_cast<double>(settings.samples))));
    const auto correction1 = static_cast<float>(1 - std::pow(0.9, done)),
               correction2 = static_cast<float>(1 - std::pow(0.99, done));
    for (detail::IntraWeights* part : {&mean, &spread, &mean_bias, &spread_bias, &near, &near_spread})
      part->step(rate, static_cast<float>(settings.anchors), correction1, correction2);
  }
  context.mean = mean.rounded();
  context.spread = spread.rounded();
  context.mean_bias = mean_bias.rounded();
  context.spread_bias = spread_bias.rounded();
  context.near = near.rounded();
  context.near_spread = near_spread.rounded();
  return context;
}

}  // namespace compmark
