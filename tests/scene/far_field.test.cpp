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

/// Twelve cameras around a cube.
Dataset around_a_cube(double scale = 1, std::array<double, 3> center = {0, 0, 0}) {
  Dataset dataset;
  for (const Camera<double>& camera : cube_capture(scale, center).cameras) {
    View view;
    view.camera = camera;
    dataset.views.push_back(view);
  }
  return dataset;
}

}  // namespace

TEST_CASE("scene/far_field: the ball is that of the training cameras, and no other view's") {
  Dataset dataset = around_a_cube();
  CHECK(camera_ball(dataset).radius == doctest::Approx(1.1 * 4).epsilon(0.02));
  const CameraBall whole = camera_ball(dataset);
  View far;
  far.camera = dataset.views[0].camera;
  far.camera.center_world = {50, 0, 0};  // far, and no outlier (tests/scene/outliers.test.cpp)
  far.split = Split::test;
  dataset.views.push_back(far);
  CHECK(camera_ball(dataset).radius == whole.radius);
  dataset.views.back().split = Split::train;  // the control
  CHECK(camera_ball(dataset).radius > 10 * whole.radius);
}

TEST_CASE("scene/far_field: the ball moves and scales with the scene") {
  const CameraBall ball = camera_ball(around_a_cube());
  const std::array<double, 3> center{30, -20, 10};
  for (const double scale : {1e-3, 16.0, 1e3}) {
    const CameraBall moved =
        camera_ball(around_a_cube(scale, {scale * center[0], scale * center[1], scale * center[2]}));
    CHECK(moved.radius == doctest::Approx(scale * ball.radius).epsilon(1e-9));
    for (std::size_t c = 0; c < 3; ++c)
      CHECK(moved.origin[c] / scale - center[c] == doctest::Approx(ball.origin[c]).epsilon(1e-9));
  }
}

TEST_CASE("scene/far_field: cameras in one place have a ball too") {
  Dataset dataset = around_a_cube();
  for (View& view : dataset.views) view.camera.center_world = {1, 2, 3};
  CHECK(camera_ball(dataset).radius > 0);
  CHECK(camera_ball(Dataset{}).radius > 0);
}
