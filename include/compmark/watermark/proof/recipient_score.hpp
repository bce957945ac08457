// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whose copy do read bits come from? The score of a recipient is a sum over bits, of one number where his code word has
// the bit that was read and of another where it has not: the symmetric score of Skoric, Katzenbeisser and Celik
// (Designs, Codes and Cryptography 46, 2008) for the codes of Tardos (STOC 2003). The word of somebody who had no part
// in it was drawn independently of what is read, so each term has two values with known probabilities, the terms are
// independent, and the distribution of the sum is convolved: P(score >= s) is exact, whatever the others did, and
// whatever weights the bits have, as long as these were found without looking at his word. Numbers are rounded to a
// lattice before they are summed, so that the sum is that of whole numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {

/// What a bit adds to the score of a recipient.
struct ScoreTerm {
  std::int32_t match = 0;     ///< where his word has the bit that was read
  std::int32_t mismatch = 0;  ///< where it has the other
  double probability = 0.5;   ///< of a match, for somebody whose word is independent of what was read
};

/// Steps of the lattice in a score of 1.
inline constexpr double score_steps = 256;

/// The probability of a 1 at one place of a Tardos code, by the cut-off arcsine law: sin^2(r), r uniform between
/// arcsin(sqrt(cutoff)) and its mirror image. `uniform` in [0, 1], `cutoff` in (0, 1/2]; at 1/2 the result is 1/2.
[[nodiscard]] inline double tardos_bias(double uniform, double cutoff) {
  COMPMARK_ASSERT(uniform >= 0 && uniform <= 1 && cutoff > 0 && cutoff <= 0.5, "tardos_bias: 0 < cutoff <= 1/2");
  const double least = std::asin(std::sqrt(cutoff)),
               sine = std::sin(least + uniform * (std::numbers::pi / 2 - 2 * least));
  return std::clamp(sine * sine, cutoff, 1 - cutoff);
}

/// The symmetric score times a weight in [0, 1]: sqrt((1 - q) / q) for a match and -sqrt(q / (1 - q)) for a mismatch,
/// mean 0 and deviation 1 for the innocent; q is the probability of a match, 0 < q < 1.
[[nodiscard]] inline ScoreTerm symmetric_term(double probability, double weight) {
  COMPMARK_ASSERT(probability > 0 && probability < 1 && weight >= 0 && weight <= 1, "symmetric_term: 0 < q < 1");
  const double odds = std::sqrt((1 - probability) / probability);
  return {static_cast<std::int32_t>(std::lround(score_steps * weight * odds)),
          -static_cast<std::int32_t>(std::lround(score_steps * weight / odds)), probability};
}

/// What each bit counts for, found without any code word: min(1, (z / m)^2), m the median of |z| over the bits that all
/// copies share. Bits in which mixed copies differ have small logits, and count little. `logits` are finite; `shared`
/// has the places of the shared bits, at least one.
[[nodiscard]] inline std::vector<double> bit_weights(std::span<const double> logits,
                                                     std::span<const std::size_t> shared) {
  COMPMARK_ASSERT(!shared.empty(), "bit_weights: some bits are shared");
  std::vector<double> sizes;
  for (const std::size_t place : shared) sizes.push_back(std::abs(logits[place]));
  std::sort(sizes.begin(), sizes.end());
  const double middle = sizes[sizes.size() / 2];
  std::vector<double> weights;
  for (const double z : logits) {
    const double ratio = middle > 0 ? std::fmin(1, std::abs(z) / middle) : z != 0 ? 1.0 : 0.0;
    weights.push_back(ratio * ratio);
  }
  return weights;
}

/// P(S >= s) of the sum S of independent terms. Exact but for the rounding of sums of positive doubles. Time:
/// terms * range of the sum, 2 ms for 32 bits of weight 1; memory: 8 bytes a step of the range.
class ScoreTail {
 public:
  explicit ScoreTail(std::span<const ScoreTerm> terms) {
    std::size_t range = 0;
    for (const ScoreTerm& term : terms) {
      least_ += std::min(term.match, term.mismatch);
      range += static_cast<std::size_t>(std::abs(term.match - term.mismatch));
    }
    tail_.assign(range + 1, 0.0);
    tail_[0] = 1;
    std::size_t top = 0;
    for (const ScoreTerm& term : terms) {
      const auto step = static_cast<std::size_t>(std::abs(term.match - term.mismatch));
      if (step == 0) continue;
      const double up = term.match > term.mismatch ? term.probability : 1 - term.probability;
      top += step;
      for (std::size_t k = top + 1; k-- > step;) tail_[k] = tail_[k] * (1 - up) + tail_[k - step] * up;
      for (std::size_t k = 0; k < step; ++k) tail_[k] *= 1 - up;
    }
    for (std::size_t k = range; k-- > 0;) tail_[k] += tail_[k + 1];
  }
  [[nodiscard]] double operator()(std::int64_t score) const {
    const std::int64_t at = score - least_;
    if (at <= 0) return 1;
    return static_cast<std::size_t>(at) < tail_.size() ? std::fmin(1, tail_[static_cast<std::size_t>(at)]) : 0;
  }

 private:
  std::vector<double> tail_;  ///< [range + 1] P(S >= least + k)
  std::int64_t least_ = 0;
};

}  // namespace compmark
