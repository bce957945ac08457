// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/far_field.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// Twelve cameras around a cube, that see it and, beside it, nothing.
Dataset around_a_cube(double scale = 1, std::array<double, 3> center = {0, 0, 0}) {
  const CubeCapture capture = cube_capture(scale, center);
  Dataset dataset;
  for (const Camera<double>& camera : capture.cameras) {
    View view;
    view.camera = camera;
    dataset.views.push_back(view);
  }
  for (int i = 0; i < 1000; ++i) {  // a solid cube, half as large as its corners say
    const auto coordinate = [&](int k, std::size_t c) {
      return static_cast<float>(center[c] + scale * 0.5 * (k / 9.0 - 0.5));
    };
    dataset.points.position.push_back({coordinate(i % 10, 0), coordinate(i / 10 % 10, 1), coordinate(i / 100, 2)});
    dataset.points.color.push_back({0, 0, 0});
  }
  return dataset;
}

bool seen(const Dataset& dataset, const std::array<float, 3>& p) {
  for (const View& view : dataset.views) {
    std::size_t index = 0;
    if (detail::CoarseImage(view.camera, 8)
            .cell(view.camera, {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])},
                  index))
      return true;
  }
  return false;
}

}  // namespace

TEST_CASE("scene/far_field: far points stand where cameras look past the scene, and nowhere else") {
  const Dataset dataset = around_a_cube();
  const CameraBall ball = camera_ball(dataset);
  CHECK(ball.radius == doctest::Approx(1.1 * 4).epsilon(0.02));
  const PointCloud points = far_points(dataset, {2000, 50, 8});
  MESSAGE(points.size(), " of 2,000 directions");
  CHECK(points.size() > 200);
  CHECK(points.size() < 1200);  // nobody looks up
  for (const std::array<float, 3>& p : points.position) {
    CHECK(std::hypot(static_cast<double>(p[0]) - ball.origin[0], static_cast<double>(p[1]) - ball.origin[1],
                     static_cast<double>(p[2]) - ball.origin[2]) == doctest::Approx(50 * ball.radius).epsilon(1e-5));
    CHECK(seen(dataset, p));
  }
  CHECK(far_points(dataset, {2000, 50, 8}).position == points.position);

  // A wall around everything: no direction is left. Random points say nothing, so that all are.
  Dataset walled = dataset, random = dataset;
  for (int i = 0; i < 120; ++i) {
    for (int j = 0; j < 120; ++j)
      walled.points.position.push_back({static_cast<float>(8 * std::cos(0.0524 * i)),
                                        static_cast<float>(8 * std::sin(0.0524 * i)),
                                        static_cast<float>(0.2 * j - 16)});
  }
  CHECK(far_points(walled, {2000, 50, 8}).size() < points.size() / 20);
  random.points_are_random = true;
  CHECK(far_points(random, {2000, 50, 8}).size() > points.size());

  // Views that are not trained on do not count.
  Dataset tested = dataset;
  for (View& view : tested.views) view.split = Split::test;
  tested.views[0].split = tested.views[1].split = Split::train;
  CHECK(far_points(tested, {2000, 50, 8}).size() < points.size() / 2);
  CHECK(far_points(dataset, {0, 50, 8}).size() == 0);
}

TEST_CASE("scene/far_field: ball and far points move and scale with the scene") {
  const PointCloud points = far_points(around_a_cube(), {500, 20, 8});
  const std::array<double, 3> center{30, -20, 10};
  for (const double scale : {1e-3, 16.0, 1e3}) {
    const Dataset moved = around_a_cube(scale, {scale * center[0], scale * center[1], scale * center[2]});
    const PointCloud other = far_points(moved, {500, 20, 8});
    REQUIRE(other.size() == points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        CHECK(static_cast<double>(other.position[i][c]) / scale - center[c] ==
              doctest::Approx(static_cast<double>(points.position[i][c])).epsilon(1e-3));
    }
  }
}

TEST_CASE("scene/far_field: cameras in one place have a ball too") {
  Dataset dataset = around_a_cube();
  for (View& view : dataset.views) view.camera.center_world = {1, 2, 3};
  CHECK(camera_ball(dataset).radius > 0);
  CHECK(camera_ball(Dataset{}).radius > 0);
}
