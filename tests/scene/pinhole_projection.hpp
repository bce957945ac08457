// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <compmark/scene/camera.hpp>
#include <cstddef>

namespace compmark::testing {

/// Where a pinhole sees a point, written independently of the code that is tested: column, row and depth.
inline std::array<double, 3> project(const Camera<double>& camera, const std::array<double, 3>& point) {
  std::array<double, 3> p{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j)
      p[i] += camera.rotation_camera_world[3 * i + j] * (point[j] - camera.center_world[j]);
  }
  return {camera.fx * p[0] / p[2] + camera.cx, camera.fy * p[1] / p[2] + camera.cy, p[2]};
}

}  // namespace compmark::testing
