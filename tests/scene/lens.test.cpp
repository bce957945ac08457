// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/lens.hpp>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

using namespace compmark;
using M = LensModel;

namespace {

/// A camera of 1000 x 750 pixels with its principal point off the centre, and every model with lenses of the strength that phones,
/// action cameras and headsets have.
Camera<double> test_camera() {
  Camera<double> camera;
  camera.width = 1000;
  camera.height = 750;
  camera.fx = 640;
  camera.fy = 650;
  camera.cx = 510;
  camera.cy = 360;
  return camera;
}

std::vector<Lens> all_lenses() {
  return {{M::simple_pinhole, {}},
          {M::pinhole, {}},
          {M::simple_radial, {0.05}},
          {M::simple_radial, {-0.1}},
          {M::radial, {0.1, -0.03}},
          {M::opencv, {0.0578421, -0.0805099, -0.000980296, 0.00015575}},
          {M::opencv, {-0.2, 0.06, 0.002, -0.003}},
          {M::opencv_fisheye, {-0.03, 0.004, -0.001, 0.0002}},
          {M::full_opencv, {-0.2, 0.1, 0.001, 0.002, -0.02, 0.02, 0.01, 0.001}},
          {M::fov, {0.9}},
          {M::fov, {1e-9}},
          {M::fov, {0.0}},
          {M::simple_radial_fisheye, {0.02}},
          {M::radial_fisheye, {-0.02, 0.003}},
          {M::thin_prism_fisheye, {0.01, -0.002, 0.001, -0.0005, 0.0003, 0.0001, 0.002, -0.001}},
          {M::rad_tan_thin_prism_fisheye,
           {-0.0232, 0.0924, -0.0591, 0.003, 0.0048, -0.0009, 0.0002, 0.0005, -0.0009, -0.0001, 0.00007, -0.00017}},
          {M::simple_division, {-0.15}},
          {M::division, {0.1}},
          {M::simple_fisheye, {}},
          {M::fisheye, {}},
          {M::eucm, {0.6, 1.2}},
          {M::eucm, {0.3, 0.9}}};
}

std::string text(const Lens& lens) {
  return "model " + std::to_string(static_cast<int>(lens.model)) + " first parameter " +
         std::to_string(lens.parameters[0]);
}

}  // namespace

TEST_CASE("scene/lens: every model comes back to its pixel over the whole image") {
  // Issue: below 1e-6 pixels. From a pixel to its ray and back to the pixel, and the ray is 1e-9 true where it can be compared.
  const Camera<double> camera = test_camera();
  for (const Lens& lens : all_lenses()) {
    CAPTURE(text(lens));
    const LensLimit limit = lens_limit(lens);
    double worst_pixel = 0, worst_ray = 0;
    int found = 0, compared = 0;
    for (int v = 0; v <= 750; v += 25) {
      for (int u = 0; u <= 1000; u += 25) {
        const double x = (u - camera.cx) / camera.fx, y = (v - camera.cy) / camera.fy;
        const Undistorted ray = undistort(lens, limit, x, y);
        REQUIRE(ray.converged);
        ++found;
        const std::array<double, 2> back = distort(lens, ray.x, ray.y);
        worst_pixel = std::fmax(worst_pixel, std::hypot(camera.fx * (back[0] - x), camera.fy * (back[1] - y)));
        if (!(std::hypot(x, y) < 0.999 * limit.ray)) continue;
        const std::array<double, 2> there = distort(lens, x, y);  // (x, y) as a ray
        const Undistorted again = undistort(lens, limit, there[0], there[1]);
        REQUIRE(again.converged);
        worst_ray = std::fmax(worst_ray, std::hypot(again.x - x, again.y - y));
        ++compared;
      }
    }
    CHECK(found == 31 * 41);
    CHECK(compared > 31 * 20);
    CHECK(worst_pixel < 1e-9);  // measured: 3e-13
    CHECK(worst_ray < 1e-9);    // measured: 6e-16
  }
}

