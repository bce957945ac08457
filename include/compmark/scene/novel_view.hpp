// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Sampled novel views: cameras between and around neighbouring training cameras. A loss that needs no photograph, such
// as that of the message, can be evaluated in them, and then also holds between the photographs
// (docs/notebook/watermark_experiments.md). Position and axes are interpolated, the latter along the shorter arc; the
// intrinsics are those of the first camera. Cost: O(views) for a choice and for a distance; O(views^2) once for the
// clearances.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/random.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark {

/// `from` moved towards `to` by `fraction`: at 0 it is `from` to the bit, at 1 it stands and looks as `to` does (half a
/// turn away it looks as `from`), above 1 it is beyond. Works on LensCamera too; the lens stays.
template <class AnyCamera>
[[nodiscard]] AnyCamera camera_between(const AnyCamera& from, const AnyCamera& to, double fraction) {
  AnyCamera camera = from;
  if (fraction <= 0) return camera;
  // The rotation from one to the other, by its axis and angle (Rodrigues), the fraction of it, and then the first.
  const std::array<double, 9>&a = from.rotation_camera_world, &b = to.rotation_camera_world;
  std::array<double, 9> turn{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t k = 0; k < 3; ++k) turn[3 * r + c] += b[3 * r + k] * a[3 * c + k];
  std::array<double, 3> axis{(turn[7] - turn[5]) / 2, (turn[2] - turn[6]) / 2, (turn[3] - turn[1]) / 2};
  const double sine = std::hypot(axis[0], axis[1], axis[2]);
  const double angle = fraction * std::atan2(sine, (turn[0] + turn[4] + turn[8] - 1) / 2);
  if (sine > 1e-12) {  // else the same axes, or half a turn, which has no shorter arc: those of `from`
    for (double& x : axis) x /= sine;
    const double s = std::sin(angle), v = 1 - std::cos(angle);
    const std::array<double, 9> cross{0, -axis[2], axis[1], axis[2], 0, -axis[0], -axis[1], axis[0], 0};
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) {
        double sum = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const double same = r == k ? 1 : 0;
          sum += (same + s * cross[3 * r + k] + v * (axis[r] * axis[k] - same)) * a[3 * k + c];
        }
        camera.rotation_camera_world[3 * r + c] = sum;
      }
  }
  for (std::size_t c = 0; c < 3; ++c)
    camera.center_world[c] = (1 - fraction) * from.center_world[c] + fraction * to.center_world[c];
  return camera;
}

namespace detail {
inline constexpr double same_way =
    0.5;  ///< least cosine between the directions of two cameras that see the same things
}

/// Up to six views that stand closest to one and look the same way within 60 degrees, nearest first.
struct NearestViews {
  static constexpr std::size_t most = 6;
  std::array<double, most> square{};  ///< of the distance
  std::array<std::size_t, most> index{};
  std::size_t count = 0;
};
/// `cameras(i)` gives the camera of view i < views.
template <class Cameras>
[[nodiscard]] NearestViews nearest_views(const Cameras& cameras, std::size_t views, std::size_t view) {
  NearestViews found;
  found.square.fill(std::numeric_limits<double>::infinity());
  const Camera<double> self = cameras(view);
  for (std::size_t i = 0; i < views; ++i) {
    if (i == view) continue;
    const Camera<double> other = cameras(i);
    double square = 0, cosine = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double d = other.center_world[c] - self.center_world[c];
      square += d * d;
      cosine += other.rotation_camera_world[6 + c] * self.rotation_camera_world[6 + c];  // the viewing directions
    }
    if (!(cosine >= detail::same_way) || !(square < found.square.back())) continue;
    std::size_t place = found.count < NearestViews::most ? found.count++ : NearestViews::most - 1;
    for (; place > 0 && square < found.square[place - 1]; --place) {
      found.square[place] = found.square[place - 1];
      found.index[place] = found.index[place - 1];
    }
    found.square[place] = square;
    found.index[place] = i;
  }
  return found;
}
/// One of those of `view`, drawn with number `draw` of `random`; `view` itself where there is none.
[[nodiscard]] inline std::size_t neighbouring_view(const NearestViews& near, std::size_t view, const Random& random,
                                                   std::uint64_t draw) {
  return near.count == 0 ? view : near.index[random.below(draw, near.count)];
}
template <class Cameras>
[[nodiscard]] std::size_t neighbouring_view(const Cameras& cameras, std::size_t views, std::size_t view,
                                            const Random& random, std::uint64_t draw = 0) {
  return neighbouring_view(nearest_views(cameras, views, view), view, random, draw);
}

