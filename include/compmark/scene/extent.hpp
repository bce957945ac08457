// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How large the scene is, as its training cameras see it: the scale of position learning rates and growing thresholds in the published
// family (ecosystem sheet, section 2.2). Test cameras do not count.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "compmark/scene/dataset.hpp"

namespace compmark::inline v0 {

struct SceneExtent {
  std::array<double, 3> center{0, 0, 0};  ///< mean of the training cameras' centres
  double radius = 0;                      ///< 1.1 times their largest distance from it; 0 for fewer than two places
};

[[nodiscard]] inline SceneExtent scene_extent(const Dataset& dataset) {
  SceneExtent extent;
  double count = 0;
  for (const View& view : dataset.views) {
    if (view.split != Split::train) continue;
    count += 1;  // a running mean: no overflow, and exact where all centres are equal
    for (std::size_t c = 0; c < 3; ++c) extent.center[c] += (view.camera.center_world[c] - extent.center[c]) / count;
  }
  for (const View& view : dataset.views) {
    if (view.split != Split::train) continue;
    extent.radius = std::max(extent.radius, std::hypot(view.camera.center_world[0] - extent.center[0],
                                                       view.camera.center_world[1] - extent.center[1],
                                                       view.camera.center_world[2] - extent.center[2]));
  }
  extent.radius *= 1.1;
  return extent;
}

}  // namespace compmark::inline v0
