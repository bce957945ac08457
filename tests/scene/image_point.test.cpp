// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/image_point.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>

TEST_CASE(
    "scene/image_point: a point right of, below and before the camera by given lengths is where the intrinsics say") {
  compmark::Camera<double> camera{.width = 640, .height = 480, .fx = 500, .fy = 400, .cx = 310, .cy = 250};
  // Turned about an oblique axis (Rodrigues), so that a transposed rotation shows, and moved.
  const std::array<double, 3> axis{1 / 3.0, 2 / 3.0, 2 / 3.0};
  const double s = std::sin(0.7), c = std::cos(0.7);
  const std::array<double, 9> cross{0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0};
  for (std::size_t i = 0; i < 9; ++i) {
    camera.rotation_camera_world[i] = (i % 4 == 0 ? c : 0.0) + s * cross[i] + (1 - c) * axis[i / 3] * axis[i % 3];
  }
  camera.center_world = {3, -2, 0.5};
  const double right = 0.3, below = -0.4, before = 2.5;
  std::array<double, 3> point = camera.center_world;
  for (std::size_t a = 0; a < 3; ++a) {
    point[a] += right * camera.rotation_camera_world[a] + below * camera.rotation_camera_world[3 + a] +
                before * camera.rotation_camera_world[6 + a];
  }
  const std::array<double, 2> found = compmark::image_point<double>(camera, point);
  CHECK(found[0] == doctest::Approx(500 * right / before + 310).epsilon(1e-12));
  CHECK(found[1] == doctest::Approx(400 * below / before + 250).epsilon(1e-12));
  // In the camera's plane it is nowhere.
  CHECK_FALSE(std::isfinite(compmark::image_point<double>({.fx = 1, .fy = 1}, {1, 1, 0})[0]));
}
