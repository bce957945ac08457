// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/math/binomial.hpp>
#include <vector>

using namespace compmark;

namespace {

/// The tail by Pascal's triangle in long double: positive terms only, so its error is ~n roundings of 2^-64.
long double pascal_tail(std::size_t k, std::size_t n, long double p) {
  std::vector<long double> row(n + 2, 0);
  row[0] = 1;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j > 0; --j) row[j] = row[j] * (1 - p) + row[j - 1] * p;
    row[0] *= 1 - p;
  }
  long double sum = 0;
  for (std::size_t j = n; j + 1 > k; --j) {
    sum += row[j];
    if (j == 0) break;
  }
  return sum;
}

}  // namespace

TEST_CASE("math/binomial: the fair coin is exact") {
  CHECK(binomial_tail(48, 48) == std::ldexp(1.0, -48));
  CHECK(binomial_tail(47, 48) == std::ldexp(49.0, -48));
  CHECK(binomial_tail(46, 48) == std::ldexp(1177.0, -48));
  CHECK(binomial_tail(64, 64) == std::ldexp(1.0, -64));  // 5.4e-20
  CHECK(binomial_tail(63, 64) == std::ldexp(65.0, -64));
  CHECK(binomial_tail(128, 128) == std::ldexp(1.0, -128));
  CHECK(binomial_tail(127, 128) == std::ldexp(129.0, -128));
  CHECK(binomial_tail(1, 128) == 1);  // 1 - 2^-128, rounded
  CHECK(binomial_tail(1, 3) == 0.875);
  CHECK(binomial_tail(2, 3) == 0.5);
  CHECK(binomial_tail(0, 5) == 1);
  CHECK(binomial_tail(6, 5) == 0);
  for (const std::size_t n : {7u, 48u, 64u, 65u, 127u, 128u}) {
    for (std::size_t k = 1; k <= n; ++k) {
      const double expected = static_cast<double>(pascal_tail(k, n, 0.5L));
      CHECK(std::abs(binomial_tail(k, n) / expected - 1) < 3e-16);
      CHECK(std::abs(binomial_tail(k, n) + binomial_tail(n - k + 1, n) - 1) < 3e-16);  // symmetry
    }
  }
}

TEST_CASE("math/binomial: control, 1 - CDF in double loses the small tails") {
  double cdf = 0, term = std::ldexp(1.0, -64);  // C(64, i) / 2^64 from i = 0 upwards
  for (std::size_t i = 0; i < 63; ++i) {
    cdf += term;
    term *= static_cast<double>(64 - i) / static_cast<double>(i + 1);
  }
  const double naive = 1 - cdf, exact = binomial_tail(63, 64);  // 3.5e-18
  CHECK(std::abs(exact * 0x1p64 / 65 - 1) < 3e-16);
  CHECK(std::abs(naive / exact - 1) > 0.5);
}

TEST_CASE("math/binomial: any probability, against Pascal's triangle") {
  double worst = 0;
  for (const double p : {0.001, 0.05, 0.3, 0.5, 0.9, 0.999}) {
    for (const std::size_t n : {1u, 10u, 48u, 200u}) {
      for (std::size_t k = 0; k <= n + 1; ++k) {
        const double expected = static_cast<double>(pascal_tail(k, n, p));
        if (expected < 1e-250) continue;
        worst = std::fmax(worst, std::abs(binomial_tail(k, n, p) / expected - 1));
      }
    }
  }
  CHECK(worst < 2e-12);  // measured 2.6e-13
  CHECK(binomial_tail(3, 5, 0.0) == 0);
  CHECK(binomial_tail(3, 5, 1.0) == 1);
  CHECK(binomial_tail(2000, 1000, 0.5) == 0);
  CHECK(binomial_tail(5000, 5000) > 0);  // 2^-5000: not a double, but not 0 either
}

TEST_CASE("math/binomial: Clopper and Pearson") {
  // Closed forms: no hit, 1 - (rare)^(1/n); all hits, the mirror image.
  for (const std::size_t n : {10u, 1000u, 100000u}) {
    const Interval none = clopper_pearson(0, n, 0.95);
    CHECK(none.low == 0);
    CHECK(none.high == doctest::Approx(1 - std::pow(0.025, 1.0 / static_cast<double>(n))).epsilon(1e-9));
    CHECK(clopper_pearson(n, n, 0.95).low == doctest::Approx(1 - none.high).epsilon(1e-9));
  }
  // Definition: at each limit the tail has half of what the confidence leaves.
  for (const std::size_t hits : {1u, 7u, 100u, 118u}) {
    const Interval interval = clopper_pearson(hits, 10000);
    CHECK(binomial_tail(hits, 10000, interval.low) == doctest::Approx(0.005).epsilon(1e-6));
    CHECK(1 - binomial_tail(hits + 1, 10000, interval.high) == doctest::Approx(0.005).epsilon(1e-6));
    CHECK(interval.contains(static_cast<double>(hits) / 10000));
  }
  // A published example: 10 of 100, 95 %: 0.0490 to 0.1762.
  CHECK(clopper_pearson(10, 100, 0.95).low == doctest::Approx(0.0490).epsilon(1e-3));
  CHECK(clopper_pearson(10, 100, 0.95).high == doctest::Approx(0.1762).epsilon(1e-3));
}
