// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The three lenses with a formula back, against what their papers say of them; round trips and Jacobians of all models
// are in lens.test.cpp.
#include "compmark/scene/lens_closed.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>

using namespace compmark;
using M = LensModel;

namespace {

constexpr double pi = std::numbers::pi;

double radius(const Lens& lens, double ray) {
  const auto d = detail::distort_closed(lens, 0.6 * ray, 0.8 * ray);
  CHECK(d[0] * 0.8 == doctest::Approx(d[1] * 0.6).epsilon(1e-14));  // the direction is kept
  return std::hypot(d[0], d[1]);
}
/// Radius of the ray that lands at this radius; -1 for none.
double back(const Lens& lens, double distorted) {
  const auto ray = detail::undistort_closed(lens, -0.8 * distorted, 0.6 * distorted);
  return ray ? std::hypot((*ray)[0], (*ray)[1]) : -1;
}

}  // namespace

TEST_CASE(
    "scene/lens_closed: in the FOV model angles are radii, and the field of view is omega (Devernay, Faugeras 2001)") {
  for (const double omega : {0.3, 0.9, 1.5, 3.0, -0.9}) {
    CAPTURE(omega);
    const Lens lens{M::fov, {omega}};
    // r_d = atan(2 r_u tan(omega / 2)) / omega, and its inverse r_u = tan(r_d omega) / (2 tan(omega / 2)).
    for (const double ray : {1e-6, 0.01, 0.2, 1.0, 5.0}) {
      const double landed = std::atan(2 * ray * std::tan(omega / 2)) / omega;
      CHECK(radius(lens, ray) == doctest::Approx(landed).epsilon(1e-13));
      CHECK(back(lens, landed) == doctest::Approx(ray).epsilon(1e-12));
    }
    // The ray at 1/2 lands at 1/2: the model's definition of omega.
    CHECK(radius(lens, 0.5) == doctest::Approx(0.5).epsilon(1e-14));
    // The direction of 90 degrees is the end: beyond the radius pi / (2 omega) there is no ray.
    const double edge = pi / (2 * std::abs(omega));
    CHECK(back(lens, 0.999 * edge) > 100 * std::abs(1 / std::tan(omega / 2)));
    CHECK(back(lens, 1.001 * edge) == -1);
  }
  const Lens none{M::fov, {0.0}};
  CHECK(radius(none, 0.7) == doctest::Approx(0.7).epsilon(1e-15));
  CHECK(back(none, 0.7) == doctest::Approx(0.7).epsilon(1e-15));
}

TEST_CASE(
    "scene/lens_closed: the division model is rational back, and its root is the one near the axis (Fitzgibbon 2001)") {
  for (const double k : {-0.3, -0.01, 0.05, 0.2}) {
    CAPTURE(k);
    for (const M model : {M::simple_division, M::division}) {
      const Lens lens{model, {k}};
      for (const double landed : {0.01, 0.3, 0.9, 1.4}) {
        if (1 + k * landed * landed <= 0.01 || k * landed * landed > 1) continue;
        const double ray = landed / (1 + k * landed * landed);
        CHECK(back(lens, landed) == doctest::Approx(ray).epsilon(1e-14));
        CHECK(radius(lens, ray) == doctest::Approx(landed).epsilon(1e-12));
        // k r_u r_d^2 - r_d + r_u = 0 has another root, 1 / (k r_d): it is not the lens.
        const double other = 1 / (k * landed);
        CHECK(k * ray * other * other - other + ray == doctest::Approx(0).epsilon(1e-9));
        CHECK(std::abs(radius(lens, ray) - other) > 1e-3);
      }
    }
  }
  // Barrel: at r_d = 1 / sqrt(-k) the ray is at 90 degrees. Pincushion: rays end at 1 / (2 sqrt(k)), which lands at 1 /
  // sqrt(k).
  CHECK(back({M::division, {-0.25}}, 2.001) == -1);
  CHECK(back({M::division, {-0.25}}, 1.999) > 500);
  CHECK(detail::closed_limit({M::division, {-0.25}}) == std::numeric_limits<double>::infinity());
  CHECK(detail::closed_limit({M::division, {0.25}}) == 1);
  CHECK(radius({M::division, {0.25}}, 1) == doctest::Approx(2).epsilon(1e-14));
  CHECK(std::isnan(detail::distort_closed(Lens{M::division, {0.25}}, 1.001, 0.0)[0]));
  CHECK(back({M::division, {0.25}}, 2.001) == -1);
}

TEST_CASE(
    "scene/lens_closed: EUCM holds the pinhole, the stereographic and the orthographic projection (Khomutenko 2016)") {
  for (const double theta : {1e-4, 0.1, 0.7, 1.2, 1.55}) {
    CAPTURE(theta);
    const double ray = std::tan(theta);
    CHECK(radius({M::eucm, {0, 2.5}}, ray) == doctest::Approx(ray).epsilon(1e-13));
    CHECK(radius({M::eucm, {0.5, 1}}, ray) == doctest::Approx(2 * std::tan(theta / 2)).epsilon(1e-13));
    CHECK(radius({M::eucm, {1, 1}}, ray) == doctest::Approx(std::sin(theta)).epsilon(1e-13));
    // The control: no other alpha of the family is equidistant at these angles.
    CHECK(std::abs(radius({M::eucm, {0.5, 1}}, 1.0) - pi / 4) > 0.04);
    for (const double alpha : {0.2, 0.5, 0.7, 1.0}) {
      for (const double beta : {0.6, 1.0, 1.7}) {
        const Lens lens{M::eucm, {alpha, beta}};
        const double landed = radius(lens, ray);
        // m_z = (1 - beta alpha^2 r^2) / (alpha sqrt(1 - (2 alpha - 1) beta r^2) + 1 - alpha), the paper's
        // unprojection. Near 90 degrees the ray is a quotient of two small numbers.
        const double q = landed * landed;
        const double root = std::sqrt(std::fmax(0.0, 1 - (2 * alpha - 1) * beta * q));
        const double m = (1 - beta * alpha * alpha * q) / (alpha * root + 1 - alpha);
        CHECK(landed / m == doctest::Approx(ray).epsilon(1e-9));
        CHECK(back(lens, landed) == doctest::Approx(ray).epsilon(1e-9));
      }
    }
  }
  // Above alpha = 1/2 the image ends at 1 / sqrt((2 alpha - 1) beta); below, beyond 1 / (alpha sqrt(beta)) rays come
  // from behind.
  CHECK(back({M::eucm, {0.7, 1}}, 1.001 / std::sqrt(0.4)) == -1);
  CHECK(back({M::eucm, {0.5, 1}}, 1.999) > 500);
  CHECK(back({M::eucm, {0.5, 1}}, 2.001) == -1);
}

TEST_CASE("scene/lens_closed: which models have a formula") {
  for (int model = 0; model < static_cast<int>(lens_model_count); ++model) {
    CHECK(detail::has_closed_inverse(static_cast<M>(model)) ==
          (model == 7 || model == 12 || model == 13 || model == 16));
  }
}
