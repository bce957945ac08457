// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cameras as somebody would take photographs of splats that come without any: all round the bulk of what is drawn
// finely, from several heights and distances, looking at it or a little beside it. Where something opaque stands before
// the bulk (a wall of a room, a tree), the camera steps nearer, and then goes elsewhere. Deterministic. Cost: a pass over at most 65,536 splats a camera that is tried.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/splat_table.hpp"
#include "compmark/scene/views_around.hpp"

namespace compmark {

struct CaptureAround {
  std::size_t views = 128;
  int width = 800, height = 800;         ///< pixels
  double field = 50;                     ///< degrees, of the shorter side
  double lowest = -10, highest = 80;     ///< degrees above the horizon; all directions between are as frequent
  double nearest = 0.7, farthest = 1.3;  ///< distances, of that at which the bulk fills the picture
  double aside = 0.3;                    ///< how far the place that is looked at may lie from the middle, of the radius
  double blocked = 0.5;                  ///< share of the picture that opaque splats before the bulk may cover
  std::array<double, 3> up = usual_up;   ///< of length 1
  std::uint64_t seed = 0;
};

namespace detail {

/// Splats that can stand before something: places, radii and areas of one standard deviation.
class Obstacles {
 public:
  explicit Obstacles(const SplatTable& table) {
    constexpr std::size_t most = 65536;
    const std::vector<std::size_t> rows = opaque_rows(table);
    const std::size_t step = std::max<std::size_t>(1, (rows.size() + most - 1) / most);
    for (std::size_t at = 0; at < rows.size(); at += step) {
      const std::size_t i = rows[at];
      std::array<double, 3> scale{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        place_.push_back(static_cast<double>(table.mean[axis][i]));
        scale[axis] = std::exp(static_cast<double>(table.log_scale[axis][i]));
      }
      std::sort(scale.begin(), scale.end());
      // The ellipse of two standard deviations, of the two larger ones: what an opaque splat covers at most.
      area_.push_back(4 * std::numbers::pi * scale[1] * scale[2] * static_cast<double>(step));
    }
  }
  /// Share of the picture that what lies nearer than `distance` covers: a sum of areas, so it may exceed 1.
  [[nodiscard]] double before(const Camera<double>& camera, double distance) const {
    double sum = 0;
    const auto& r = camera.rotation_camera_world;
    for (std::size_t i = 0; i < area_.size(); ++i) {
      std::array<double, 3> v{};
      for (std::size_t axis = 0; axis < 3; ++axis) v[axis] = place_[3 * i + axis] - camera.center_world[axis];
      if (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] < area_[i] / std::numbers::pi) {  // the camera is in it
        sum += 1;
        continue;
      }
      const double z = r[6] * v[0] + r[7] * v[1] + r[8] * v[2];
      if (!(z > 0) || z >= distance) continue;
      const double x = camera.fx * (r[0] * v[0] + r[1] * v[1] + r[2] * v[2]) / z;
      const double y = camera.fy * (r[3] * v[0] + r[4] * v[1] + r[5] * v[2]) / z;
      const double radius = camera.fx * std::sqrt(area_[i] / std::numbers::pi) / z;
      if (std::abs(x) - radius > camera.width / 2.0 || std::abs(y) - radius > camera.height / 2.0) continue;
      const double pixels = static_cast<double>(camera.width) * static_cast<double>(camera.height);
      sum += std::min(pixels, area_[i] * camera.fx * camera.fy / (z * z)) / pixels;
    }
    return sum;
  }

 private:
  std::vector<double> place_, area_;  // [n, 3], [n]
};

}  // namespace detail

/// The cameras, in an order in which every eighth is spread as evenly as all of them.
[[nodiscard]] inline std::vector<Camera<double>> capture_around(const SplatTable& table,
                                                                const CaptureAround& settings = {}) {
  constexpr std::size_t directions = 8, steps = 4;  // tried for a camera
  constexpr double step = 0.75;
  const SplatBulk bulk = splat_bulk(table, 1.0 / 3);
  const detail::Obstacles obstacles(table);
  const PictureShape shape{settings.width, settings.height, settings.field};
  const double degree = std::numbers::pi / 180;
  const double filling = 1.1 * bulk.radius / std::sin(settings.field / 2 * degree);
  const double low = std::sin(settings.lowest * degree), high = std::sin(settings.highest * degree);
  std::vector<Camera<double>> cameras;
  for (std::size_t view = 0; view < settings.views; ++view) {
    Camera<double> best;
    double least = 0;
    for (std::size_t trial = 0; trial < directions && (trial == 0 || least > settings.blocked); ++trial) {
      const Random random(settings.seed, view, random_stage("scene/capture_around"));
      const std::uint64_t first = 16 * trial;
      // The additive sequence of the plastic number spreads directions evenly; later trials are drawn.
      constexpr double a = 0.7548776662466927, b = 0.5698402909980532;
      const double n = static_cast<double>(view) + 0.5;
      const double u = trial == 0 ? n * a - std::floor(n * a) : random.uniform(first);
      const double v = trial == 0 ? n * b - std::floor(n * b) : random.uniform(first + 1);
      const double azimuth = 2 * std::numbers::pi * u, sine = low + (high - low) * v;
      const std::array<double, 3> away = direction_about(settings.up, azimuth, sine);
      double distance =
          filling * (settings.nearest + (settings.farthest - settings.nearest) * random.uniform(first + 2));
      std::array<double, 3> target = bulk.center;
      for (std::size_t axis = 0; axis < 3; ++axis)
        target[axis] += settings.aside * bulk.radius * (2 * random.uniform(first + 3 + axis) - 1);
      for (std::size_t nearer = 0; nearer < steps; ++nearer, distance *= step) {
        std::array<double, 3> place = bulk.center;
        for (std::size_t axis = 0; axis < 3; ++axis) place[axis] += distance * away[axis];
        const Camera<double> camera = camera_towards(place, target, settings.up, shape);
        const double covered = obstacles.before(camera, std::max(distance - 1.3 * bulk.radius, 0.25 * distance));
        if ((trial == 0 && nearer == 0) || covered < least) {
          best = camera;
          least = covered;
        }
        if (covered <= settings.blocked) break;
      }
    }
    cameras.push_back(best);
  }
  return cameras;
}

}  // namespace compmark