TEST_CASE("scene/lens: Jacobians are those of central differences, at the axis too") {
  for (const Lens& lens : all_lenses()) {
    CAPTURE(text(lens));
    for (const auto& [x, y] : {std::pair{0.0, 0.0}, std::pair{1e-9, -1e-9}, std::pair{0.2, 0.1}, std::pair{-0.5, 0.4},
                               std::pair{0.6, -0.55}, std::pair{0.0, 0.249}, std::pair{0.2501, 0.0}}) {
      const std::array<double, 4> jacobian = distort_jacobian(lens, x, y);
      constexpr double h = 1e-5;
      const std::array<double, 2> right = distort(lens, x + h, y), left = distort(lens, x - h, y);
      const std::array<double, 2> down = distort(lens, x, y + h), up = distort(lens, x, y - h);
      for (std::size_t i = 0; i < 2; ++i) {
        // Truncation h^2 / 6 times a third derivative of at most ~10, rounding 1e-16 / h: below 1e-9.
        CHECK(std::abs(jacobian[2 * i] - (right[i] - left[i]) / (2 * h)) < 1e-9);
        CHECK(std::abs(jacobian[2 * i + 1] - (down[i] - up[i]) / (2 * h)) < 1e-9);
      }
    }
  }
}

TEST_CASE("scene/lens: values by hand") {
  const auto at = [](const Lens& lens, double x, double y) { return distort(lens, x, y); };
  // r2 = 0.05: factor 1 + 0.1 * 0.05 - 0.2 * 0.0025 = 1.0045; tangential 2 p1 x y + p2 (r2 + 2 x2) = 4e-5 + 1.4e-4 and
  // 2 p2 x y + p1 (r2 + 2 y2) = 8e-5 + 1.3e-4.
  const auto opencv = at({M::opencv, {0.1, -0.2, 0.001, 0.002}}, 0.1, 0.2);
  CHECK(opencv[0] == doctest::Approx(0.10045 + 0.00018).epsilon(1e-14));
  CHECK(opencv[1] == doctest::Approx(0.2009 + 0.00021).epsilon(1e-14));
  // The same with p1 and p2 exchanged lands elsewhere: the negative control of their order.
  CHECK(std::abs(at({M::opencv, {0.1, -0.2, 0.002, 0.001}}, 0.1, 0.2)[0] - opencv[0]) > 2e-5);
  const auto rational = at({M::full_opencv, {0.1, -0.2, 0, 0, 0.3, 0.05, 0.4, -0.5}}, 0.1, 0.2);
  CHECK(rational[0] ==
        doctest::Approx(0.1 * (1.0045 + 0.3 * 0.000125) / (1 + 0.0025 + 0.001 - 0.5 * 0.000125)).epsilon(1e-14));
  // 45 degrees from the axis lands at pi/4 on an equidistant lens, and scaled by 1 + k pi^2/16 with one coefficient.
  const double quarter = std::numbers::pi / 4;
  CHECK(at({M::fisheye, {}}, 1, 0)[0] == doctest::Approx(quarter).epsilon(1e-15));
  CHECK(at({M::simple_radial_fisheye, {0.1}}, 0, -1)[1] ==
        doctest::Approx(-quarter * (1 + 0.1 * quarter * quarter)).epsilon(1e-15));
  // Half the field of view 2 omega/2 of the FOV model: the ray at tan(omega/2) lands at half the angle's share: atan(2 tan^2)/omega.
  CHECK(at({M::fov, {1.0}}, std::tan(0.5), 0)[0] ==
        doctest::Approx(std::atan(2 * std::tan(0.5) * std::tan(0.5))).epsilon(1e-14));
  // EUCM with alpha 0.5, beta 1 is the stereographic-like r / (0.5 sqrt(r2 + 1) + 0.5).
  CHECK(at({M::eucm, {0.5, 1}}, 0.75, 0)[0] == doctest::Approx(0.75 / (0.5 * 1.25 + 0.5)).epsilon(1e-15));
  // Division: x_u = x_d / (1 + k r_d^2).
  const auto division = at({M::division, {-0.2}}, 0.3, 0.4);
  const double r2 = division[0] * division[0] + division[1] * division[1];
  CHECK(division[0] / (1 - 0.2 * r2) == doctest::Approx(0.3).epsilon(1e-14));
  // Thin prisms move the axis' neighbourhood sideways.
  CHECK(at({M::thin_prism_fisheye, {0, 0, 0, 0, 0, 0, 0.1, 0}}, 0, 1)[0] ==
        doctest::Approx(0.1 * quarter * quarter).epsilon(1e-14));
  CHECK(at({M::rad_tan_thin_prism_fisheye, {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0.2}}, 1, 0)[1] ==
        doctest::Approx(0.1 * quarter * quarter + 0.2 * std::pow(quarter, 4)).epsilon(1e-14));
}

