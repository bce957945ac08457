// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/capture_around.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace capture_around_test {

constexpr std::array<double, 3> middle{5, -3, 1};

void put(SplatTable& table, const std::array<double, 3>& place, double log_scale) {
  const std::size_t row = table.count;
  table.resize(row + 1, 0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    table.mean[axis][row] = static_cast<float>(place[axis]);
    table.log_scale[axis][row] = static_cast<float>(log_scale);
  }
  table.rotation[0][row] = 1;
  table.opacity[row] = 3;
}

/// A ball of radius 2 of fine splats.
SplatTable ball() {
  SplatTable table;
  const Random random(4, 0, random_stage("capture around test"));
  for (std::uint64_t i = 0; i < 2000; ++i) {
    std::array<double, 3> d{random.normal(4 * i), random.normal(4 * i + 1), random.normal(4 * i + 2)};
    const double norm = std::hypot(d[0], d[1], d[2]), radius = 2 * std::cbrt(random.uniform(4 * i + 3));
    for (std::size_t axis = 0; axis < 3; ++axis) d[axis] = middle[axis] + radius * d[axis] / norm;
    put(table, d, -4);
  }
  return table;
}

/// The ball in a closed room: walls of coarse splats, `half` from the middle.
SplatTable room(double half) {
  SplatTable table = ball();
  constexpr int side = 24;
  for (int wall = 0; wall < 6; ++wall) {
    for (int u = 0; u < side; ++u) {
      for (int v = 0; v < side; ++v) {
        std::array<double, 3> place = middle;
        const auto axis = static_cast<std::size_t>(wall / 2);
        place[axis] += wall % 2 == 0 ? half : -half;
        place[(axis + 1) % 3] += half * (2 * (u + 0.5) / side - 1);
        place[(axis + 2) % 3] += half * (2 * (v + 0.5) / side - 1);
        put(table, place, std::log(half / side));
      }
    }
  }
  return table;
}

double from_middle(const Camera<double>& camera, std::size_t axis) { return camera.center_world[axis] - middle[axis]; }
double largest_offset(const Camera<double>& camera) {
  double most = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) most = std::max(most, std::abs(from_middle(camera, axis)));
  return most;
}

TEST_CASE("scene/capture_around: upright cameras all round, of several heights and distances, that look at the bulk") {
  const SplatTable table = ball();
  CaptureAround settings;
  settings.width = 120;
  settings.height = 90;
  const std::vector<Camera<double>> cameras = capture_around(table, settings);
  REQUIRE(cameras.size() == 128);
  std::array<int, 8> sectors{};
  double nearest = 1e9, farthest = 0, lowest = 90, highest = -90;
  for (const Camera<double>& camera : cameras) {
    CHECK(camera.width == 120);
    CHECK(camera.height == 90);
    const auto& r = camera.rotation_camera_world;
    // A rotation: rows of length 1, at right angles, the third the product of the first two.
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        double dot = 0;
        for (std::size_t c = 0; c < 3; ++c) dot += r[3 * a + c] * r[3 * b + c];
        CHECK(std::abs(dot - (a == b ? 1 : 0)) < 1e-12);
      }
    }
    CHECK(std::abs(r[1] * r[5] - r[2] * r[4] - r[6]) < 1e-12);
    CHECK(std::abs(r[1]) < 1e-12);  // right is level
    CHECK(r[4] >= 0);               // and down is down
    const double x = from_middle(camera, 0), y = -from_middle(camera, 1), z = from_middle(camera, 2);
    const double distance = std::hypot(x, y, z), elevation = std::asin(y / distance) * 180 / std::numbers::pi;
    // The middle is in the picture.
    const double depth = -(r[6] * x - r[7] * y + r[8] * z);
    const double across = -(r[0] * x - r[1] * y + r[2] * z), below = -(r[3] * x - r[4] * y + r[5] * z);
    CHECK(depth > 0);
    CHECK(std::abs(camera.fx * across / depth) < 60);
    CHECK(std::abs(camera.fy * below / depth) < 45);
    nearest = std::min(nearest, distance);
    farthest = std::max(farthest, distance);
    lowest = std::min(lowest, elevation);
    highest = std::max(highest, elevation);
    ++sectors[static_cast<std::size_t>((std::atan2(z, x) / (2 * std::numbers::pi) + 1) * 8) % 8];
  }
  CHECK(lowest > -11);
  CHECK(lowest < -5);
  CHECK(highest < 81);
  CHECK(highest > 65);
  CHECK(farthest > 1.5 * nearest);
  CHECK(nearest > 2);                                                                   // outside of the ball
  CHECK(*std::min_element(sectors.begin(), sectors.end()) >= 12);                       // of 16 each
  CHECK(capture_around(table, settings)[77].center_world == cameras[77].center_world);  // always the same
  // Another up turns all of it: where z is up, the cameras are upright about z.
  CaptureAround turned = settings;
  turned.up = {0, 0, 1};
  for (const Camera<double>& camera : capture_around(table, turned)) {
    CHECK(std::abs(camera.rotation_camera_world[2]) < 1e-12);
    CHECK(camera.rotation_camera_world[5] <= 0);
    CHECK(from_middle(camera, 2) > -0.2 * farthest);
  }
  settings.seed = 1;
  CHECK(capture_around(table, settings)[77].center_world != cameras[77].center_world);
}

TEST_CASE("scene/capture_around: in a room the cameras stay inside, where they see what the room is for") {
  const SplatTable table = room(4);
  CaptureAround settings;
  const auto outside = [&](const std::vector<Camera<double>>& cameras) {
    return std::count_if(cameras.begin(), cameras.end(), [](const Camera<double>& c) { return largest_offset(c) > 4; });
  };
  CHECK(outside(capture_around(table, settings)) == 0);
  settings.blocked = 1e9;  // whatever stands before it: most would stand behind the walls
  CHECK(outside(capture_around(table, settings)) > 40);
}

TEST_CASE("scene/capture_around: straight down and from the place itself are cameras too") {
  const PictureShape shape;
  const Camera<double> down = camera_towards({1, -2, 3}, {1, 5, 3}, usual_up, shape);
  CHECK(down.rotation_camera_world[7] == doctest::Approx(1));
  CHECK(std::abs(down.rotation_camera_world[1]) < 1e-12);  // right is level
  const Camera<double> here = camera_towards({1, 2, 3}, {1, 2, 3}, usual_up, shape);
  CHECK(std::abs(here.rotation_camera_world[7]) < 1e-12);  // and so is ahead
}

}  // namespace capture_around_test
