// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Sampled novel views that orbit a training view: moved round the point that it and its neighbours look at, in every
// direction alike, as far as its third neighbour stands. novel_view_camera() samples between neighbours; where the
// photographs leave a gap at the rim of a capture no triangle of them covers it. Of 3,000 such samples round 100
// cameras over a hemisphere, 0.1 to 0.4 lie within 6 degrees of the test views that stand in gaps, and 3.6 to 6.9 of
// these (docs/notebook/watermark_experiments.md). Cost: O(views).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include "compmark/core/random.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/novel_view.hpp"

namespace compmark {

/// Depth along the optical axis of `view` that is nearest to the axes of its neighbours, by least squares; infinite
/// where they look in parallel or apart. In world units.
template <class Cameras>
[[nodiscard]] double focus_depth(const Cameras& cameras, std::size_t view, const NearestViews& near) {
  constexpr double parallel = 1e-3;  // mean squared sine: axes within 1.8 degrees
  const Camera<double> self = cameras(view);
  const auto direction = [](const Camera<double>& camera) {
    const std::array<double, 9>& r = camera.rotation_camera_world;
    return std::array<double, 3>{r[6], r[7], r[8]};
  };
  const auto dot = [](const std::array<double, 3>& a, const std::array<double, 3>& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  };
  const std::array<double, 3> axis = direction(self);
  double along = 0, across = 0;
  for (std::size_t n = 0; n < near.count; ++n) {
    const Camera<double> other = cameras(near.index[n]);
    const std::array<double, 3> theirs = direction(other);
    std::array<double, 3> offset{};
    for (std::size_t c = 0; c < 3; ++c) offset[c] = other.center_world[c] - self.center_world[c];
    const double cosine = dot(axis, theirs);
    along += dot(axis, offset) - cosine * dot(theirs, offset);  // of the axis and the offset across the other's axis
    across += 1 - cosine * cosine;
  }
  if (!(across > parallel * static_cast<double>(near.count)) || !(along > 0))
    return std::numeric_limits<double>::infinity();
  return along / across;
}

/// `from` moved by `distance` in the direction of its image plane at `azimuth_radians`, on a circle round the point
/// at `depth` on its optical axis, which stays there; on a line for an infinite depth. At a distance of 0 it is `from`
/// to the bit.
template <class AnyCamera>
[[nodiscard]] AnyCamera camera_orbited(const AnyCamera& from, double depth, double azimuth_radians, double distance) {
  AnyCamera camera = from;
  if (!(distance > 0)) return camera;
  const std::array<double, 9>& r = from.rotation_camera_world;
  const double x = std::cos(azimuth_radians), y = std::sin(azimuth_radians);
  std::array<double, 3> side{}, ahead{r[6], r[7], r[8]};
  for (std::size_t c = 0; c < 3; ++c) side[c] = x * r[c] + y * r[3 + c];
  if (!std::isfinite(depth)) {
    for (std::size_t c = 0; c < 3; ++c) camera.center_world[c] += distance * side[c];
    return camera;
  }
  const double angle = std::min(distance / depth, std::numbers::pi / 3);
  const double s = std::sin(angle), v = 2 * std::sin(angle / 2) * std::sin(angle / 2);  // 1 - cos
  for (std::size_t c = 0; c < 3; ++c) camera.center_world[c] += depth * (v * ahead[c] + s * side[c]);
  for (std::size_t row = 0; row < 3; ++row) {
    double of_side = 0, of_ahead = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      of_side += r[3 * row + c] * side[c];
      of_ahead += r[3 * row + c] * ahead[c];
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const double turned_side = s * ahead[c] - v * side[c], turned_ahead = -s * side[c] - v * ahead[c];
      camera.rotation_camera_world[3 * row + c] += of_side * turned_side + of_ahead * turned_ahead;
    }
  }
  return camera;
}

/// A sampled novel view round view `view`: orbited in a direction and by a distance that are both uniform, up to its
/// third neighbour, turned and zoomed as novel_view_camera() does. The view itself, turned and zoomed, where no other
/// looks its way.
template <class Cameras>
[[nodiscard]] auto orbit_view_camera(const Cameras& cameras, std::size_t views, std::size_t view,
                                     const Random& random) {
  const NearestViews near = nearest_views(cameras, views, view);
  auto camera = cameras(view);
  if (near.count > 0) {
    const double spacing = std::sqrt(near.square[std::min<std::size_t>(3, near.count) - 1]);
    camera = camera_orbited(camera, focus_depth(cameras, view, near), 2 * std::numbers::pi * random.uniform(2),
                            spacing * random.uniform(3));
  }
  return detail::camera_perturbed(camera, random);
}

}  // namespace compmark
