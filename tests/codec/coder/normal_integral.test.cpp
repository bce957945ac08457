// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/coder/normal_integral.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace {

using namespace compmark;

long double reference(long double z) { return 0.5L * std::erfc(-z / std::numbers::sqrt2_v<long double>); }

}  // namespace

TEST_CASE(
    "coder/normal_integral: Phi in whole numbers within 2^-44 of long double, rising, and symmetrical to the last "
    "bit") {
  const NormalIntegral phi;
  long double worst = 0;
  std::int64_t before = 0;
  constexpr std::int64_t step = NormalIntegral::one / 997;  // no node but 0 is hit
  for (std::int64_t z = -7 * NormalIntegral::one; z < 7 * NormalIntegral::one; z += step) {
    const std::int64_t value = phi(z);
    const long double error = std::abs(std::ldexp(static_cast<long double>(value), -NormalIntegral::bits) -
                                       reference(std::ldexp(static_cast<long double>(z), -NormalIntegral::bits)));
    if (std::abs(z) < 6 * NormalIntegral::one) worst = std::max(worst, error);
    REQUIRE(value >= before);
    REQUIRE(value + phi(-z) == NormalIntegral::one);
    before = value;
  }
  CHECK(worst < 0x1p-44L);  // 2^-44.6
  CHECK(phi(0) == NormalIntegral::one / 2);
  CHECK(phi(6 * NormalIntegral::one) == NormalIntegral::one);
  CHECK(phi(6 * NormalIntegral::one - 1) < NormalIntegral::one);
  CHECK(phi(-6 * NormalIntegral::one) == 0);
}
