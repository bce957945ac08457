// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/random.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>

using namespace compmark;

TEST_CASE("core/random: mix_bits is SplitMix64 (first outputs of the published generator seeded with 0)") {
  constexpr std::uint64_t gamma =
      0x9E3779B97F4A7C15ull;  // the generator's increment; state k * gamma gives output k + 1
  CHECK(mix_bits(0 * gamma) == 0xE220A8397B1DCDAFull);
  CHECK(mix_bits(1 * gamma) == 0x6E789E6AA1B965F4ull);
  CHECK(mix_bits(2 * gamma) == 0x06C45D188009454Full);
}

TEST_CASE("core/random: a pure function of seed, iteration, stage and index") {
  constexpr Random a(1, 2, random_stage("a"));
  static_assert(a.bits(3) == Random(1, 2, random_stage("a")).bits(3), "usable in constant expressions");
  std::set<std::uint64_t> seen;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    for (std::uint64_t iteration = 0; iteration < 4; ++iteration) {
      for (const std::uint64_t stage : {random_stage("a"), random_stage("b")}) {
        for (std::uint64_t index = 0; index < 64; ++index) seen.insert(Random(seed, iteration, stage).bits(index));
      }
    }
  }
  CHECK(seen.size() == 4 * 4 * 2 * 64);
}

TEST_CASE("core/random: uniform is open, its mean and variance are those of U(0, 1)") {
  const Random random(5, 0, random_stage("test"));
  constexpr std::uint64_t n = 200000;
  double sum = 0;
  double squares = 0;
  double smallest = 1;
  double largest = 0;
  for (std::uint64_t i = 0; i < n; ++i) {
    const double u = random.uniform(i);
    sum += u;
    squares += u * u;
    smallest = std::min(smallest, u);
    largest = std::max(largest, u);
  }
  CHECK(smallest > 0.0);
  CHECK(largest < 1.0);
  // five standard errors: 5 sqrt(1/12/n) = 3.2e-3 for the mean, 5 sqrt(4/45/n) = 3.3e-3 for the second moment
  CHECK(std::abs(sum / n - 0.5) < 3.3e-3);
  CHECK(std::abs(squares / n - 1.0 / 3.0) < 3.4e-3);
}

TEST_CASE("core/random: below covers its range evenly and never reaches n") {
  const Random random(6, 1, random_stage("test"));
  constexpr std::uint64_t n = 7;
  constexpr std::uint64_t draws = 70000;
  std::array<std::uint64_t, n> counts{};
  for (std::uint64_t i = 0; i < draws; ++i) {
    const std::uint64_t value = random.below(i, n);
    REQUIRE(value < n);
    ++counts[value];
  }
  double chi2 = 0;
  for (const std::uint64_t count : counts) {
    const double expected = static_cast<double>(draws) / static_cast<double>(n);
    chi2 += (static_cast<double>(count) - expected) * (static_cast<double>(count) - expected) / expected;
  }
  CHECK(chi2 < 22.5);  // 0.999 quantile of chi-square with 6 degrees of freedom
}

TEST_CASE("core/random: centered is inside (-1/2, 1/2) and symmetric around zero") {
  const Random random(7, 0, random_stage("test"));
  constexpr std::uint64_t n = 100000;
  double sum = 0;
  for (std::uint64_t i = 0; i < n; ++i) {
    const float value = random.centered(i);
    REQUIRE(value > -0.5f);
    REQUIRE(value < 0.5f);
    sum += static_cast<double>(value);
  }
  CHECK(std::abs(sum / n) < 4.6e-3);  // five standard errors
}

TEST_CASE("core/random: normal has mean 0, variance 1 and the normal's tail") {
  const Random random(8, 0, random_stage("test"));
  constexpr std::uint64_t n = 200000;
  double sum = 0;
  double squares = 0;
  std::uint64_t beyond = 0;
  for (std::uint64_t i = 0; i < n; ++i) {
    const double z = random.normal(i);
    sum += z;
    squares += z * z;
    if (std::abs(z) > 1.959963985) ++beyond;
  }
  CHECK(std::abs(sum / n) < 1.2e-2);                                 // five standard errors
  CHECK(std::abs(squares / n - 1) < 1.6e-2);                         // five standard errors, sqrt(2/n) each
  CHECK(std::abs(static_cast<double>(beyond) / n - 0.05) < 2.5e-3);  // five standard errors
}
