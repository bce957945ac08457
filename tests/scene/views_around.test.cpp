// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/views_around.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace views_around_test {

/// A ball of radius 2 about (5, -3, 1), and a few splats a thousand away.
SplatTable ball(std::size_t count, std::size_t strays) {
  SplatTable table;
  table.resize(count + strays, 0);
  const Random random(4, 0, random_stage("views around"));
  std::uint64_t index = 0;
  for (std::size_t i = 0; i < count + strays; ++i) {
    std::array<double, 3> d{};
    double norm = 0;
    for (double& x : d) {
      x = random.normal(index++);
      norm += x * x;
    }
    const double radius = i < count ? 2 * std::cbrt(random.uniform(index++)) : 1000;
    const std::array<double, 3> center{5, -3, 1};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      table.mean[axis][i] = static_cast<float>(center[axis] + radius * d[axis] / std::sqrt(norm));
      table.log_scale[axis][i] = -4;
    }
    table.rotation[0][i] = 1;
    table.opacity[i] = 2;
  }
  return table;
}

/// Pixel of a place, and its depth.
std::array<double, 3> projected(const Camera<double>& camera, const std::array<double, 3>& place) {
  std::array<double, 3> p{};
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c)
      p[row] += camera.rotation_camera_world[3 * row + c] * (place[c] - camera.center_world[c]);
  }
  return {camera.fx * p[0] / p[2] + camera.cx, camera.fy * p[1] / p[2] + camera.cy, p[2]};
}

TEST_CASE("scene/views_around: the bulk of a ball, whatever stands far away or is not seen") {
  SplatTable table = ball(2000, 40);
  for (std::size_t i = 0; i < 500; ++i) {  // unseen splats in a corner count for nothing
    table.mean[0][i] = 30;
    table.opacity[i] = -3;
  }
  const SplatBulk bulk = splat_bulk(table);
  CHECK(std::abs(bulk.center[0] - 5) < 0.15);
  CHECK(std::abs(bulk.center[1] + 3) < 0.15);
  CHECK(std::abs(bulk.center[2] - 1) < 0.15);
  CHECK(bulk.radius == doctest::Approx(2 * std::cbrt(0.8 * 1540 / 1500.0)).epsilon(0.03));

  SplatTable one;
  one.resize(1, 0);
  one.log_scale = {std::vector<float>{-1}, std::vector<float>{-2}, std::vector<float>{-3}};
  CHECK(splat_bulk(one).radius == doctest::Approx(3 * std::exp(-1)));
  CHECK(splat_bulk(SplatTable{}).radius == 1);
}

TEST_CASE("scene/views_around: cameras stand above, turn about the middle and hold the bulk in their pictures") {
  const SplatTable table = ball(2000, 40);
  const SplatBulk bulk = splat_bulk(table);
  const std::vector<Camera<double>> cameras = cameras_around(bulk);
  REQUIRE(cameras.size() == 16);
  for (const Camera<double>& camera : cameras) {
    const std::array<double, 9>& r = camera.rotation_camera_world;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const double dot = r[3 * i] * r[3 * j] + r[3 * i + 1] * r[3 * j + 1] + r[3 * i + 2] * r[3 * j + 2];
        CHECK(dot == doctest::Approx(i == j ? 1 : 0).epsilon(1e-12));
      }
    }
    CHECK(r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
              r[2] * (r[3] * r[7] - r[4] * r[6]) ==
          doctest::Approx(1));
    const std::array<double, 3> middle = projected(camera, bulk.center);
    CHECK(middle[0] == doctest::Approx(400));
    CHECK(middle[1] == doctest::Approx(400));
    CHECK(middle[2] > bulk.radius);
    CHECK(camera.center_world[1] < bulk.center[1]);  // -y is up
    std::array<double, 3> above = bulk.center;
    above[1] -= 0.5 * bulk.radius;
    CHECK(projected(camera, above)[1] < 400);
    std::size_t inside = 0;
    for (std::size_t i = 0; i < 2000; ++i) {
      const std::array<double, 3> p =
          projected(camera, {static_cast<double>(table.mean[0][i]), static_cast<double>(table.mean[1][i]),
                             static_cast<double>(table.mean[2][i])});
      inside += p[2] > 0 && p[0] > 0 && p[0] < 800 && p[1] > 0 && p[1] < 800 ? 1u : 0u;
    }
    CHECK(inside > 1900);
  }
  CHECK(cameras[0].center_world != cameras[1].center_world);
}

}  // namespace views_around_test
