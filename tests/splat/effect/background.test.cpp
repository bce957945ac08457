// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/effect/background.hpp"

#include <doctest/doctest.h>

#include <cmath>

namespace {
using namespace compmark;
static_assert(Background<RandomBackground> && Background<ConstantBackground> && !present<ConstantBackground>);
}  // namespace

TEST_CASE("effect/background: a function of seed and iteration, uniform in the cube") {
  CHECK(RandomBackground::color(7, 100) == RandomBackground::color(7, 100));
  CHECK(RandomBackground::color(7, 100) != RandomBackground::color(8, 100));
  CHECK(RandomBackground::color(7, 100) != RandomBackground::color(7, 101));
  double mean = 0, square = 0, product = 0;
  const int n = 4000;
  for (int t = 0; t < n; ++t) {
    const auto c = RandomBackground::color(1, static_cast<std::uint64_t>(t));
    for (const double x : c) {
      CHECK((x >= 0 && x <= 1));
      mean += x / (3 * n);
      square += x * x / (3 * n);
    }
    product += c[0] * c[1] / n;
  }
  // Standard errors: 0.0026 of the mean, 0.0027 of the square, 0.0035 of the product; five of them.
  CHECK(std::abs(mean - 1.0 / 2) < 0.013);
  CHECK(std::abs(square - 1.0 / 3) < 0.014);
  CHECK(std::abs(product - 1.0 / 4) < 0.018);
}
