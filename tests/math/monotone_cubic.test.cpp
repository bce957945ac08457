// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/monotone_cubic.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <type_traits>
#include <vector>

namespace {

using namespace compmark;

template <class T>
MonotoneCubic<T> curve(const std::vector<T>& x, const std::vector<T>& y) {
  return {std::span<const T>(x), std::span<const T>(y)};
}

}  // namespace

TEST_CASE("math/monotone_cubic: values and integrals of another program (SciPy 1.10.1, PchipInterpolator)") {
  // A plain, a valley, steps of other widths, and limits the wrong way round.
  const MonotoneCubic<double> steps = curve<double>({0, 1, 1.5, 4, 5, 6.25}, {0, 3, 3.1, 3.1, 2, 9});
  const std::array<std::array<double, 2>, 5> values = {{{0.3, 1.3418683544303796},
                                                        {1.2, 3.059807594936709},
                                                        {2.7, 3.1},
                                                        {4.4, 2.7127999999999997},
                                                        {6.1, 7.638922666666663}}};
  for (const std::array<double, 2>& point : values) {
    CAPTURE(point[0]);
    CHECK(steps.value(point[0]) == doctest::Approx(point[1]).epsilon(1e-14));
  }
  CHECK(steps.integral(0.2, 6.0) == doctest::Approx(17.308674664791376).epsilon(1e-14));
  CHECK(steps.integral(5.5, 1.1) == doctest::Approx(-12.760954392873886).epsilon(1e-14));
  const MonotoneCubic<double> knee = curve<double>({0, 1, 3}, {0, 0.1, 5});
  CHECK(knee.value(0.25) == doctest::Approx(0.007454298418972332).epsilon(1e-13));
  CHECK(knee.value(2.0) == doctest::Approx(1.5894104084321476).epsilon(1e-14));
  CHECK(knee.integral(0, 3) == doctest::Approx(3.8546881862099256).epsilon(1e-14));
  const MonotoneCubic<double> summit = curve<double>({0, 1, 2}, {0, 5, 0.1});
  CHECK(summit.value(0.25) == doctest::Approx(2.1804687499999997).epsilon(1e-14));
  CHECK(summit.integral(0, 2) == doctest::Approx(6.7).epsilon(1e-14));
  // The slope of the first three points is 6.5 here, which would overshoot (1.07 at 0.25): held at 3 times the secant.
  const MonotoneCubic<double> held = curve<double>({0, 1, 2}, {0, 1, -9});
  CHECK(held.value(0.25) == 0.578125);
  // Slopes whose product is no number of the scalar's.
  CHECK(curve<float>({0, 1, 2}, {0, 1e-23f, 2e-23f}).value(1.5f) == doctest::Approx(1.5e-23).epsilon(1e-5));
}

TEST_CASE("math/monotone_cubic: two points make a line, at any scalar, and it goes on outside") {
  const auto line = [](auto zero) {
    using T = decltype(zero);
    const MonotoneCubic<T> made = curve<T>({T(1), T(3)}, {T(-1), T(5)});
    const T least = std::is_same_v<T, float> ? T(1e-5) : T(1e-14);
    for (const T x : {T(-1), T(1), T(1.5), T(3), T(7)}) CHECK(std::abs(made.value(x) - (3 * x - 4)) <= least * 20);
    CHECK(std::abs(made.integral(T(1), T(3)) - T(4)) <= least * 10);
    CHECK(made.integral(T(2), T(2)) == T(0));
  };
  line(0.0f);
  line(0.0);
  line(0.0L);
}

TEST_CASE("math/monotone_cubic: it rises where its points rise, where one polynomial through them does not") {
  // Points that bend at once: the cubic of Lagrange falls between the last two.
  const std::vector<double> x = {0, 1, 2, 3}, y = {0, 0.01, 5, 5.1};
  const MonotoneCubic<double> made = curve(x, y);
  const auto lagrange = [&](double at) {
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      double term = y[i];
      for (std::size_t j = 0; j < 4; ++j) term *= i == j ? 1 : (at - x[j]) / (x[i] - x[j]);
      sum += term;
    }
    return sum;
  };
  bool rises = true, lagrange_rises = true;
  double sum = 0;
  constexpr int steps = 3000;
  for (int i = 0; i < steps; ++i) {
    const double a = 3.0 * i / steps, b = 3.0 * (i + 1) / steps;
    rises = rises && made.value(b) >= made.value(a);
    lagrange_rises = lagrange_rises && lagrange(b) >= lagrange(a);
    sum += made.value((a + b) / 2) * 3 / steps;
  }
  CHECK(rises);
  CHECK_FALSE(lagrange_rises);                                       // negative control
  CHECK(made.integral(0, 3) == doctest::Approx(sum).epsilon(1e-6));  // the midpoint rule: h^2 / 24 of the bend
  for (std::size_t i = 0; i < 4; ++i) CHECK(made.value(x[i]) == doctest::Approx(y[i]));
}
