// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What an unbounded scene starts with beyond its points: the ball that its cameras stand in, and points far behind everything for what
// structure from motion does not find, sky above all. The far points are a Fibonacci lattice of directions on a sphere of many radii, of
// which those stay that cameras see through parts of their images without any point: a direction is dropped where most of the cameras that
// look that way have a point of the scene near it. Cost: O(cameras (points + directions)).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "compmark/scene/dataset.hpp"
#include "compmark/scene/extent.hpp"
#include "compmark/scene/random_points.hpp"

namespace compmark::inline v0 {

/// The ball of the training cameras. Cameras that stand in one place have one of half the distance to what they look at.
struct CameraBall {
  std::array<double, 3> origin{0, 0, 0};
  double radius = 1;
};
[[nodiscard]] inline CameraBall camera_ball(const Dataset& dataset) {
  const SceneExtent extent = camera_extent(dataset);
  const double radius = extent.radius > 0 ? extent.radius : 0.5 * look_at(dataset).distance;
  return {extent.center, radius > 0 ? radius : 1};
}

struct FarPointSettings {
  std::size_t directions = 4096;  ///< over the whole sphere, before those that nobody sees are dropped
  double radii = 100;  ///< distance in radii of the camera ball: at a focal length of 400 pixels, 4 pixels of parallax
  int image_cells = 24;  ///< along the longer side of an image: how near a point of the scene covers a direction
};

namespace detail {

/// Pixel of a point, as a cell of a coarse grid over the image; false if it is behind the camera or outside.
struct CoarseImage {
  double pixels = 1;  ///< edge of a cell
  std::size_t columns = 0, rows = 0;
  CoarseImage(const Camera<double>& camera, int cells)
      : pixels(static_cast<double>(camera.width > camera.height ? camera.width : camera.height) / cells),
        columns(static_cast<std::size_t>(camera.width / pixels) + 1),
        rows(static_cast<std::size_t>(camera.height / pixels) + 1) {}
  [[nodiscard]] bool cell(const Camera<double>& camera, const std::array<double, 3>& point, std::size_t& index) const {
    std::array<double, 3> p{};
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j)
        p[i] += camera.rotation_camera_world[3 * i + j] * (point[j] - camera.center_world[j]);
    }
    if (!(p[2] > 0)) return false;
    const double x = camera.fx * p[0] / p[2] + camera.cx, y = camera.fy * p[1] / p[2] + camera.cy;
    if (!(x >= 0 && y >= 0 && x < camera.width && y < camera.height)) return false;
    index = static_cast<std::size_t>(y / pixels) * columns + static_cast<std::size_t>(x / pixels);
    return true;
  }
};

}  // namespace detail

/// Far points for a dataset, in the order of their height; grey.
[[nodiscard]] inline PointCloud far_points(const Dataset& dataset, const FarPointSettings& settings = {}) {
  const CameraBall ball = camera_ball(dataset);
  const double n = static_cast<double>(settings.directions);
  const auto place = [&](std::size_t i) {
    const double z = 1 - (2 * static_cast<double>(i) + 1) / n, flat = std::sqrt(1 - z * z);
    const double angle = 2 * std::numbers::pi * std::fmod(static_cast<double>(i) * (std::numbers::phi - 1), 1.0);
    const double distance = settings.radii * ball.radius;
    return std::array<double, 3>{ball.origin[0] + distance * flat * std::cos(angle),
                                 ball.origin[1] + distance * flat * std::sin(angle), ball.origin[2] + distance * z};
  };
  std::vector<std::uint32_t> seen(settings.directions), empty(settings.directions);
  std::vector<std::uint8_t> covered;
  for (const View& view : dataset.views) {
    if (view.split != Split::train) continue;
    const detail::CoarseImage coarse(view.camera, settings.image_cells);
    covered.assign(coarse.columns * coarse.rows, 0);
    std::size_t at = 0;
    for (const std::array<float, 3>& p : dataset.points.position) {
      const std::array<double, 3> point{static_cast<double>(p[0]), static_cast<double>(p[1]),
                                        static_cast<double>(p[2])};
      if (!dataset.points_are_random && coarse.cell(view.camera, point, at)) covered[at] = 1;
    }
    for (std::size_t i = 0; i < settings.directions; ++i) {
      if (!coarse.cell(view.camera, place(i), at)) continue;
      ++seen[i];
      empty[i] += covered[at] == 0;
    }
  }
  PointCloud points;
  for (std::size_t i = 0; i < settings.directions; ++i) {
    if (seen[i] == 0 || 2 * empty[i] < seen[i]) continue;
    const std::array<double, 3> p = place(i);
    points.position.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
    points.color.push_back({127, 127, 127});
  }
  return points;
}

}  // namespace compmark::inline v0
