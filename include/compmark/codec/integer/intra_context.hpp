// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The context inside an anchor and beside it, in whole numbers: each scalar is expected where the scalars before it
// say, beside what the hash grid says. HAC++ (TPAMI 2025) has a network for each of five chunks of the features; this
// is its limit of chunks of one scalar with a linear predictor, which is the triangular form of a KLT, over features,
// scales and offsets together. For the scalar t of an anchor, with the mean m (1/32 bins) and the level L (256 levels
// of 1/8 octave) that the hash grid predicts, the deviations z of the scalars s < t of the same anchor that are coded,
// and the mean deviation n(t) in this scalar of the anchors next to this one (near_anchors.hpp):
//   z(s) = (32 symbol - m) / e(L), held in +-4          Q9; e(L) = sqrt(sigma^2 + 1/12), what rounding adds included
//   m'   = m + e(L) (b(t) + a(t) n(t) + sum A(t, s) z(s))                    a straighter guess
//   L'   = L + c(t) + d(t) (|n(t)| - 0.5) + sum B(t, s) (|z(s)| - 0.8)       octaves: surprises come together
// Weights are Q5 in 8 bits, so that no sum of them can overflow 32 bits and nothing has to be checked at load. What a
// masked offset would say is left out. Cost: P^2 products of 16 bits an anchor for P scalars, ~1 us.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "compmark/codec/coder/gaussian_tables.hpp"
#include "compmark/codec/integer/integer_functions.hpp"
#include "compmark/codec/integer/integer_network.hpp"

namespace compmark {

/// What a file stores of it. Row s of a matrix holds the weights of what scalar s says about s + 1, s + 2, …
struct IntraContext {
  static constexpr int weight_bits = 5, deviation_bits = 9;  ///< fraction bits of weights, of z
  static constexpr std::int32_t greatest_weight = 127, greatest_deviation = 4 << deviation_bits;
  static constexpr std::int32_t usual_deviation = 410, usual_near = 256;  ///< 0.8 and 0.5: means of |z|, of |n|

  std::size_t channels = 0;                          ///< P = D + 6 + 3 K; 0: the encoder is to find the weights
  std::vector<std::int16_t> mean;                    ///< A, [P (P - 1) / 2]
  std::vector<std::int16_t> spread;                  ///< B, the same
  std::vector<std::int16_t> mean_bias, spread_bias;  ///< b, c [P]
  std::vector<std::int16_t> near, near_spread;       ///< a, d [P]

  [[nodiscard]] static constexpr std::size_t weights(std::size_t channels) {
    return channels == 0 ? 0 : channels * (channels - 1) / 2;
  }
  /// Where row s begins: with the weight for s + 1.
  [[nodiscard]] std::size_t row(std::size_t s) const { return s * (2 * channels - s - 1) / 2; }
  /// All weights zero: HAC.
  [[nodiscard]] static IntraContext none(std::size_t channels) {
    IntraContext context;
    context.channels = channels;
    context.mean.assign(weights(channels), 0);
    context.spread = context.mean;
    context.mean_bias.assign(channels, 0);
    context.spread_bias = context.near = context.near_spread = context.mean_bias;
    return context;
  }
  /// Without what says how far off a scalar is: for values that are known roughly, and so look less far off.
  [[nodiscard]] IntraContext without_spread() const {
    IntraContext context = *this;
    for (auto* part : {&context.spread, &context.spread_bias, &context.near_spread})
      std::fill(part->begin(), part->end(), std::int16_t{0});
    return context;
  }
  /// All arrays, in the order of files.
  template <class Context>
  [[nodiscard]] static auto parts(Context& context) {
    return std::array{&context.mean_bias,   &context.spread_bias, &context.near,
                      &context.near_spread, &context.mean,        &context.spread};
  }
  friend bool operator==(const IntraContext&, const IntraContext&) = default;
};

/// A scalar as the hash grid predicts it, in bins.
struct HashPrediction {
  std::int32_t mean = 0;   ///< 1/32 bins, |mean| <= 2^29
  std::int32_t level = 0;  ///< 2048 log2 sigma, in [least_level, greatest_level]

  static constexpr std::int32_t least_level = GaussianTables::least_level * 256,
                                greatest_level = (GaussianTables::least_level + GaussianTables::levels - 1) * 256;

