// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Angles and polynomials of the fisheye family; round trips and Jacobians of all models are in lens.test.cpp.
#include "compmark/scene/lens_fisheye.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>

using namespace compmark;
using M = LensModel;

namespace {

constexpr double one_degree = std::numbers::pi / 180;

double relative(double a, long double b) {
  return static_cast<double>(std::abs((static_cast<long double>(a) - b) / b));
}

}  // namespace

TEST_CASE("scene/lens_fisheye: atan(r) / r and tan(t) / t to rounding, from the axis to the horizon") {
  double worst = 0;
  for (int i = 0; i <= 4000; ++i) {
    const double q = std::pow(10.0, -20 + 30.0 * i / 4000);
    const long double r = std::sqrt(static_cast<long double>(q));
    worst = std::fmax(worst, relative(detail::angle_ratio(q), std::atan(r) / r));
  }
  // On both sides of where the series ends.
  for (const double q : {0.0625, std::nextafter(0.0625, 0.0), 0.06, 0.065}) {
    const long double r = std::sqrt(static_cast<long double>(q));
    worst = std::fmax(worst, relative(detail::angle_ratio(q), std::atan(r) / r));
  }
  CHECK(worst < 4e-16);  // measured: 2.3e-16
  CHECK(detail::angle_ratio(0.0) == 1);
  CHECK(detail::tangent_ratio(0.0) == 1);
  worst = 0;
  for (int i = 0; i <= 4000; ++i) {
    const double theta = std::pow(10.0, -10 + 10.0 * i / 4000) * 1.5;
    // Below 1e-4 the series 1 + q / 3 leaves 2 q^2 / 15 = 1e-17 out.
    const double q = theta * theta;
    const long double t = std::sqrt(static_cast<long double>(q));
    worst = std::fmax(worst, relative(detail::tangent_ratio(q), std::tan(t) / t));
  }
  CHECK(worst < 1e-15);  // measured: 5.7e-16
  // The control: dividing by a radius whose square underflows.
  const double tiny = 1e-170 * 1e-170;
  CHECK(std::isnan(std::atan(std::sqrt(tiny)) / std::sqrt(tiny)));
  CHECK(detail::angle_ratio(tiny) == 1);
}

TEST_CASE("scene/lens_fisheye: on the equidistant plane the radius is the angle, in every direction") {
  for (const double theta :
       {1e-8, 0.01 * one_degree, 10 * one_degree, 45 * one_degree, 80 * one_degree, 89.9 * one_degree}) {
    for (int i = 0; i < 12; ++i) {
      const double phi = 30 * one_degree * i, r = std::tan(theta);
      const auto plane = detail::to_fisheye_plane(r * std::cos(phi), r * std::sin(phi));
      CHECK(std::hypot(plane[0], plane[1]) == doctest::Approx(theta).epsilon(1e-13));
      const double q = plane[0] * plane[0] + plane[1] * plane[1];
      // Back to the ray; at 89.9 degrees a rounding of the angle is a thousandfold one of the tangent.
      CHECK(plane[0] * detail::tangent_ratio(q) == doctest::Approx(r * std::cos(phi)).epsilon(1e-12));
    }
  }
}

