// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/up_axes.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <optional>
#include <vector>

using namespace compmark;

namespace up_axes_test {

using Direction = std::array<double, 3>;

double distance(const Direction& a, const Direction& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }

std::vector<Camera<double>> ring(const Direction& up) {
  SplatBulk bulk;
  bulk.center = {5, -3, 1};
  bulk.radius = 2;
  ViewsAround around;
  around.up = up;
  return cameras_around(bulk, around);
}

TEST_CASE("scene/up_axes: cameras round something say which way is up, and where it is") {
  for (const Direction& up : up_axes) {
    const std::vector<Camera<double>> cameras = ring(up);
    const std::optional<Direction> said = up_of_cameras(cameras), point = point_looked_at(cameras);
    REQUIRE(said.has_value());
    REQUIRE(point.has_value());
    CHECK(distance(*said, up) < 1e-12);
    CHECK(distance(*point, {5, -3, 1}) < 1e-9);
  }
  CHECK_FALSE(up_of_cameras({}).has_value());
  CHECK_FALSE(point_looked_at({}).has_value());
  // Side by side, in parallel: there is no such point.
  std::vector<Camera<double>> parallel = ring(usual_up);
  for (Camera<double>& camera : parallel) camera.rotation_camera_world = parallel[0].rotation_camera_world;
  CHECK_FALSE(point_looked_at(parallel).has_value());
  CHECK(cameras_turned_up(parallel, {1, 0, 0})[0].center_world == parallel[0].center_world);
}

TEST_CASE("scene/up_axes: the least rotation is one, and takes one direction to the other, the opposite one too") {
  const Direction odd{0.48, 0.6, -0.64};
  for (const Direction& from : {up_axes[0], up_axes[1], odd}) {
    for (const Direction& to : {up_axes[0], up_axes[1], up_axes[2], up_axes[4], odd, Direction{-0.48, -0.6, 0.64}}) {
      const std::array<double, 9> turn = least_rotation(from, to);
      Direction turned{};
      double worst = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t j = 0; j < 3; ++j) {
          turned[i] += turn[3 * i + j] * from[j];
          double product = 0;
          for (std::size_t k = 0; k < 3; ++k) product += turn[3 * i + k] * turn[3 * j + k];
          worst = std::fmax(worst, std::abs(product - (i == j ? 1 : 0)));
        }
      }
      CHECK(distance(turned, to) < 1e-12);
      CHECK(worst < 1e-12);
      const double determinant = turn[0] * (turn[4] * turn[8] - turn[5] * turn[7]) -
                                 turn[1] * (turn[3] * turn[8] - turn[5] * turn[6]) +
                                 turn[2] * (turn[3] * turn[7] - turn[4] * turn[6]);
      CHECK(determinant == doctest::Approx(1));  // no mirror
    }
  }
}

TEST_CASE("scene/up_axes: turned cameras stand about another axis, as far away, and look at the same point") {
  const std::vector<Camera<double>> usual = ring(usual_up);
  for (const Direction& up : up_axes) {
    const std::vector<Camera<double>> turned = cameras_turned_up(usual, up);
    REQUIRE(turned.size() == usual.size());
    CHECK(distance(*up_of_cameras(turned), up) < 1e-9);
    CHECK(distance(*point_looked_at(turned), {5, -3, 1}) < 1e-6);
    for (std::size_t i = 0; i < turned.size(); ++i) {
      CHECK(distance(turned[i].center_world, {5, -3, 1}) ==
            doctest::Approx(distance(usual[i].center_world, {5, -3, 1})));
      // What was 15 or 40 degrees above the horizon still is.
      double height = 0, before = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const Direction middle{5, -3, 1};
        height += up[axis] * (turned[i].center_world[axis] - middle[axis]);
        before += usual_up[axis] * (usual[i].center_world[axis] - middle[axis]);
      }
      CHECK(height == doctest::Approx(before));
    }
  }
  // To the bit where nothing is to be turned.
  CHECK(cameras_turned_up(usual, usual_up)[3].center_world == usual[3].center_world);
}

}  // namespace up_axes_test
