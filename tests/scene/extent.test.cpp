// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/extent.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <vector>

using namespace compmark;

namespace {

Dataset cameras_at(const std::vector<std::array<double, 3>>& places) {
  Dataset dataset;
  for (const auto& place : places) {
    View view;
    view.camera.center_world = place;
    dataset.views.push_back(view);
  }
  return dataset;
}

}  // namespace

TEST_CASE("scene/extent: cameras in one place have the extent of cameras around what they see") {
  Dataset one = cameras_at({{1, 2, 3}});
  one.points.position = {{1, 2, 5}, {1, 5, 3}, {9, 2, 3}};  // 2, 3 and 8 away
  CHECK(camera_extent(one).radius == 0);
  CHECK(scene_extent(one).radius == doctest::Approx(1.1 * 3));
  CHECK(scene_extent(one).center == std::array<double, 3>{1, 2, 3});
  // Two in one place, and as good as in one place: a rounding of their poses is no scene of a millionth.
  Dataset two = cameras_at({{1, 2, 3}, {1, 2, 3 + 1e-9}});
  two.points = one.points;
  CHECK(camera_extent(two).radius > 0);
  CHECK(scene_extent(two).radius == doctest::Approx(1.1 * 3));
  // A small baseline is one, with the published rule, and where two train a test view does not count.
  two.views[1].camera.center_world = {1, 2, 3.0001};
  CHECK(scene_extent(two).radius == camera_extent(two).radius);
  CHECK(scene_extent(two).radius == doctest::Approx(1.1 * 0.00005));
  two.views[1].split = Split::test;
  CHECK(scene_extent(two).radius == doctest::Approx(1.1 * 3));
  // Without points, what the camera looks at; without a training view, nothing.
  one.points.position.clear();
  CHECK(scene_extent(one).radius == doctest::Approx(1.1 * look_at(one).distance));
  one.views[0].split = Split::test;
  CHECK(scene_extent(one).radius == 0);
}
