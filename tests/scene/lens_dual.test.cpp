// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/lens_dual.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <initializer_list>

using namespace compmark;
using D = detail::Dual<double>;

namespace {

/// At (x, y) = (0.7, -0.3).
struct Place {
  D x{0.7, 1, 0}, y{-0.3, 0, 1};
};

void check(const D& d, double value, double dx, double dy) {
  CHECK(d.value == doctest::Approx(value).epsilon(1e-15));
  CHECK(d.dx == doctest::Approx(dx).epsilon(1e-14));
  CHECK(d.dy == doctest::Approx(dy).epsilon(1e-14));
}

}  // namespace

TEST_CASE("scene/lens_dual: each operation has its textbook derivative") {
  const auto [x, y] = Place{};
  check(x + y, 0.4, 1, 1);
  check(x - y, 1.0, 1, -1);
  check(x * y, -0.21, -0.3, 0.7);
  check(x / y, 0.7 / -0.3, 1 / -0.3, -0.7 / 0.09);
  check(y / x, -0.3 / 0.7, 0.3 / 0.49, 1 / 0.7);
  check(sqrt(x), std::sqrt(0.7), 0.5 / std::sqrt(0.7), 0);
  check(atan(y), std::atan(-0.3), 0, 1 / 1.09);
  check(D(2.5), 2.5, 0, 0);  // a constant moves with nothing
  check(D(2) * x + 1.0, 2.4, 2, 0);
}

TEST_CASE("scene/lens_dual: rules hold through compositions") {
  const auto [x, y] = Place{};
  // d sqrt(x^2 + y^2) = (x, y) / r.
  const double r = std::hypot(0.7, -0.3);
  check(sqrt(x * x + y * y), r, 0.7 / r, -0.3 / r);
  // d atan(y / x) = (-y, x) / r^2.
  check(atan(y / x), std::atan2(-0.3, 0.7), 0.3 / (r * r), 0.7 / (r * r));
  // The quotient rule is that of the product with the inverse; what cancels leaves a constant.
  const D a = x * x * y - D(3), b = D(2) + atan(x * y);
  const D quotient = a / b, product = a * (D(1) / b);
  check(quotient, product.value, product.dx, product.dy);
  const D one = (a * b) / (b * a);
  CHECK(one.value == doctest::Approx(1).epsilon(1e-15));
  CHECK(std::abs(one.dx) < 1e-15);
  CHECK(std::abs(one.dy) < 1e-15);
  // Against central differences, truncation h^2 times a third derivative of a few, rounding 1e-16 / h: 1e-9.
  const auto f = [](auto u, auto v) {
    using std::atan;
    using std::sqrt;
    using V = decltype(u);
    return atan(sqrt(u * u + v * v * V(2))) / (V(1) + u * v) - sqrt(V(1) + u) * v;
  };
  const D exact = f(x, y);
  constexpr double h = 1e-5;
  CHECK(exact.value == f(0.7, -0.3));
  CHECK(std::abs(exact.dx - (f(0.7 + h, -0.3) - f(0.7 - h, -0.3)) / (2 * h)) < 1e-9);
  CHECK(std::abs(exact.dy - (f(0.7, -0.3 + h) - f(0.7, -0.3 - h)) / (2 * h)) < 1e-9);
  CHECK(std::abs(exact.dx - exact.dy) > 0.1);  // the control: the two are not confused
}

TEST_CASE("scene/lens_dual: the value is that of the plain number, to the bit, and comparisons look at it alone") {
  for (const double v : {1e-300, 0.1, 3.0, 1e200}) {
    const D d(v, 5, -7);
    CHECK(sqrt(d).value == std::sqrt(v));
    CHECK(atan(d).value == std::atan(v));
    CHECK((d / D(3)).value == v / 3);
    CHECK(detail::value_of(d) == v);
    CHECK(detail::value_of(v) == v);
  }
  static_assert(detail::value_of(detail::Dual<float>(2.0f, 1.0f, 0.0f) * detail::Dual<float>(3.0f)) == 6.0f);
}
