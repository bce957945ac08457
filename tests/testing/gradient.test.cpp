// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/testing/gradient.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <string>

using compmark::testing::gradient_law;

TEST_CASE("testing/gradient: accepts a right gradient, names the entry of a wrong one") {
  std::array<double, 3> x{0.3, -2.0, 50.0};
  const auto loss = [&] { return std::sin(x[0]) * x[1] * x[1] + std::exp(0.02 * x[2]); };
  std::array<double, 3> gradient{std::cos(x[0]) * x[1] * x[1], 2 * std::sin(x[0]) * x[1], 0.02 * std::exp(0.02 * x[2])};
  const std::string broken = gradient_law(loss, x, gradient, 1e-9);
  CHECK_MESSAGE(broken.empty(), broken);
  CHECK(x[0] == 0.3);  // restored

  gradient[1] *= 1 + 1e-5;
  CHECK(gradient_law(loss, x, gradient, 1e-6).find("entry 1") != std::string::npos);
  gradient[1] = std::nan("");
  CHECK_FALSE(gradient_law(loss, x, gradient).empty());
}
