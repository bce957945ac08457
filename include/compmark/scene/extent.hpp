// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The size of the scene as its training cameras see it. In the published family it scales the learning rates of
// positions and the thresholds of growing (docs/spec/formats.md, 6). Test cameras do not count. The published rule
// gives 0 for one training camera, or for several in one place, and offsets would never move; there the extent is that
// of imagined cameras around the middle of what is seen. A camera that was registered far away does not count: it would
// make offsets learn too fast. Cost: O(cameras + points).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "compmark/math/robust_ball.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/random_points.hpp"

namespace compmark {

struct SceneExtent {
  std::array<double, 3> center{0, 0, 0};  ///< mean of the training cameras' centres
  double radius = 0;                      ///< 1.1 times their largest distance from it
};

namespace detail {

/// Distance of the middle point from a place: the scale of a scene whose cameras stand in one place. 0 without finite
/// points.
template <class Points>
[[nodiscard]] double median_distance(const Points& points, const std::array<double, 3>& from) {
  std::vector<double> distance;
  distance.reserve(points.position.size());
  for (const auto& p : points.position) {
    const double d = std::hypot(static_cast<double>(p[0]) - from[0], static_cast<double>(p[1]) - from[1],
                                static_cast<double>(p[2]) - from[2]);
    if (std::isfinite(d)) distance.push_back(d);
  }
  if (distance.empty()) return 0;
  const auto middle = distance.begin() + static_cast<std::ptrdiff_t>(distance.size() / 2);
  std::nth_element(distance.begin(), middle, distance.end());
  return *middle;
}

/// The ball of some cameras, and how far from its centre one may stand and still count: the core
/// (math/robust_ball.hpp), which counts what they see too.
struct CameraCore {
  RobustBall ball;
  double size = 0;  ///< the longer of `wide` and the distance of the middle point
  double limit = std::numeric_limits<double>::infinity();
  [[nodiscard]] bool holds(const View& view) const { return !(ball.distance(view.camera.center_world.data()) > limit); }
};
template <class Points>
[[nodiscard]] CameraCore camera_core(const Dataset& dataset, const std::vector<std::size_t>& views,
                                     const Points& points) {
  CameraCore core;
  core.ball = robust_ball(
      views.size(), [&](std::size_t i) -> const auto& { return dataset.views[views[i]].camera.center_world; });
  core.size = std::max(core.ball.wide, median_distance(points, core.ball.center));
  core.limit = core.ball.core(core.size);
  return core;
}

}  // namespace detail

/// 0 for fewer than two places. Training cameras that stand beyond the core of all of them do not count.
[[nodiscard]] inline SceneExtent camera_extent(const Dataset& dataset) {
  std::vector<std::size_t> views = dataset.indices(Split::train);
  const detail::CameraCore core = detail::camera_core(dataset, views, dataset.points);
  std::erase_if(views, [&](std::size_t i) { return !core.holds(dataset.views[i]); });
  SceneExtent extent;
  double count = 0;
  for (const std::size_t i : views) {
    count += 1;  // a running mean: no overflow, and exact where all centres are equal
    const std::array<double, 3>& place = dataset.views[i].camera.center_world;
    for (std::size_t c = 0; c < 3; ++c) extent.center[c] += (place[c] - extent.center[c]) / count;
  }
  for (const std::size_t i : views) {
    const std::array<double, 3>& place = dataset.views[i].camera.center_world;
    extent.radius = std::max(extent.radius, std::hypot(place[0] - extent.center[0], place[1] - extent.center[1],
                                                       place[2] - extent.center[2]));
  }
  extent.radius *= 1.1;
  return extent;
}

/// The cameras' extent; where they stand in one place, to a millionth of what they see, 1.1 times the distance of the
/// middle point instead, or without points of what they look at. 0 without training views.
[[nodiscard]] inline SceneExtent scene_extent(const Dataset& dataset) {
  SceneExtent extent = camera_extent(dataset);
  if (dataset.indices(Split::train).empty()) return extent;
  const double points = detail::median_distance(dataset.points, extent.center);
  const double seen = 1.1 * (points > 0 ? points : look_at(dataset).distance);
  if (!(extent.radius > 1e-6 * seen)) extent.radius = seen;
  return extent;
}

}  // namespace compmark
