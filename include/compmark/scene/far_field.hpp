// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The ball of the training cameras of an unbounded scene. Inside it cells of anchors are cubes of the world, outside
// cubes of contracted space (splat/anchor/contracted_space.hpp). Cost: O(cameras).
#pragma once

#include <array>

#include "compmark/scene/dataset.hpp"
#include "compmark/scene/extent.hpp"
#include "compmark/scene/random_points.hpp"

namespace compmark {

/// The ball of the training cameras. If all stand in one place, its radius is half the distance to the point they look
/// at.
struct CameraBall {
  std::array<double, 3> origin{0, 0, 0};
  double radius = 1;
};
[[nodiscard]] inline CameraBall camera_ball(const Dataset& dataset) {
  const SceneExtent extent = camera_extent(dataset);
  const double radius = extent.radius > 0 ? extent.radius : 0.5 * look_at(dataset).distance;
  return {extent.center, radius > 0 ? radius : 1};
}

}  // namespace compmark