/// The clearance round every view: the square of its distance to the third nearest other view, which is an area where
/// views stand on a surface. It is at least a quarter of the median and at most sixteen medians, so that no view is
/// left out and none dominates. Views that are drawn in proportion to it cover the gaps of a capture, where the cover
/// interference is known least. A limit of four medians left them thin; sixty-four took too many views from the rest
/// (docs/notebook/watermark_experiments.md).
class ViewClearance {
 public:
  ViewClearance() = default;
  /// `cameras(i)` gives the camera of view i < views.
  template <class Cameras>
  ViewClearance(const Cameras& cameras, std::size_t views) {
    std::vector<std::array<double, 3>> centers;
    for (std::size_t i = 0; i < views; ++i) centers.push_back(cameras(i).center_world);
    measure(centers);
  }
  [[nodiscard]] bool empty() const { return summed_.empty(); }
  /// The view at `uniform` in [0, 1), drawn in proportion to clearance. Needs at least one view.
  [[nodiscard]] std::size_t view(double uniform) const {
    const auto found = std::upper_bound(summed_.begin(), summed_.end(), uniform * summed_.back());
    return std::min(static_cast<std::size_t>(found - summed_.begin()), summed_.size() - 1);
  }
  /// The same with the clearance of every view times its `factor`; an empty `factor` changes nothing.
  [[nodiscard]] std::size_t view(double uniform, std::span<const double> factor) const {
    if (factor.empty()) return view(uniform);
    COMPMARK_ASSERT(factor.size() == summed_.size(), "ViewClearance: a factor for every view");
    const auto clearance = [&](std::size_t i) { return (summed_[i] - (i > 0 ? summed_[i - 1] : 0)) * factor[i]; };
    double sum = 0;
    for (std::size_t i = 0; i < summed_.size(); ++i) sum += clearance(i);
    double passed = clearance(0);
    std::size_t i = 0;
    while (i + 1 < summed_.size() && passed <= uniform * sum) passed += clearance(++i);
    return i;
  }

 private:
  void measure(std::span<const std::array<double, 3>> centers) {
    constexpr std::size_t nearest = 3;
    for (std::size_t i = 0; i < centers.size(); ++i) {
      std::vector<double> squares;
      for (std::size_t j = 0; j < centers.size(); ++j) {
        if (j == i) continue;
        double square = 0;
        for (std::size_t c = 0; c < 3; ++c) square += (centers[j][c] - centers[i][c]) * (centers[j][c] - centers[i][c]);
        squares.push_back(square);
      }
      const std::size_t third = std::min(nearest, squares.size());
      if (third > 0)
        std::nth_element(squares.begin(), squares.begin() + static_cast<std::ptrdiff_t>(third - 1), squares.end());
      summed_.push_back(third > 0 ? squares[third - 1] : 0);
    }
    std::vector<double> sorted = summed_;
    std::sort(sorted.begin(), sorted.end());
    const double median = sorted.empty() ? 0 : sorted[sorted.size() / 2];
    double sum = 0;
    for (double& clearance : summed_) {
      sum += median > 0 ? std::clamp(clearance, median / 4, 16 * median) : 1;  // half stand in one place: all equal
      clearance = sum;
    }
  }

  std::vector<double> summed_;  ///< of the views up to each
};

/// The distance of a camera from the photographs: to the nearest training view that looks the same way within 60
/// degrees, in medians of that distance between the training views. The error of a trained scene grows with it
/// (docs/notebook/watermark_experiments.md).
class PhotographDistance {
 public:
  PhotographDistance() = default;
  /// `cameras(i)` gives the camera of view i < views.
  template <class Cameras>
  PhotographDistance(const Cameras& cameras, std::size_t views) {
    for (std::size_t i = 0; i < views; ++i) {
      const Camera<double> camera = cameras(i);
      center_.push_back(camera.center_world);
      direction_.push_back(direction_of(camera));
    }
    measure();
  }

