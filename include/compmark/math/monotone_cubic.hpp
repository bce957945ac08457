// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A curve through points that rises and falls only where they do: piecewise cubic Hermite interpolation with the slopes
// of Fritsch and Butland (1984), weighted harmonic means, and at the ends the three-point slopes, held where they would
// overshoot, that the routine PCHIP has. One polynomial through all points overshoots between them where they bend;
// this does not. Cost: a few operations a point, once; a search by halves a value.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {

template <class T>
class MonotoneCubic {
 public:
  /// `x` [n] rises strictly, `y` [n]; n >= 2.
  MonotoneCubic(std::span<const T> x, std::span<const T> y)
      : x_(x.begin(), x.end()),
        y_(y.begin(), y.end()),
        slope_(x.size()),
        area_(x.size(), T(0)) {
    COMPMARK_ASSERT(x.size() >= 2 && x.size() == y.size(), "MonotoneCubic: two points or more, with a value each");
    const std::size_t n = x_.size();
    for (std::size_t i = 0; i < n; ++i) {
      COMPMARK_ASSERT(i == 0 || x_[i] > x_[i - 1], "MonotoneCubic: x rises strictly");
      slope_[i] = i == 0 ? end_slope(0, 1) : i + 1 == n ? end_slope(n - 2, n - 3) : inner_slope(i);
    }
    for (std::size_t i = 0; i + 1 < n; ++i) area_[i + 1] = area_[i] + area_in(i, width(i));
  }

  /// Outside the points: the first or the last cubic, continued.
  [[nodiscard]] T value(T x) const {
    const std::size_t i = interval(x);
    const T t = x - x_[i];
    const auto [c2, c3] = bend(i);
    return y_[i] + t * (slope_[i] + t * (c2 + t * c3));
  }
  /// Of the curve from a to b, exactly; minus that if b < a.
  [[nodiscard]] T integral(T a, T b) const { return area_to(b) - area_to(a); }

 private:
  [[nodiscard]] T width(std::size_t i) const { return x_[i + 1] - x_[i]; }
  [[nodiscard]] T secant(std::size_t i) const { return (y_[i + 1] - y_[i]) / width(i); }
  [[nodiscard]] T inner_slope(std::size_t i) const {
    const T before = secant(i - 1), after = secant(i);
    if (!same_sign(before, after)) return 0;  // a summit, a valley or a plain
    const T w1 = 2 * width(i) + width(i - 1), w2 = width(i) + 2 * width(i - 1);
    return (w1 + w2) / (w1 / before + w2 / after);
  }
  /// Beside interval `own`; `next` is the interval behind it, if there is one.
  [[nodiscard]] T end_slope(std::size_t own, std::size_t next) const {
    if (x_.size() == 2) return secant(0);
    const T s0 = secant(own), s1 = secant(next), h0 = width(own), h1 = width(next);
    const T slope = ((2 * h0 + h1) * s0 - h0 * s1) / (h0 + h1);
    if (!same_sign(slope, s0)) return 0;
    return !same_sign(s0, s1) && slope / s0 > 3 ? 3 * s0 : slope;  // else it would overshoot
  }
  /// By themselves: a product of small slopes is 0.
  [[nodiscard]] static bool same_sign(T a, T b) { return (a > 0 && b > 0) || (a < 0 && b < 0); }
  [[nodiscard]] std::size_t interval(T x) const {
    const auto above = std::upper_bound(x_.begin() + 1, x_.end() - 1, x);
    return static_cast<std::size_t>(above - x_.begin()) - 1;
  }
  /// Factors of t^2 and t^3.
  [[nodiscard]] std::pair<T, T> bend(std::size_t i) const {
    const T h = width(i), s = secant(i);
    return {(3 * s - 2 * slope_[i] - slope_[i + 1]) / h, (slope_[i] + slope_[i + 1] - 2 * s) / (h * h)};
  }
  [[nodiscard]] T area_in(std::size_t i, T t) const {
    const auto [c2, c3] = bend(i);
    return t * (y_[i] + t * (slope_[i] / 2 + t * (c2 / 3 + t * c3 / 4)));
  }
  [[nodiscard]] T area_to(T x) const {
    const std::size_t i = interval(x);
    return area_[i] + area_in(i, x - x_[i]);
  }

  std::vector<T> x_, y_, slope_, area_;  ///< the area is that under the curve from the first point
};

}  // namespace compmark
