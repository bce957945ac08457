// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The last steps of every reader. A scene far from the origin of its coordinates is moved to it in double, before
// points become floats (docs/spec/numerics.md, PR7). A very small or very large one is counted in another unit (case
// PR8): near plane, voxel size, volume loss and learning rates of the published training are lengths of scenes whose
// cameras stand about 4 from what they see. Points that are not finite, lie in the centre of a camera (a failed
// triangulation, and no direction to look along: case PR9) or beyond the reach of the scene (math/robust_ball.hpp) are
// dropped, and a camera that stands so far away that it would decide the scene's size does not. Without points, random
// ones are drawn. Cost: O((points + cameras) log cameras).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iomanip>
#include <limits>
#include <numeric>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "compmark/math/robust_ball.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/extent.hpp"
#include "compmark/scene/point_file.hpp"
#include "compmark/scene/random_points.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {
namespace detail {

[[nodiscard]] inline std::vector<std::size_t> all_views(const Dataset& dataset) {
  std::vector<std::size_t> views(dataset.views.size());
  std::iota(views.begin(), views.end(), std::size_t{0});
  return views;
}

/// Mean and largest distance from it of the cameras' centres (middle_spread: medians of both), without those that stand
/// beyond their core (scene/extent.hpp).
struct CameraSpread {
  std::array<double, 3> mean{0, 0, 0};
  double radius = 0;
};
template <class Points>
[[nodiscard]] CameraSpread camera_spread(const Dataset& dataset, const Points& points) {
  std::vector<std::size_t> views = all_views(dataset);
  const CameraCore core = camera_core(dataset, views, points);
  std::erase_if(views, [&](std::size_t i) { return !core.holds(dataset.views[i]); });
  CameraSpread spread;
  double count = 0;
  for (const std::size_t i : views) {
    count += 1;
    const auto& p = dataset.views[i].camera.center_world;
    for (std::size_t c = 0; c < 3; ++c) spread.mean[c] += (p[c] - spread.mean[c]) / count;
  }
  for (const std::size_t i : views) {
    const auto& p = dataset.views[i].camera.center_world;
    spread.radius =
        std::fmax(spread.radius, std::hypot(p[0] - spread.mean[0], p[1] - spread.mean[1], p[2] - spread.mean[2]));
  }
  return spread;
}

[[nodiscard]] inline CameraSpread camera_spread(const Dataset& dataset) {
  return camera_spread(dataset, dataset.points);
}

/// Moves cameras and points so that the cameras' mean is at the origin, where it was more than 100 times the scene's
/// size away from it.
inline void move_to_origin(Dataset& dataset, PrecisePoints& points) {
  const CameraSpread spread = camera_spread(dataset, points);
  const double size = std::fmax(spread.radius, median_distance(points, spread.mean));
  const double away = std::hypot(spread.mean[0], spread.mean[1], spread.mean[2]);
  if (!(size > 0) || !(away > 100 * size)) return;
  dataset.origin = spread.mean;
  for (View& view : dataset.views) {
    for (std::size_t c = 0; c < 3; ++c) view.camera.center_world[c] -= dataset.origin[c];
  }
  for (std::array<double, 3>& p : points.position) {
    for (std::size_t c = 0; c < 3; ++c) p[c] -= dataset.origin[c];
  }
  dataset.warnings.push_back(dataset.root.string() + ": the scene lies " + two_digits(away / size) +
                             " times its size from the origin of its coordinates and is moved to it");
}

/// Sizes between these limits keep their unit. Others are scaled by a power of two to 4 … 8, the size of the published
/// scenes and of ordinary captures. Powers of two keep the scene the same to the bit.
inline constexpr double least_scene_size = 0.1, greatest_scene_size = 100;

/// The median of the cameras' centres along each axis, and the middle camera's distance from it: one camera that was
/// registered far away moves neither, as it would their mean and the largest distance.
[[nodiscard]] inline CameraSpread middle_spread(const Dataset& dataset) {
  CameraSpread spread;
  PrecisePoints centers;
  for (const View& view : dataset.views) centers.position.push_back(view.camera.center_world);
  const std::size_t n = centers.position.size();
  std::vector<double> x(n);
  for (std::size_t c = 0; c < 3 && n > 0; ++c) {
    for (std::size_t i = 0; i < n; ++i) x[i] = centers.position[i][c];
    std::sort(x.begin(), x.end());
    spread.mean[c] = std::midpoint(x[(n - 1) / 2], x[n / 2]);
  }
  spread.radius = median_distance(centers, spread.mean);
  return spread;
}

inline void fit_unit(Dataset& dataset, PrecisePoints& points) {
  const CameraSpread spread = middle_spread(dataset);
  const double around = median_distance(points, spread.mean);
  if (!(std::fmax(spread.radius, around) > 0)) return;  // all cameras in one place and no points: no length is known
  // Without points a small baseline does not mean a small scene: the cameras may look at something far.
  const double size = std::fmax(spread.radius, around > 0 ? around : look_at(dataset).distance);
  const double seen = std::fmax(spread.radius, around);
  if ((size >= least_scene_size && seen <= greatest_scene_size) || !std::isfinite(size)) return;
  dataset.unit = std::ldexp(1.0, std::max(std::ilogb(size) - 2, std::numeric_limits<double>::min_exponent));
  for (View& view : dataset.views) {
    for (double& x : view.camera.center_world) x /= dataset.unit;
  }
  for (std::array<double, 3>& p : points.position) {
    for (double& x : p) x /= dataset.unit;
  }
  dataset.warnings.push_back(
      dataset.root.string() + ": the scene is " + (seen > greatest_scene_size ? "large" : "small") +
      ", so its lengths are counted in units of 2^" + std::to_string(std::ilogb(dataset.unit)) + " of its coordinates");
}

/// A number of scene sizes, for a warning.
[[nodiscard]] inline std::string sizes_text(double value) {
  std::ostringstream text;
  if (value < 1e9) {
    text << std::llround(value);
  } else {
    text << std::setprecision(3) << value;
  }
  return text.str() + " scene sizes";
}
/// "1 of 9262 points lies 31800 scene sizes away".
[[nodiscard]] inline std::string far_points_text(std::size_t far, std::size_t all, double farthest) {
  return std::to_string(far) + " of " + std::to_string(all) + (far == 1 ? " points lies " : " points lie up to ") +
         sizes_text(farthest) + " away";
}

/// Warns of cameras that stand beyond the core of the others.
inline void name_far_cameras(Dataset& dataset) {
  const std::vector<std::size_t> views = all_views(dataset);
  const CameraCore core = camera_core(dataset, views, dataset.points);
  std::size_t far = 0, first = 0;
  for (const std::size_t i : views) {
    if (!core.holds(dataset.views[i]) && far++ == 0) first = i;
  }
  if (far == 0) return;
  const View& view = dataset.views[first];
  dataset.warnings.push_back(dataset.root.string() + ": the camera of \"" + view.name + "\" stands " +
                             sizes_text(core.ball.distance(view.camera.center_world.data()) / core.size) +
                             " away from the others" +
                             (far > 1 ? ", as " + std::to_string(far - 1) + " more do," : "") +
                             " and does not count for the scene's extent; its photograph is still trained on");
}

/// Points as floats, without those that no camera can use: not finite, in the centre of a camera, or beyond the reach
/// of the scene (math/robust_ball.hpp), whose size is that of the points or the distance of the middle camera from
/// their middle.
inline void take_points(Dataset& dataset, PrecisePoints points) {
  std::vector<std::array<double, 3>> centers;
  for (const View& view : dataset.views) centers.push_back(view.camera.center_world);
  std::sort(centers.begin(), centers.end());
  const CameraSpread spread = camera_spread(dataset, points);
  const RobustBall ball = robust_ball(
      points.position.size(), [&](std::size_t i) -> const auto& { return points.position[i]; });
  PrecisePoints cameras;
  cameras.position = centers;
  const double size = median_distance(cameras, ball.center), reach = ball.reach(size);
  double farthest = 0;
  // A millionth of the scene: far below a pixel from anywhere else, far above the rounding of positions stored in
  // double.
  const double near = 1e-6 * std::fmax(spread.radius, median_distance(points, spread.mean));
  const auto at_camera = [&](const std::array<double, 3>& p) {
    auto candidate =
        std::lower_bound(centers.begin(), centers.end(), std::array<double, 3>{p[0] - near, -HUGE_VAL, -HUGE_VAL});
    for (; candidate != centers.end() && (*candidate)[0] <= p[0] + near; ++candidate) {
      if (std::hypot((*candidate)[0] - p[0], (*candidate)[1] - p[1], (*candidate)[2] - p[2]) <= near) return true;
    }
    return false;
  };
  std::size_t not_finite = points.left_out, at_cameras = 0, far = 0;
  for (std::size_t i = 0; i < points.position.size(); ++i) {
    const std::array<double, 3>& p = points.position[i];
    const std::array<float, 3> rounded{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    if (!std::isfinite(rounded[0]) || !std::isfinite(rounded[1]) || !std::isfinite(rounded[2])) {
      ++not_finite;
    } else if (const double distance = ball.distance(p.data()); distance > reach) {
      ++far;
      farthest = std::fmax(farthest, distance);
    } else if (at_camera(p)) {
      ++at_cameras;
    } else {
      dataset.points.position.push_back(rounded);
      dataset.points.color.push_back(points.color[i]);
    }
  }
  // Several in one place, to a millionth of the cameras' distance: a point that was written for all of them.
  const std::vector<std::array<float, 3>>& kept = dataset.points.position;
  if (kept.size() > 1 && size > 0 && std::all_of(kept.begin(), kept.end(), [&](const std::array<float, 3>& p) {
        return std::hypot(p[0] - kept[0][0], p[1] - kept[0][1], p[2] - kept[0][2]) <= 1e-6 * size;
      })) {
    dataset.warnings.push_back(dataset.root.string() + ": all " + std::to_string(kept.size()) +
                               " points are in one place and are left out");
    dataset.points = {};
  }
  if (not_finite > 0)
    dataset.warnings.push_back(dataset.root.string() + ": " + std::to_string(not_finite) +
                               " points that are not finite are left out");
  if (far > 0)
    dataset.warnings.push_back(
        dataset.root.string() + ": " +
        far_points_text(far, points.position.size(), farthest / std::fmax(std::fmin(ball.wide, ball.middle), size)) +
        (far == 1 ? " and is left out" : " and are left out"));
  if (at_cameras > 0)
    dataset.warnings.push_back(dataset.root.string() + ": " + std::to_string(at_cameras) +
                               " points in the centres of cameras are left out");
}

/// Everything after the views are there. Without usable points, random ones around what the cameras look at.
inline void finish_dataset(Dataset& dataset, PrecisePoints points, const DatasetSettings& settings) {
  move_to_origin(dataset, points);
  fit_unit(dataset, points);
  const bool had_points = !points.position.empty() || points.left_out > 0;
  take_points(dataset, std::move(points));
  name_far_cameras(dataset);
  if (dataset.points.size() > 0) return;
  dataset.points = random_points(dataset, settings.random_points, settings.seed);
  dataset.points_are_random = true;
  dataset.warnings.push_back(dataset.root.string() + ": there are no " + (had_points ? "usable " : "") +
                             "points to start from, random ones are used");
}

}  // namespace detail
}  // namespace compmark
