// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/register/camera_step.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>

using namespace compmark;

namespace {

Camera<double> some_camera() {
  Camera<double> camera;
  camera.width = 64;
  camera.height = 48;
  camera.fx = 70;
  camera.fy = 72;
  camera.cx = 31;
  camera.cy = 25;
  camera.center_world = {1, -2, 0.5};
  return moved(camera, {0.3, -0.7, 1.1, 0, 0, 0, 0, 0, 0});
}

std::array<double, 3> in_camera(const Camera<double>& camera, const std::array<double, 3>& world) {
  std::array<double, 3> point{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c)
      point[r] += camera.rotation_camera_world[3 * r + c] * (world[c] - camera.center_world[c]);
  return point;
}

}  // namespace

TEST_CASE("a camera step turns and moves the scene in the camera frame") {
  const Camera<double> camera = some_camera();
  const std::array<double, 3> world{2, 1, 4}, before = in_camera(camera, world);
  const double angle = 0.4;
  const Camera<double> rolled = moved(camera, {0, 0, angle, 0.1, -0.2, 0.3, 0, 0, 0});
  const std::array<double, 3> after = in_camera(rolled, world);
  CHECK(after[0] == doctest::Approx(std::cos(angle) * before[0] - std::sin(angle) * before[1] + 0.1));
  CHECK(after[1] == doctest::Approx(std::sin(angle) * before[0] + std::cos(angle) * before[1] - 0.2));
  CHECK(after[2] == doctest::Approx(before[2] + 0.3));
  const Camera<double> zoomed = moved(camera, {0, 0, 0, 0, 0, 0, std::log(2.0), 3, -4});
  CHECK(zoomed.fx == doctest::Approx(140));
  CHECK(zoomed.fy == doctest::Approx(144));
  CHECK(zoomed.cx == 34);
  CHECK(zoomed.cy == 21);
  CHECK(zoomed.center_world == camera.center_world);
}

TEST_CASE("a camera step and its opposite cancel, and axes stay at right angles after many") {
  Camera<double> camera = some_camera();
  const Camera<double> there = moved(camera, {1e-5, 2e-5, -1e-5, 0, 0, 0, 0, 0, 0}),
                       back = moved(there, {-1e-5, -2e-5, 1e-5, 0, 0, 0, 0, 0, 0});
  for (std::size_t k = 0; k < 9; ++k)
    CHECK(back.rotation_camera_world[k] == doctest::Approx(camera.rotation_camera_world[k]).epsilon(1e-12));
  for (int i = 0; i < 1000; ++i) camera = moved(camera, {0.3, -0.2, 0.1, 0.01, 0, 0, 0, 0, 0});
  const std::array<double, 9>& r = camera.rotation_camera_world;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double product = r[3 * i] * r[3 * j] + r[3 * i + 1] * r[3 * j + 1] + r[3 * i + 2] * r[3 * j + 2];
      CHECK(product == doctest::Approx(i == j ? 1 : 0).epsilon(1e-14));
    }
}
