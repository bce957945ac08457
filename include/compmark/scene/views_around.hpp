// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cameras round splats that come without any: two rings about the bulk of what is opaque, looking at its middle. Up is
// -y, as in the captures of the standard PLY, unless another is given. The bulk is robust: single splats far away, of which every training has
// some, move no camera. Cost: O(splats).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <vector>

#include "compmark/math/robust_ball.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"

namespace compmark {

/// Up in the captures of the standard PLY: of length 1, as every direction here.
inline constexpr std::array<double, 3> usual_up{0, -1, 0};

struct ViewsAround {
  std::size_t views = 16;
  int size = 800;              ///< pixels on a side
  double field = 50;           ///< degrees from side to side
  double low = 15, high = 40;  ///< degrees above the horizon, in turns
  std::array<double, 3> up = usual_up;
};

/// Pixels, and degrees of the shorter side.
struct PictureShape {
  int width = 800, height = 800;
  double field = 50;
};

namespace detail {
[[nodiscard]] inline std::array<double, 3> cross(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
/// Of length 1, or nothing where there is no direction.
[[nodiscard]] inline std::optional<std::array<double, 3>> unit(std::array<double, 3> a) {
  const double length = std::hypot(a[0], a[1], a[2]);
  if (!(length > 1e-9)) return std::nullopt;
  for (double& x : a) x /= length;
  return a;
}
/// A level direction: the axis z made level, or x where z is up.
[[nodiscard]] inline std::array<double, 3> level_direction(const std::array<double, 3>& up) {
  for (const std::array<double, 3>& axis : {std::array<double, 3>{0, 0, -1}, std::array<double, 3>{1, 0, 0}}) {
    const double along = axis[0] * up[0] + axis[1] * up[1] + axis[2] * up[2];
    if (std::abs(along) > 0.9) continue;
    return *unit({axis[0] - along * up[0], axis[1] - along * up[1], axis[2] - along * up[2]});
  }
  return {0, 0, -1};
}
}  // namespace detail

/// The direction at this azimuth, radians, and this sine of the elevation, about an axis.
[[nodiscard]] inline std::array<double, 3> direction_about(const std::array<double, 3>& up, double azimuth,
                                                           double sine) {
  const std::array<double, 3> ahead = detail::level_direction(up), aside = detail::cross(up, ahead);
  const double cosine = std::sqrt(std::fmax(0.0, 1 - sine * sine));
  std::array<double, 3> direction{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    direction[axis] = sine * up[axis] + cosine * (std::cos(azimuth) * ahead[axis] + std::sin(azimuth) * aside[axis]);
  return direction;
}

/// A camera at `place` that looks at `target`, upright. Where it looks straight up or down, or nowhere, right is any
/// level direction.
[[nodiscard]] inline Camera<double> camera_towards(const std::array<double, 3>& place,
                                                   const std::array<double, 3>& target, const std::array<double, 3>& up,
                                                   const PictureShape& shape) {
  Camera<double> camera;
  camera.width = shape.width;
  camera.height = shape.height;
  camera.cx = shape.width / 2.0;
  camera.cy = shape.height / 2.0;
  camera.fx = camera.fy =
      std::min(shape.width, shape.height) / 2.0 / std::tan(shape.field / 2 * std::numbers::pi / 180);
  camera.center_world = place;
  const std::array<double, 3> ahead = detail::unit({target[0] - place[0], target[1] - place[1], target[2] - place[2]})
                                          .value_or(detail::level_direction(up));
  const std::array<double, 3> right =
      detail::unit(detail::cross(ahead, up)).value_or(detail::cross(detail::level_direction(up), up));
  const std::array<double, 3> down = detail::cross(ahead, right);
  camera.rotation_camera_world = {right[0], right[1], right[2], down[0], down[1],
                                  down[2],  ahead[0], ahead[1], ahead[2]};
  return camera;
}

/// The middle of a table by coordinates, and the radius that four in five of its splats lie within; world units.
struct SplatBulk {
  std::array<double, 3> center{0, 0, 0};
  double radius = 1;
};

/// The rows that are at least half opaque, or all of them where none is: what a table shows.
[[nodiscard]] inline std::vector<std::size_t> opaque_rows(const SplatTable& table) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < table.count; ++i) {
    if (table.opacity[i] >= 0) rows.push_back(i);
  }
  for (std::size_t i = 0; rows.empty() && i < table.count; ++i) rows.push_back(i);
  return rows;
}

/// Of the splats that are at least half opaque, or of all where none is; of those the `finest` share by volume, which
/// is what photographs came near to.
[[nodiscard]] inline SplatBulk splat_bulk(const SplatTable& table, double finest = 1) {
  std::vector<std::size_t> rows = opaque_rows(table);
  if (finest < 1) {
    const auto kept = static_cast<std::size_t>(std::ceil(finest * static_cast<double>(rows.size())));
    const auto volume = [&](std::size_t i) {
      return static_cast<double>(table.log_scale[0][i]) + static_cast<double>(table.log_scale[1][i]) +
             static_cast<double>(table.log_scale[2][i]);
    };
    std::stable_sort(rows.begin(), rows.end(), [&](std::size_t a, std::size_t b) { return volume(a) < volume(b); });
    rows.resize(kept);
  }
  SplatBulk bulk;
  if (rows.empty()) return bulk;
  std::vector<double> values(rows.size());
  const auto at = [&](double part) { return detail::lower_quantile(values, part); };
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
  const double degree = std::numbers::pi / 180;
  const PictureShape shape{settings.size, settings.size, settings.field};
  const double distance = 1.1 * bulk.radius / std::sin(settings.field / 2 * degree);
  std::vector<Camera<double>> cameras;
  for (std::size_t i = 0; i < settings.views; ++i) {
    const double azimuth = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(settings.views);
    const double elevation = (i % 2 == 0 ? settings.low : settings.high) * degree;
    std::array<double, 3> place = direction_about(settings.up, azimuth, std::sin(elevation));
    for (std::size_t axis = 0; axis < 3; ++axis) place[axis] = bulk.center[axis] + distance * place[axis];
    cameras.push_back(camera_towards(place, bulk.center, settings.up, shape));
  }
  return cameras;
}

}  // namespace compmark
