// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Is the spread-spectrum mark of this key in these pictures? T = sum of n_c q_c over cells: n_c = +-1 from the key, q_c
// what the pictures say of cell c, found without the key. Null hypothesis: the key was drawn at random, independently
// of pictures and unmarked model. Then the n_c are independent fair signs whatever q is, and
//   P(T >= t) <= exp(-t^2 / (2 sum of q_c^2))     (Hoeffding, J. Amer. Stat. Assoc. 58, 1963, theorem 2),
// which holds exactly, with no assumption about pictures, noise or registration: who registers badly gets a q that says
// nothing. Pictures of one scene have one key: their q are added, and one test is made.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

namespace compmark {

struct SpreadEvidence {
  double deviations = 0;  ///< T / sqrt(sum of q_c^2): of a random key about normal, mean 0, deviation 1
  double p_value = 1;     ///< Hoeffding's bound; for a random key it is at most p with probability p or less
  std::size_t cells = 0;  ///< that a picture says something of
  /// What a key that agrees with every cell would have: sum of |q_c| / sqrt(sum of q_c^2), sqrt(cells) where all cells
  /// say as much, and less where few say most.
  double most_deviations = 0;

  /// The p-value of that key: these pictures can decide no rate below it.
  [[nodiscard]] double least_p_value() const {
    return std::fmax(std::exp(-0.5 * most_deviations * most_deviations), std::numeric_limits<double>::denorm_min());
  }
};

/// `signs` and `sums` are [cells]; sums are finite.
[[nodiscard]] inline SpreadEvidence spread_evidence(std::span<const std::int8_t> signs, std::span<const double> sums) {
  SpreadEvidence evidence;
  double largest = 0;  // scaled by it, so that no square overflows or is lost
  for (const double sum : sums) largest = std::fmax(largest, std::abs(sum));
  if (!(largest > 0)) return evidence;
  double total = 0, most = 0, energy = 0;
  for (std::size_t c = 0; c < sums.size(); ++c) {
    const double q = sums[c] / largest;
    total += static_cast<double>(signs[c]) * q;
    most += std::abs(q);
    energy += q * q;
    if (sums[c] != 0) ++evidence.cells;
  }
  evidence.deviations = total / std::sqrt(energy);
  evidence.most_deviations = most / std::sqrt(energy);
  // From 38.6 deviations on the bound is less than a double can say; a p-value of 0 does not exist.
  if (total > 0)
    evidence.p_value = std::fmax(std::exp(-0.5 * evidence.deviations * evidence.deviations),
                                 std::numeric_limits<double>::denorm_min());
  return evidence;
}

}  // namespace compmark