  [[nodiscard]] bool empty() const { return center_.empty(); }
  /// 0 at a photograph, infinite where no view looks that way. It is 1 everywhere if the photographs define no
  /// distance: most of them were taken from one place, or fewer than half have another one that looks the same way.
  template <class AnyCamera>
  [[nodiscard]] double medians(const AnyCamera& camera) const {
    if (median_ == 0) return 1;
    return nearest(camera.center_world, direction_of(camera), center_.size()) / median_;
  }

 private:
  /// The median between the views.
  void measure() {
    std::vector<double> apart;
    for (std::size_t i = 0; i < center_.size(); ++i) {
      const double distance = nearest(center_[i], direction_[i], i);
      if (std::isfinite(distance)) apart.push_back(distance);
    }
    if (apart.empty() || 2 * apart.size() < center_.size()) return;
    const auto middle = apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2);
    std::nth_element(apart.begin(), middle, apart.end());
    median_ = *middle;
  }
  template <class AnyCamera>
  [[nodiscard]] static std::array<double, 3> direction_of(const AnyCamera& camera) {
    return {camera.rotation_camera_world[6], camera.rotation_camera_world[7], camera.rotation_camera_world[8]};
  }
  [[nodiscard]] double nearest(const std::array<double, 3>& center, const std::array<double, 3>& direction,
                               std::size_t but) const {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < center_.size(); ++i) {
      double square = 0, cosine = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        square += (center_[i][c] - center[c]) * (center_[i][c] - center[c]);
        cosine += direction_[i][c] * direction[c];
      }
      if (i != but && cosine >= detail::same_way) least = std::min(least, square);
    }
    return std::sqrt(least);
  }

  std::vector<std::array<double, 3>> center_, direction_;
  double median_ = 0;
};

/// Turned round its optical axis by `roll_radians`, with the image `zoom` times as large round the principal point.
template <class AnyCamera>
[[nodiscard]] AnyCamera camera_turned(const AnyCamera& from, double roll_radians, double zoom) {
  AnyCamera camera = from;
  const double c = std::cos(roll_radians), s = std::sin(roll_radians);
  for (std::size_t k = 0; k < 3; ++k) {
    const double x = from.rotation_camera_world[k], y = from.rotation_camera_world[3 + k];
    camera.rotation_camera_world[k] = c * x - s * y;
    camera.rotation_camera_world[3 + k] = s * x + c * y;
  }
  camera.fx *= zoom;
  camera.fy *= zoom;
  return camera;
}

namespace detail {
/// Turned by up to 15 degrees and zoomed by up to a fifth either way, by the numbers 4 and 5 of `random`.
template <class AnyCamera>
[[nodiscard]] AnyCamera camera_perturbed(const AnyCamera& camera, const Random& random) {
  constexpr double most_roll = 0.26, most_zoom = 1.2;
  return camera_turned(camera, most_roll * (2 * random.uniform(4) - 1), std::pow(most_zoom, 2 * random.uniform(5) - 1));
}
}  // namespace detail

/// A sampled novel view near view `view`: in the triangle of it and two neighbours, turned by up to 15 degrees and
/// zoomed by up to a fifth either way, so that what is learned there also holds away from the training views. With a
/// `reach` above 1 the triangle is stretched away from `view`, beyond the neighbours, to cover the rim of a capture.
/// The distance from `view` is uniform, not the place in the triangle: otherwise a view that stands alone would hardly
/// ever have a sample close to it (docs/notebook/watermark_experiments.md).
template <class Cameras>
[[nodiscard]] auto novel_view_camera(const Cameras& cameras, std::size_t views, std::size_t view, const Random& random,
                                     double reach = 1) {
  const NearestViews near = nearest_views(cameras, views, view);
  const std::size_t second = neighbouring_view(near, view, random, 0);
  const std::size_t third = neighbouring_view(near, view, random, 1);
  const auto side = camera_between(cameras(second), cameras(third), random.uniform(2));
  const auto camera = camera_between(cameras(view), side, reach * random.uniform(3));
  return detail::camera_perturbed(camera, random);
}

}  // namespace compmark
