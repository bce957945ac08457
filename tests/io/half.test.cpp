// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/io/half.hpp>
#include <cstdint>
#include <limits>

using namespace compmark;

TEST_CASE("io/half: each of the 65,536 numbers is what IEEE 754 says, and comes back from float") {
  for (std::uint32_t half = 0; half < 65'536; ++half) {
    const auto bits = static_cast<std::uint16_t>(half);
    const int exponent = bits >> 10 & 31, mantissa = bits & 1023;
    const float value = detail::half_to_float(bits);
    if (exponent == 31) {
      REQUIRE((mantissa == 0 ? std::isinf(value) : std::isnan(value)));
      REQUIRE(std::signbit(value) == (bits >> 15 != 0));
      continue;
    }
    const float magnitude = exponent == 0 ? std::ldexp(static_cast<float>(mantissa), -24)
                                          : std::ldexp(static_cast<float>(1024 + mantissa), exponent - 25);
    REQUIRE(value == (bits >> 15 != 0 ? -magnitude : magnitude));
    REQUIRE(detail::float_to_half(value) == bits);
  }
}

TEST_CASE("io/half: floats round to the nearest half, ties to even, and overflow to infinity") {
  const Random random(1, 0, random_stage("sections"));
  for (std::uint64_t i = 0; i < 20'000; ++i) {
    const auto value = static_cast<float>(random.normal(i) * std::exp2(20 * random.normal(i + (1u << 20))));
    const float back = detail::half_to_float(detail::float_to_half(value));
    if (std::abs(value) >= 65520) {
      REQUIRE(std::isinf(back));
    } else {
      REQUIRE(std::abs(back - value) <= std::max(std::abs(value) * 0x1p-11f, 0x1p-25f));
    }
  }
  CHECK(detail::float_to_half(0x1.002p0f) == 0x3C00);  // a tie goes to even
  CHECK(detail::float_to_half(0x1.006p0f) == 0x3C02);
  CHECK(detail::float_to_half(65519.0f) == 0x7BFF);
  CHECK(detail::float_to_half(-std::numeric_limits<float>::infinity()) == 0xFC00);
}
