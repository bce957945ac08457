// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Initial points for a dataset without any: uniform in a cube, from (seed, index). For Blender scenes the cube is the
// published [-1.3, 1.3]^3 (docs/spec/method.md, 3.5). For others it is centred on the point nearest to all optical
// axes, by least squares, which is held towards a place in front of the cameras where the axes are nearly parallel.
// Blender scenes in another unit than their own (Dataset::unit) also have such a cube, in the published proportion to
// the cameras' distance.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "compmark/core/random.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/pose.hpp"

namespace compmark {

/// `count` points uniform in the cube [-half_size, half_size]^3, grey. The i-th point depends on (seed, i) alone.
[[nodiscard]] inline PointCloud random_points(std::size_t count, double half_size, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("random points"));
  PointCloud points;
  points.color.assign(count, {127, 127, 127});
  points.position.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto coordinate = [&](std::size_t c) {
      return static_cast<float>((2 * random.uniform(3 * i + c) - 1) * half_size);
    };
    points.position.push_back({coordinate(0), coordinate(1), coordinate(2)});
  }
  return points;
}

/// The point that the cameras of a dataset look at.
struct LookAt {
  std::array<double, 3> center{0, 0, 0};
  double distance = 1;  ///< mean distance of the cameras from it
};

[[nodiscard]] inline LookAt look_at(const Dataset& dataset) {
  LookAt result;
  if (dataset.views.empty()) return result;
  const double n = static_cast<double>(dataset.views.size());
  std::array<double, 3> mean{}, forward{};
  for (const View& view : dataset.views) {
    for (std::size_t c = 0; c < 3; ++c) {
      mean[c] += view.camera.center_world[c] / n;
      forward[c] += view.camera.rotation_camera_world[6 + c] / n;
    }
  }
  double spread = 0;
  for (const View& view : dataset.views) {
    const auto& p = view.camera.center_world;
    spread = std::fmax(spread, std::hypot(p[0] - mean[0], p[1] - mean[1], p[2] - mean[2]));
  }
  if (!(spread > 0)) spread = 1;
  constexpr double hold = 1e-3;  // of the weight of all axes: decides only along directions that no pair of axes fixes
  Matrix3 normal{hold, 0, 0, 0, hold, 0, 0, 0, hold};
  std::array<double, 3> right{};  // relative to the mean, so that a far origin costs no digits
  for (std::size_t c = 0; c < 3; ++c) right[c] = hold * 2 * spread * forward[c];
  for (const View& view : dataset.views) {
    const double* d = view.camera.rotation_camera_world.data() + 6;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const double m = ((i == j ? 1.0 : 0.0) - d[i] * d[j]) / n;
        normal[3 * i + j] += m;
        right[i] += m * (view.camera.center_world[j] - mean[j]);
      }
    }
  }
  const Matrix3 inverse = detail::cofactors(normal);  // symmetric: its own transpose
  const double determinant = detail::determinant(normal);
  for (std::size_t i = 0; i < 3; ++i) {
    result.center[i] = mean[i];
    for (std::size_t j = 0; j < 3; ++j) result.center[i] += inverse[3 * i + j] / determinant * right[j];
  }
  result.distance = 0;
  for (const View& view : dataset.views) {
    const auto& p = view.camera.center_world;
    result.distance += std::hypot(p[0] - result.center[0], p[1] - result.center[1], p[2] - result.center[2]) / n;
  }
  if (!(result.distance > 0)) result.distance = spread;
  return result;
}

/// Half of the published cube's edge, and the same as a share of the distance at which the cameras of those scenes
/// stand.
inline constexpr double published_cube = 1.3, published_reach = published_cube / 4.03;

/// Random points in the cube around what the cameras look at, whose half edge is `reach` of their distance from there.
[[nodiscard]] inline PointCloud random_points(const Dataset& dataset, std::size_t count, std::uint64_t seed,
                                              double reach = 1) {
  const LookAt at = look_at(dataset);
  PointCloud points = random_points(count, 1, seed);
  for (std::array<float, 3>& p : points.position) {
    for (std::size_t c = 0; c < 3; ++c)
      p[c] = static_cast<float>(at.center[c] + reach * at.distance * static_cast<double>(p[c]));
  }
  return points;
}

}  // namespace compmark
