// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Where a point of the world is on the image of a pinhole camera, in doubles from end to end. Cost: nine
// multiplications and two divisions.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/scene/camera.hpp"

namespace compmark {

/// {u, v} in the image frame of camera.hpp, pixels. Of a point in the plane of the camera it is not finite, behind it
/// that of its mirror image.
template <class T>
[[nodiscard]] std::array<T, 2> image_point(const Camera<double>& camera, const std::array<double, 3>& point_world) {
  std::array<double, 3> seen{};
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t j = 0; j < 3; ++j)
      seen[k] += camera.rotation_camera_world[3 * k + j] * (point_world[j] - camera.center_world[j]);
  }
  return {static_cast<T>(camera.fx * seen[0] / seen[2] + camera.cx),
          static_cast<T>(camera.fy * seen[1] / seen[2] + camera.cy)};
}

}  // namespace compmark
