// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The Bjontegaard delta (VCEG-M33, 2001): the mean difference in bytes between two codecs at the same quality, as one
// number. Both curves are read as log(rate) over quality and interpolated by monotone cubics (JCT-VC's practice since
// HEVC; the one polynomial of 2001 swings where points bend). The mean difference over the qualities that both reach is
// turned back into a ratio. A mean over a narrow overlap means little: the overlap is given beside the number. Cost:
// none.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/math/monotone_cubic.hpp"

namespace compmark {

/// A point of a rate-distortion curve.
struct RatePoint {
  double rate = 0;     ///< above 0: bytes, bits a pixel; the same unit in both curves
  double quality = 0;  ///< more is better: PSNR in dB, SSIM, minus LPIPS
};

/// A Bjontegaard delta and where the curves overlap, of which it is the mean: in quality of bd_rate, in rate of
/// bd_quality.
struct BdDelta {
  double delta = 0;
  double from = 0, to = 0;
};

namespace detail {

[[nodiscard]] inline std::string point_text(const RatePoint& point) {
  return "quality " + std::to_string(point.quality) + " at a rate of " + std::to_string(point.rate);
}

/// The points by rising rate; an Error unless the quality rises with it.
[[nodiscard]] inline Result<std::vector<RatePoint>> rate_curve(std::span<const RatePoint> points, const char* name) {
  const auto error = [&](std::string problem, std::string remedy) {
    return Error{ErrorKind::invalid, {}, name, std::move(problem), std::move(remedy)};
  };
  if (points.size() < 2) return error("has fewer than two points", "give four or more");
  std::vector<RatePoint> curve(points.begin(), points.end());
  for (const RatePoint& point : curve) {
    if (!(point.rate > 0 && std::isfinite(point.rate) && std::isfinite(point.quality)))
      return error("has a rate that is not above 0, or a number that is not finite", "leave that point out");
  }
  std::sort(curve.begin(), curve.end(), [](const RatePoint& a, const RatePoint& b) { return a.rate < b.rate; });
  for (std::size_t i = 1; i < curve.size(); ++i) {
    const RatePoint &a = curve[i - 1], &b = curve[i];
    // The logarithm is what is interpolated over: of rates next to each other it may be one.
    if (!(std::log(b.rate) > std::log(a.rate) && b.quality > a.quality)) {
      return error("does not rise: " + point_text(a) + " and " + point_text(b), "leave out points that others beat");
    }
  }
  return curve;
}

/// Mean of (test - reference) of y over the x that both have, of which `name` says what it is. `x` and `y` of a point
/// rise together.
template <class X, class Y>
[[nodiscard]] Result<BdDelta> mean_difference(std::span<const RatePoint> reference, std::span<const RatePoint> test,
                                              const std::string& name, X&& x, Y&& y) {
  const Result<std::vector<RatePoint>> a = rate_curve(reference, "reference curve");
  if (!a) return a.error();
  const Result<std::vector<RatePoint>> b = rate_curve(test, "tested curve");
  if (!b) return b.error();
  BdDelta found;
  found.from = std::max(x(a->front()), x(b->front()));
  found.to = std::min(x(a->back()), x(b->back()));
  if (!(found.from < found.to)) {
    return Error{ErrorKind::invalid,
                 {},
                 "curves",
                 "have no " + name + " in common: " + point_text(a->front()) + " to " + point_text(a->back()) +
                     ", and " + point_text(b->front()) + " to " + point_text(b->back()),
                 "add points between them"};
  }
  const auto area = [&](const std::vector<RatePoint>& curve) {
    std::vector<double> at, value;
    for (const RatePoint& point : curve) {
      at.push_back(x(point));
      value.push_back(y(point));
    }
    return MonotoneCubic<double>(at, value).integral(found.from, found.to);
  };
  found.delta = (area(*b) - area(*a)) / (found.to - found.from);
  return found;
}

}  // namespace detail

/// Mean share of rate that `test` takes more (above 0) or less than `reference` at equal quality: -0.1 is a tenth fewer
/// bytes.
[[nodiscard]] inline Result<BdDelta> bd_rate(std::span<const RatePoint> reference, std::span<const RatePoint> test) {
  Result<BdDelta> found = detail::mean_difference(
      reference, test, "quality", [](const RatePoint& p) { return p.quality; },
      [](const RatePoint& p) { return std::log(p.rate); });
  if (found) found->delta = std::expm1(found->delta);
  return found;
}

/// Mean quality that `test` gives more (above 0) or less than `reference` at equal rate, every octave of rate counting
/// alike.
[[nodiscard]] inline Result<BdDelta> bd_quality(std::span<const RatePoint> reference, std::span<const RatePoint> test) {
  Result<BdDelta> found = detail::mean_difference(
      reference, test, "rate", [](const RatePoint& p) { return std::log(p.rate); },
      [](const RatePoint& p) { return p.quality; });
  if (found) {
    found->from = std::exp(found->from);
    found->to = std::exp(found->to);
  }
  return found;
}

}  // namespace compmark
