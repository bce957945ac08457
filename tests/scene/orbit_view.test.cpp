// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/orbit_view.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

namespace orbit_view_test {
namespace {

using namespace compmark;
using Vector = std::array<double, 3>;

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector direction_of(double azimuth, double elevation) {
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
}
/// A camera at this place of a sphere about the origin, which it looks at, or away from.
Camera<double> on_sphere(double azimuth, double elevation, double radius = 4, bool outward = false) {
  Camera<double> camera;
  camera.width = camera.height = 8;
  camera.fx = camera.fy = 10;
  const Vector from = direction_of(azimuth, elevation), up = direction_of(azimuth, elevation + std::numbers::pi / 2);
  const double way = outward ? 1 : -1;
  const Vector ahead{way * from[0], way * from[1], way * from[2]}, down{-up[0], -up[1], -up[2]};
  const Vector right{down[1] * ahead[2] - down[2] * ahead[1], down[2] * ahead[0] - down[0] * ahead[2],
                     down[0] * ahead[1] - down[1] * ahead[0]};
  camera.rotation_camera_world = {right[0], right[1], right[2], down[0], down[1],
                                  down[2],  ahead[0], ahead[1], ahead[2]};
  camera.center_world = {radius * from[0], radius * from[1], radius * from[2]};
  return camera;
}
Vector row(const Camera<double>& camera, std::size_t r) {
  const auto& m = camera.rotation_camera_world;
  return {m[3 * r], m[3 * r + 1], m[3 * r + 2]};
}

/// A hundred cameras over the upper half of a sphere, evenly, without those within 12 degrees of the middle of a gap at its rim.
struct Hemisphere {
  std::vector<Camera<double>> cameras;
  Vector gap = direction_of(0.7, 0.17);

  Hemisphere() {
    const Random random(3, 0, random_stage("hemisphere"));
    for (std::uint64_t i = 0; cameras.size() < 100; ++i) {
      const double azimuth = 2 * std::numbers::pi * random.uniform(2 * i), height = random.uniform(2 * i + 1);
      if (dot(direction_of(azimuth, std::asin(height)), gap) > std::cos(12 * std::numbers::pi / 180)) continue;
      cameras.push_back(on_sphere(azimuth, std::asin(height)));
    }
  }
  [[nodiscard]] Camera<double> operator()(std::size_t i) const { return cameras[i]; }
  /// How many of 20,000 samples stand within 6 degrees of the middle of the gap.
  template <class Sample>
  [[nodiscard]] int in_gap(const Sample& sample) const {
    const ViewClearance clearance(*this, cameras.size());
    int count = 0;
    for (std::uint64_t t = 0; t < 20000; ++t) {
      const Random random(7, t, random_stage("samples"));
      const Vector at = sample(clearance.view(random.uniform(90)), random).center_world;
      if (dot(at, gap) > std::cos(6 * std::numbers::pi / 180) * std::sqrt(dot(at, at))) ++count;
    }
    return count;
  }
};

}  // namespace

TEST_CASE("scene/orbit_view: on its orbit a camera keeps its distance from what it looks at, and its axes are axes") {
  const Camera<double> from = on_sphere(0.4, 0.3);
  for (const double azimuth : {0.0, 0.9, 2.5, -1.3}) {
    for (const double distance : {1e-9, 0.1, 2.0, 100.0}) {
      CAPTURE(azimuth);
      CAPTURE(distance);
      const Camera<double> moved = camera_orbited(from, 4.0, azimuth, distance);
      CHECK(std::abs(std::sqrt(dot(moved.center_world, moved.center_world)) - 4) < 1e-14 * 8);  // round the origin
      const Vector ahead = row(moved, 2);
      CHECK(std::abs(dot(ahead, moved.center_world) + 4) < 1e-14 * 8);  // … which it looks at
      for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = 0; b < 3; ++b)
          CHECK(std::abs(dot(row(moved, a), row(moved, b)) - (a == b ? 1 : 0)) < 1e-14);
      }
      const double angle = std::acos(std::fmin(1.0, dot(ahead, row(from, 2))));
      if (distance > 1e-3) CHECK(angle == doctest::Approx(std::fmin(distance / 4, std::numbers::pi / 3)).epsilon(1e-9));
      // It leaves in the direction of its image plane that was asked for.
      double right = 0, down = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        right += (moved.center_world[c] - from.center_world[c]) * row(from, 0)[c];
        down += (moved.center_world[c] - from.center_world[c]) * row(from, 1)[c];
      }
      if (distance > 1e-3)
        CHECK(std::abs(std::remainder(std::atan2(down, right) - azimuth, 2 * std::numbers::pi)) < 1e-9);
    }
  }
  const Camera<double> stays = camera_orbited(from, 4.0, 0.7, 0.0);
  CHECK(stays.center_world == from.center_world);
  CHECK(stays.rotation_camera_world == from.rotation_camera_world);
  const Camera<double> line = camera_orbited(from, std::numeric_limits<double>::infinity(), 0.0, 0.5);
  CHECK(line.rotation_camera_world == from.rotation_camera_world);
  for (std::size_t c = 0; c < 3; ++c)
    CHECK(line.center_world[c] == doctest::Approx(from.center_world[c] + 0.5 * row(from, 0)[c]));
}

TEST_CASE("scene/orbit_view: cameras that look at a point say its depth, and those that look apart none") {
  const auto depth = [](const std::vector<Camera<double>>& cameras) {
    const auto camera = [&](std::size_t i) { return cameras[i]; };
    return focus_depth(camera, 0, nearest_views(camera, cameras.size(), 0));
  };
  std::vector<Camera<double>> inward, outward, parallel;
  for (int i = 0; i < 8; ++i) {
    inward.push_back(on_sphere(0.1 * i, 0.05 * i * i / 8));
    outward.push_back(on_sphere(0.1 * i, 0.05 * i * i / 8, 4, true));
    parallel.push_back(on_sphere(0, 0));
    parallel.back().center_world[1] += 0.2 * i;
  }
  CHECK(depth(inward) == doctest::Approx(4).epsilon(1e-12));
  CHECK(std::isinf(depth(outward)));
  CHECK(std::isinf(depth(parallel)));
  CHECK(std::isinf(depth({inward[0]})));
  for (Camera<double>& camera : inward) camera.center_world[2] += 0.02 * std::sin(40 * camera.center_world[1]);
  CHECK(depth(inward) == doctest::Approx(4).epsilon(0.05));  // least squares: hand-held
}

TEST_CASE("scene/orbit_view: a gap at the rim of a capture is sampled, where triangles of neighbours leave it empty") {
  const Hemisphere views;
  const std::size_t count = views.cameras.size();
  const int orbits = views.in_gap(
      [&](std::size_t view, const Random& random) { return orbit_view_camera(views, count, view, random); });
  const int triangles = views.in_gap(
      [&](std::size_t view, const Random& random) { return novel_view_camera(views, count, view, random, 1.7); });
  CAPTURE(orbits);
  CAPTURE(triangles);
  CHECK(orbits > 20);
  CHECK(3 * triangles < orbits);
  // A view alone is only turned and zoomed.
  const Camera<double> alone = orbit_view_camera(views, 1, 0, Random(1, 2, 3));
  CHECK(alone.center_world == views.cameras[0].center_world);
}

}  // namespace orbit_view_test