TEST_CASE("scene/lens: the series of the fisheye meets the formula") {
  // Both sides of the border at r = 1/4 agree to rounding, and far below it the ratio is 1 - r^2/3.
  CHECK(detail::angle_ratio(0.0625) ==
        doctest::Approx(detail::angle_ratio(std::nextafter(0.0625, 0.0))).epsilon(1e-15));
  CHECK(detail::angle_ratio(1e-12) == 1 - 1e-12 / 3);
  CHECK(detail::angle_ratio(0.0) == 1);
}

TEST_CASE("scene/lens: beyond the radius where a lens folds there is no ray, and it is said") {
  // d/dr (r + k r^3) = 0 at r = 1 / sqrt(-3 k): 1.8257 for k = -0.1, where the image ends at 2/3 of it: 1.2172.
  const Lens folding{LensModel::simple_radial, {-0.1}};
  const LensLimit limit = lens_limit(folding);
  CHECK(limit.ray == doctest::Approx(1 / std::sqrt(0.3)).epsilon(1e-9));
  const double edge = limit.ray * 2 / 3;
  CHECK(undistort(folding, limit, 0.999 * edge, 0).converged);
  CHECK(undistort(folding, limit, 0.999 * edge, 0).x < limit.ray);
  CHECK(!undistort(folding, limit, 1.001 * edge, 0).converged);
  CHECK(!undistort(folding, limit, 0, 3.0).converged);
  double ghost = 3.0;  // negative control: Newton's iteration by itself finds a ray beyond the fold, on the other side
  for (int i = 0; i < 200; ++i) ghost -= (ghost - 0.1 * ghost * ghost * ghost - 3.0) / (1 - 0.3 * ghost * ghost);
  CHECK(std::abs(ghost - 0.1 * ghost * ghost * ghost - 3.0) < 1e-9);
  CHECK(ghost < -limit.ray);
  // The published coefficients of fox are one-to-one up to r = 1.56 only: r(1 + k1 r2 + k2 r4) has its maximum there, by the root of
  // 1 + 3 k1 q + 5 k2 q^2; the tangential part moves it by less than 1 %.
  const Lens fox{LensModel::opencv, {0.0578421, -0.0805099, -0.000980296, 0.00015575}};
  const double b = 3 * 0.0578421, c = 5 * 0.0805099;
  CHECK(lens_limit(fox).ray == doctest::Approx(std::sqrt((b + std::sqrt(b * b + 4 * c)) / (2 * c))).epsilon(0.01));
  CHECK(lens_limit({LensModel::division, {0.25}}).ray == doctest::Approx(1.0).epsilon(1e-15));
  CHECK(!undistort({LensModel::division, {0.25}}, 2.01, 0).converged);
  CHECK(std::isinf(lens_limit({LensModel::pinhole, {}}).ray));
  CHECK(!undistort({LensModel::fisheye, {}}, 1.6, 0).converged);  // behind the camera
  CHECK(!undistort({LensModel::fov, {1.0}}, 1.58, 0).converged);
  CHECK(!undistort({LensModel::simple_radial, {std::nan("")}}, 0.1, 0).converged);
}

TEST_CASE("scene/lens: pinholes are recognised, displacement is in pixels") {
  CHECK(is_pinhole({}));
  CHECK(is_pinhole({LensModel::opencv, {}}));
  CHECK(is_pinhole({LensModel::eucm, {0, 1}}));
  CHECK(!is_pinhole({LensModel::fisheye, {}}));
  CHECK(!is_pinhole({LensModel::full_opencv, {0, 0, 0, 0, 0, 0, 0, 1e-9}}));
  Camera<double> camera;
  camera.width = 16;
  camera.height = 12;
  camera.fx = camera.fy = 20;
  camera.cx = 8;
  camera.cy = 6;
  // At the corners r = 1/2: f k r^3 = 2.5 k.
  CHECK(lens_displacement(camera, {LensModel::simple_radial, {0.08}}) == doctest::Approx(0.2).epsilon(1e-12));
  CHECK(lens_displacement(camera, {}) == 0);
}