  /// From the outputs of the context network: a mean in units of Q0 (Q12) and 8 log2(sigma / Q0) (Q8), at a step.
  [[nodiscard]] static HashPrediction of(std::int32_t mean, std::int32_t sigma, int index, std::int64_t reciprocal) {
    constexpr int to_32nds = IntegerNetwork::mean_bits + StepGrid::fraction_bits - 5;
    constexpr std::int64_t half = std::int64_t{1} << (to_32nds - 1), mean_limit = 1 << 29;
    const std::int64_t level = std::int64_t{sigma} - index * (1 << (IntegerNetwork::sigma_bits - 1));
    return {static_cast<std::int32_t>(std::clamp((mean * reciprocal + half) >> to_32nds, -mean_limit, mean_limit)),
            static_cast<std::int32_t>(std::clamp<std::int64_t>(level, least_level, greatest_level))};
  }
  /// Number of the table of a level.
  [[nodiscard]] static std::size_t table(std::int32_t level) {
    return static_cast<std::size_t>(((level + 128) >> 8) - GaussianTables::least_level);
  }
};

namespace detail {

struct DeviationTables {
  std::array<std::int32_t, GaussianTables::levels> size{};     ///< 32 e, Q8
  std::array<std::int32_t, GaussianTables::levels> inverse{};  ///< 2^9 / (32 e), Q20
};
[[nodiscard]] constexpr DeviationTables make_deviation_tables() {
  DeviationTables tables;
  for (int i = 0; i < GaussianTables::levels; ++i) {
    // sigma^2 = 2^(level / 4), Q24; the root of its fourfold is e, Q13.
    const std::uint64_t variance = power_of_two(8 * (i + GaussianTables::least_level), 24) + ((1u << 24) + 6) / 12;
    const std::uint64_t size = integer_sqrt(variance << 2);
    tables.size[static_cast<std::size_t>(i)] = static_cast<std::int32_t>(size);
    tables.inverse[static_cast<std::size_t>(i)] =
        static_cast<std::int32_t>(((std::uint64_t{1} << 37) + size / 2) / size);
  }
  return tables;
}
inline constexpr DeviationTables deviation_tables = make_deviation_tables();

/// z of a place in 1/32 bin, Q9.
[[nodiscard]] inline std::int32_t place_deviation(const HashPrediction& predicted, std::int64_t place) {
  constexpr std::int64_t far = 1 << 20, most = IntraContext::greatest_deviation;
  const std::int64_t distance = std::clamp(place - predicted.mean, -far, far);
  const std::int64_t inverse = deviation_tables.inverse[HashPrediction::table(predicted.level)];
  return static_cast<std::int32_t>(std::clamp(round_shift(distance * inverse, 20), -most, most));
}
/// z of a coded symbol, Q9.
[[nodiscard]] inline std::int32_t symbol_deviation(const HashPrediction& predicted, std::int32_t symbol) {
  return place_deviation(predicted, 32 * std::int64_t{symbol});
}

}  // namespace detail

/// FNV-1a of the tables, least byte first: part of the numeric specification of a file.
[[nodiscard]] constexpr std::uint64_t deviation_table_hash() {
  std::uint64_t hash = 0xCBF29CE484222325ull;
  const auto add = [&](std::int32_t value) {
    for (int shift = 0; shift < 32; shift += 8)
      hash = (hash ^ (static_cast<std::uint32_t>(value) >> shift & 255u)) * 0x100000001B3ull;
  };
  for (const std::int32_t value : detail::deviation_tables.size) add(value);
  for (const std::int32_t value : detail::deviation_tables.inverse) add(value);
  return hash;
}

/// What is known inside one anchor while its scalars are coded in order; one object a worker.
class IntraState {
 public:
  /// The context must outlive this.
  explicit IntraState(const IntraContext& context)
      : context_(&context),
        guess_(context.channels),
        surprise_(context.channels) {}

  /// The next anchor. `near`: n of each channel, Q9, or nothing.
  void begin(std::span<const std::int16_t> near = {}) {
    for (std::size_t t = 0; t < context_->channels; ++t) {
      guess_[t] = context_->mean_bias[t] * (1 << IntraContext::deviation_bits);
      surprise_[t] = context_->spread_bias[t] * (1 << IntraContext::deviation_bits);
    }
    for (std::size_t t = 0; t < near.size(); ++t) {
      guess_[t] += context_->near[t] * near[t];
      surprise_[t] += context_->near_spread[t] * (std::abs(int{near[t]}) - IntraContext::usual_near);
    }
  }
  /// The model of scalar t after all before it were told.
  [[nodiscard]] SymbolModel model(std::size_t t, const HashPrediction& predicted) const {
    constexpr int fraction = IntraContext::weight_bits + IntraContext::deviation_bits;
    constexpr std::int64_t mean_limit = 1 << 29;
    const std::int64_t size = detail::deviation_tables.size[HashPrediction::table(predicted.level)];
    const std::int64_t mean = predicted.mean + round_shift(size * guess_[t], 8 + fraction);
    const std::int64_t level = predicted.level + round_shift(surprise_[t], fraction - 11);
    return {static_cast<std::uint16_t>(HashPrediction::table(static_cast<std::int32_t>(
                std::clamp<std::int64_t>(level, HashPrediction::least_level, HashPrediction::greatest_level)))),
            static_cast<std::int32_t>(std::clamp(mean, -mean_limit, mean_limit))};
  }
  /// Scalar s is coded: returns its z. Scalars that are not coded are not told.
  std::int32_t tell(std::size_t s, const HashPrediction& predicted, std::int32_t symbol) {
    return tell(s, detail::symbol_deviation(predicted, symbol));
  }
  /// The same by its z.
  std::int32_t tell(std::size_t s, std::int32_t z) {
    const std::int32_t size = std::abs(z) - IntraContext::usual_deviation;
    const std::size_t first = s + 1, count = context_->channels - first;
    const std::int16_t *const mean = context_->mean.data() + context_->row(s), *const spread = context_->spread.data() +
                                                                                               context_->row(s);
    std::int32_t *const guess = guess_.data() + first, *const surprise = surprise_.data() + first;
    for (std::size_t i = 0; i < count; ++i) {
      guess[i] += mean[i] * z;
      surprise[i] += spread[i] * size;
    }
    return z;
  }

 private:
  const IntraContext* context_;
  std::vector<std::int32_t> guess_, surprise_;  ///< Q14
};

}  // namespace compmark
