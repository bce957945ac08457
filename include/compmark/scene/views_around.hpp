// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cameras round splats that come without any: two rings about the bulk of what is opaque, looking at its middle. Up is
// -y, as in the captures of the standard PLY. The bulk is robust: single splats far away, of which every training has
// some, move no camera. Cost: O(splats).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"

namespace compmark {

struct ViewsAround {
  std::size_t views = 16;
  int size = 800;              ///< pixels on a side
  double field = 50;           ///< degrees from side to side
  double low = 15, high = 40;  ///< degrees above the horizon, in turns
};

/// The middle of a table by coordinates, and the radius that four in five of its splats lie within; world units.
struct SplatBulk {
  std::array<double, 3> center{0, 0, 0};
  double radius = 1;
};

/// Of the splats that are at least half opaque, or of all where none is.
[[nodiscard]] inline SplatBulk splat_bulk(const SplatTable& table) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < table.count; ++i) {
    if (table.opacity[i] >= 0) rows.push_back(i);
  }
  for (std::size_t i = 0; rows.empty() && i < table.count; ++i) rows.push_back(i);
  SplatBulk bulk;
  if (rows.empty()) return bulk;
  std::vector<double> values(rows.size());
  const auto at = [&](double part) {
    const auto place = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), place, values.end());
    return *place;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < rows.size(); ++i) values[i] = static_cast<double>(table.mean[axis][rows[i]]);
    bulk.center[axis] = at(0.5);
  }
  double largest = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::array<double, 3> offset{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      offset[axis] = static_cast<double>(table.mean[axis][rows[i]]) - bulk.center[axis];
      largest = std::max(largest, std::exp(static_cast<double>(table.log_scale[axis][rows[i]])));
    }
    values[i] = std::hypot(offset[0], offset[1], offset[2]);
  }
  bulk.radius = at(0.8);
  if (!(bulk.radius > 0)) bulk.radius = largest > 0 ? 3 * largest : 1;  // one splat, or several in one place
  return bulk;
}

/// Square pinhole cameras whose pictures hold the bulk.
[[nodiscard]] inline std::vector<Camera<double>> cameras_around(const SplatBulk& bulk,
                                                                const ViewsAround& settings = {}) {
  const double degree = std::numbers::pi / 180, half = settings.field / 2 * degree;
  const double distance = 1.1 * bulk.radius / std::sin(half);
  std::vector<Camera<double>> cameras;
  for (std::size_t i = 0; i < settings.views; ++i) {
    const double azimuth = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(settings.views);
    const double elevation = (i % 2 == 0 ? settings.low : settings.high) * degree;
    Camera<double> camera;
    camera.width = camera.height = settings.size;
    camera.cx = camera.cy = settings.size / 2.0;
    camera.fx = camera.fy = settings.size / 2.0 / std::tan(half);
    const double c = std::cos(azimuth), s = std::sin(azimuth), ce = std::cos(elevation), se = std::sin(elevation);
    const std::array<double, 3> away{ce * s, -se, -ce * c};  // from the middle to the camera
    for (std::size_t axis = 0; axis < 3; ++axis) camera.center_world[axis] = bulk.center[axis] + distance * away[axis];
    // Rows: right, down, ahead. Right is level, ahead is -away, down = ahead x right.
    camera.rotation_camera_world = {c, 0, s, se * s, ce, -se * c, -away[0], -away[1], -away[2]};
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace compmark
