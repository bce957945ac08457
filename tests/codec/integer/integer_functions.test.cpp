// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/integer/integer_functions.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

TEST_CASE("integer/integer_functions: shifts round to the nearest, halves up, on both sides of zero") {
  CHECK(round_shift(5, 1) == 3);
  CHECK(round_shift(-5, 1) == -2);
  CHECK(round_shift(4, 2) == 1);
  CHECK(round_shift(-6, 2) == -1);
  CHECK(round_shift(-7, 2) == -2);
  CHECK(round_shift(7, 0) == 7);
  CHECK(round_shift(-7, -3) == -56);
}

TEST_CASE("integer/integer_functions: the numbers of the specification do not change") {
  CHECK(step_table_hash() == 0xDDF35BE91EDE97AEull);
}

TEST_CASE("integer/integer_functions: steps, reciprocals and borders are those of long double") {
  std::int64_t worst_border = 0;
  for (int index = StepGrid::least; index <= StepGrid::greatest; ++index) {
    const long double ratio = std::exp2(index / 16.0L);
    CHECK(std::abs(static_cast<long double>(step_ratio(index)) - ratio * 0x1p24L) <= 0.51L);
    CHECK(std::abs(static_cast<long double>(step_reciprocal(index)) - 0x1p24L / ratio) <=
          0.51L + 1e-9L * 0x1p24L / ratio);
    if (index == StepGrid::least) continue;
    const long double y = std::exp2((2 * index - 1) / 32.0L);
    const auto border = static_cast<std::int64_t>(std::llround(0.5L * std::log(y / (2 - y)) * 0x1p16L));
    worst_border = std::max(
        worst_border,
        std::abs(border - detail::step_tables.threshold[static_cast<std::size_t>(index - StepGrid::least - 1)]));
  }
  CHECK(worst_border == 0);
}

TEST_CASE("integer/integer_functions: the step of r is 16 log2(1 + tanh r), rounded and held") {
  for (std::int32_t r = -5 << 16; r <= 5 << 16; r += 97) {
    const long double exact = 16 * std::log2(1 + std::tanh(static_cast<long double>(r) / 65536));
    const int index = step_index(r);
    if (exact <= StepGrid::least) {
      REQUIRE(index == StepGrid::least);
    } else {
      REQUIRE(std::abs(exact - index) <= 0.5L + 1e-3L);  // r itself is rounded to 2^-16
    }
  }
  CHECK(step_index(0) == 0);
  CHECK(step_index(2147483647) == StepGrid::greatest);
  CHECK(step_index(-2147483647 - 1) == StepGrid::least);
}

TEST_CASE("integer/integer_functions: a value rounds back to its symbol, at every step, up to the greatest symbol") {
  const Random random(1, 0, random_stage("integer functions"));
  for (int index = StepGrid::least; index <= StepGrid::greatest; ++index) {
    for (const double base : {1.0, 0.001, 0.2}) {
      for (std::uint64_t i = 0; i < 60; ++i) {
        const int bits = static_cast<int>(i % 24);
        auto symbol =
            static_cast<std::int32_t>(random.bits(i) >> (63 - bits) & ((1u << bits) - 1)) * (i % 2 == 0 ? 1 : -1);
        if (i == 58) symbol = greatest_symbol;
        if (i == 59) symbol = -greatest_symbol;
        const double q = static_cast<double>(step_ratio(index)) * (base * 0x1p-24);
        REQUIRE(std::nearbyint(static_cast<double>(symbol_value(symbol, index, base)) / q) == symbol);
      }
    }
  }
  // Control: some 25-bit symbols do not come back, which is why there is a greatest one.
  int lost = 0;
  for (std::int32_t symbol = (1 << 25) - 999; symbol < 1 << 25; symbol += 2) {
    lost += std::nearbyint(static_cast<double>(symbol_value(symbol, 0, 1.0))) == symbol ? 0 : 1;
  }
  CHECK(lost > 0);
}

}  // namespace
