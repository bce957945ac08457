// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Tails of the binomial distribution. The fair coin, on which the evidence of a watermark rests, is summed in whole
// numbers up to 128 tosses: the result is the true probability rounded once, also where it is 1e-38
// (docs/spec/watermark.md, 5); 1 - CDF in double is lost from 1e-16 on. Other probabilities are summed from the tail's
// largest term outwards, all terms positive (relative error ~1e-12 below 1000 tosses, 1e-9 at a million), and give the
// exact interval of Clopper and Pearson. Cost: O(n) for the coin, some standard deviations of terms for the rest.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <numeric>

#include "compmark/core/config.hpp"

namespace compmark {

namespace detail {

/// log(n!), without std::lgamma, whose glibc version writes a global. Stirling's series leaves 1/(1680 n^7), 2e-14 at
/// 32.
[[nodiscard]] inline double log_factorial(std::size_t n) {
  const double x = static_cast<double>(n);
  if (n <= 32) {
    double product = 1;
    for (std::size_t i = 2; i <= n; ++i) product *= static_cast<double>(i);
    return std::log(product);
  }
  const double inverse = 1 / x, square = inverse * inverse;
  return x * std::log(x) - x + 0.5 * std::log(2 * std::numbers::pi * x) +
         inverse * (1.0 / 12 - square * (1.0 / 360 - square / 1260));
}

/// P(M = k), M ~ Binomial(n, p), 0 < p < 1.
[[nodiscard]] inline double binomial_term(std::size_t k, std::size_t n, double p) {
  const double ways = log_factorial(n) - log_factorial(k) - log_factorial(n - k);
  return std::exp(ways + static_cast<double>(k) * std::log(p) + static_cast<double>(n - k) * std::log1p(-p));
}

}  // namespace detail

/// P(M >= k), M ~ Binomial(n, p).
[[nodiscard]] inline double binomial_tail(std::size_t k, std::size_t n, double p) {
  COMPMARK_ASSERT(p >= 0 && p <= 1, "binomial_tail: p is a probability");
  if (k == 0) return 1;
  if (k > n || p == 0) return 0;
  if (p == 1) return 1;
  const bool upper = static_cast<double>(k) > static_cast<double>(n) * p;
  std::size_t i = upper ? k : k - 1;
  double term = detail::binomial_term(i, n, p), sum = 0;
  const double odds = upper ? p / (1 - p) : (1 - p) / p;
  while (term > 0) {
    const double before = sum;
    sum += term;
    if (sum == before || i == (upper ? n : 0)) break;
    term *= odds * (upper ? static_cast<double>(n - i) / static_cast<double>(i + 1)
                          : static_cast<double>(i) / static_cast<double>(n - i + 1));
    i = upper ? i + 1 : i - 1;
  }
  return upper ? std::fmin(sum, 1) : std::fmax(1 - sum, 0);
}

/// P(M >= k), M ~ Binomial(n, 1/2): exact, rounded once, for n <= 128. Never 0 for k <= n: a p-value of 0 does not
/// exist.
[[nodiscard]] inline double binomial_tail(std::size_t k, std::size_t n) {
  if (k == 0) return 1;
  if (k > n) return 0;
  if (n > 128) return std::fmax(binomial_tail(k, n, 0.5), std::numeric_limits<double>::denorm_min());
  __extension__ using Wide = unsigned __int128;
  Wide ways = 1, sum = 1;  // C(n, n), and the tail down to k >= 1: below 2^128
  for (std::size_t i = n; i > k; --i) {
    const std::size_t up = i, down = n - i + 1, common = std::gcd(up, down);
    ways = ways / (down / common) * (up / common);  // C(n, i - 1) = C(n, i) i / (n - i + 1), divided first: no overflow
    sum += ways;
  }
  return std::ldexp(static_cast<double>(sum), -static_cast<int>(n));
}

/// Limits of a probability that has been estimated from counts.
struct Interval {
  double low = 0;
  double high = 1;
  [[nodiscard]] bool contains(double p) const { return low <= p && p <= high; }
};

/// Exact interval of Clopper and Pearson (1934): outside it, so few or so many hits have a probability below (1 -
/// confidence) / 2.
[[nodiscard]] inline Interval clopper_pearson(std::size_t hits, std::size_t trials, double confidence = 0.99) {
  COMPMARK_ASSERT(hits <= trials && confidence > 0 && confidence < 1, "clopper_pearson: hits <= trials");
  const double rare = (1 - confidence) / 2;
  const auto lower = [&](std::size_t k) {  // the p at which P(M >= k) is `rare`; the tail grows with p
    if (k == 0) return 0.0;
    double low = 0, high = 1;
    for (int step = 0; step < 60; ++step) {
      const double middle = 0.5 * (low + high);
      (binomial_tail(k, trials, middle) < rare ? low : high) = middle;
    }
    return low;
  };
  return {lower(hits), 1 - lower(trials - hits)};
}

}  // namespace compmark