TEST_CASE(
    "scene/lens_fisheye: Kannala and Brandt's polynomial of the angle, and the shorter models within the longer") {
  // theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) (OpenCV's fisheye model).
  const double k1 = -0.03, k2 = 0.004, k3 = -0.001, k4 = 0.0002;
  for (const double theta : {0.1, 0.7, 1.3}) {
    const auto at = [&](const Lens& lens) { return detail::bend_fisheye(lens, theta, 0.0)[0]; };
    const double t2 = theta * theta;
    CHECK(at({M::opencv_fisheye, {k1, k2, k3, k4}}) ==
          doctest::Approx(theta * (1 + k1 * t2 + k2 * std::pow(t2, 2) + k3 * std::pow(t2, 3) + k4 * std::pow(t2, 4)))
              .epsilon(1e-14));
    CHECK(at({M::opencv_fisheye, {k1}}) == at({M::simple_radial_fisheye, {k1}}));
    CHECK(at({M::opencv_fisheye, {k1, k2}}) == at({M::radial_fisheye, {k1, k2}}));
    // Thin prisms keep k3 and k4 behind the tangential pair, and have none of the rest on this axis with zeros there.
    CHECK(at({M::thin_prism_fisheye, {k1, k2, 0, 0, k3, k4}}) ==
          doctest::Approx(at({M::opencv_fisheye, {k1, k2, k3, k4}})).epsilon(1e-15));
    CHECK(at({M::rad_tan_thin_prism_fisheye, {k1, k2, k3, k4}}) ==
          doctest::Approx(at({M::opencv_fisheye, {k1, k2, k3, k4}})).epsilon(1e-15));
    CHECK(at({M::fisheye, {}}) == theta);
    CHECK(at({M::simple_fisheye, {}}) == theta);
    // The control: the order of the coefficients matters.
    CHECK(std::abs(at({M::opencv_fisheye, {k2, k1, k3, k4}}) - at({M::opencv_fisheye, {k1, k2, k3, k4}})) > 1e-5);
  }
}

TEST_CASE("scene/lens_fisheye: radial models turn with the image, tangential and prism terms do not") {
  const auto turned = [](const Lens& lens) {
    double worst = 0;
    for (int i = 1; i < 12; ++i) {
      const double c = std::cos(30 * one_degree * i), s = std::sin(30 * one_degree * i), u = 0.5, v = 0.2;
      const auto first = detail::bend_fisheye(lens, u, v),
                 second = detail::bend_fisheye(lens, c * u - s * v, s * u + c * v);
      worst = std::fmax(worst,
                        std::hypot(c * first[0] - s * first[1] - second[0], s * first[0] + c * first[1] - second[1]));
    }
    return worst;
  };
  CHECK(turned({M::opencv_fisheye, {-0.03, 0.004, -0.001, 0.0002}}) < 1e-15);
  CHECK(turned({M::rad_tan_thin_prism_fisheye, {-0.02, 0.09, -0.06, 0.003, 0.005, -0.001}}) < 1e-15);
  for (std::size_t i : {2u, 3u, 6u, 7u}) {
    Lens prism{M::thin_prism_fisheye, {-0.03, 0.004}};
    prism.parameters[i] = 0.01;
    CHECK(turned(prism) > 1e-3);
  }
  for (std::size_t i = 6; i < 12; ++i) {
    Lens prism{M::rad_tan_thin_prism_fisheye, {-0.02, 0.09}};
    prism.parameters[i] = 0.01;
    CHECK(turned(prism) > 1e-4);
  }
  // Project Aria's order: p0 belongs to x (its own axis counts three times), p1 to y; s0 s1 move along x, s2 s3 along
  // y.
  const auto at = [](std::size_t i) {
    Lens lens{M::rad_tan_thin_prism_fisheye, {}};
    lens.parameters[i] = 0.01;
    const auto d = detail::bend_fisheye(lens, 0.5, 0.0);
    return std::array<double, 2>{(d[0] - 0.5) / 0.01, d[1] / 0.01};
  };
  CHECK(at(6)[0] == doctest::Approx(3 * 0.25));
  CHECK(at(6)[1] == doctest::Approx(0));
  CHECK(at(7)[0] == doctest::Approx(0));
  CHECK(at(7)[1] == doctest::Approx(0.25));
  CHECK(at(8)[0] == doctest::Approx(0.25));
  CHECK(at(9)[0] == doctest::Approx(0.0625));
  CHECK(at(10)[1] == doctest::Approx(0.25));
  CHECK(at(11)[1] == doctest::Approx(0.0625));
}
