// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A robust size of a set of points. One wrong match among ten thousand is triangulated anywhere and decides a box from
// minimum to maximum. The ball here is centred on the median along each axis, and its radii are quantiles of the
// distances from there. Half of the places would have to be wrong to move the
// centre, a twentieth to move `wide`.
//
//   core()       16 wide: what lies beyond does not count for a size (extent of the cameras, box of a codec's context,
//                first scales)
//   reach(size)  100 max(wide, size), at most 1,000 max(middle, size): what lies beyond is left out, with a warning
//
// `size` is another length that the scene has, of its cameras. Where the factors are from: in the captures at hand the
// farthest point lies at 0.6 to 10.6 times max(wide, median distance of the cameras), and at 1.3 to 10.7 wide (58.7
// where a small object stands in a wide ring of cameras: without its cameras four of its 1,443 points are beyond the
// core). Structure from motion keeps points whose rays meet at 1.5 degrees or more: 76 radii of the cameras. At 1,000
// they meet at 0.1 degrees, and no number of such points has a depth. Cost: O(places), about 50 ns each.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <span>
#include <vector>

namespace compmark {

struct RobustBall {
  std::array<double, 3> center{0, 0, 0};  ///< the median along each axis
  double middle = 0;                      ///< distance of the middle place from it
  double wide = 0;                        ///< distance that 95 % of the places do not exceed

  static constexpr double wide_share = 0.95, core_factor = 16, few_factor = 100, many_factor = 1000;

  /// Distance of a place; infinite where its square is.
  template <class T>
  [[nodiscard]] double distance(const T* place) const {
    const double x = static_cast<double>(place[0]) - center[0], y = static_cast<double>(place[1]) - center[1],
                 z = static_cast<double>(place[2]) - center[2];
    return std::sqrt(x * x + y * y + z * z);
  }
  /// Infinite where the places are one, or there is none: nothing is far then.
  [[nodiscard]] double core(double size = 0) const { return times(core_factor, std::max(wide, size)); }
  [[nodiscard]] double reach(double size = 0) const {
    return std::min(times(few_factor, std::max(wide, size)), times(many_factor, std::max(middle, size)));
  }

 private:
  [[nodiscard]] static double times(double factor, double length) {
    return length > 0 ? factor * length : std::numeric_limits<double>::infinity();
  }
};

namespace detail {

/// The floor(share (n - 1))-th smallest, so that of three values or more the greatest never decides; reorders `values`,
/// which are not empty.
[[nodiscard]] inline double lower_quantile(std::vector<double>& values, double share) {
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(std::floor(share * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The ball of places that are finite.
[[nodiscard]] inline RobustBall ball_of_finite(std::span<const std::array<double, 3>> places) {
  RobustBall ball;
  if (places.empty()) return ball;
  std::vector<double> values(places.size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < places.size(); ++i) values[i] = places[i][axis];
    ball.center[axis] = lower_quantile(values, 0.5);
  }
  for (std::size_t i = 0; i < places.size(); ++i) values[i] = ball.distance(places[i].data());
  ball.middle = lower_quantile(values, 0.5);
  ball.wide = lower_quantile(values, RobustBall::wide_share);
  return ball;
}

}  // namespace detail

/// The ball of `count` places; at(i) gives something whose [0], [1], [2] are coordinates. Places that are not finite do
/// not count.
template <class At>
[[nodiscard]] RobustBall robust_ball(std::size_t count, const At& at) {
  std::vector<std::array<double, 3>> places;
  places.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& place = at(i);
    const std::array<double, 3> p{static_cast<double>(place[0]), static_cast<double>(place[1]),
                                  static_cast<double>(place[2])};
    if (std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2])) places.push_back(p);
  }
  return detail::ball_of_finite(places);
}

/// Fills `near` with the places that lie within `reach`, if others are there, and returns how many those are. What is
/// not finite stays: no distance says that it is far.
template <class Place>
[[nodiscard]] std::size_t leave_out_far(std::span<const Place> places, const RobustBall& ball, double reach,
                                        std::vector<Place>& near) {
  const auto far = [&](const Place& place) {
    const double distance = ball.distance(place.data());
    return std::isfinite(distance) && distance > reach;
  };
  const auto count = static_cast<std::size_t>(std::count_if(places.begin(), places.end(), far));
  if (count != 0) std::remove_copy_if(places.begin(), places.end(), std::back_inserter(near), far);
  return count;
}

}  // namespace compmark
