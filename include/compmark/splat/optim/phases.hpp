// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// When things happen. The published recipes name iterations of a run of 30,000; here every such number stands for the
// fraction number / 30000 of the run, so that a run of 3,000 is the same recipe, shorter. At 30,000 every window is
// exactly the published one. Cost: none.
//
// What does not scale is the interval of density control (100 iterations): it counts visits. An anchor is judged when
// it was seen in more than 80 of 100 iterations and a Gaussian when it was on screen in more than 40, which says
// something about the scene only while an interval covers many views; ten iterations would judge from ten views. A
// short run therefore makes fewer adjustments, each as well founded.
#pragma once

#include <cstdint>

#include "compmark/core/config.hpp"

namespace compmark {

/// Length of the runs whose iterations the published numbers name.
inline constexpr std::int64_t published_iterations = 30000;

/// Iteration `iteration` of a published run, in a run of `total`: iteration * total / 30000, rounded to nearest (half
/// up). Exact at 30000.
[[nodiscard]] constexpr std::int64_t scale_iteration(std::int64_t iteration, std::int64_t total) {
  return (2 * iteration * total + published_iterations) / (2 * published_iterations);
}

/// Iterations begin <= t < end. Empty where end <= begin, as by default.
struct Window {
  std::int64_t begin = 0;
  std::int64_t end = 0;

  [[nodiscard]] constexpr bool contains(std::int64_t iteration) const { return begin <= iteration && iteration < end; }
  [[nodiscard]] constexpr std::int64_t length() const { return end > begin ? end - begin : 0; }
  /// 0 before the window, rising linearly to 1 at its end and staying there: the weight of something that fades in.
  [[nodiscard]] constexpr double progress(std::int64_t iteration) const {
    if (iteration < begin) return 0;
    if (iteration >= end) return 1;
    return static_cast<double>(iteration - begin) / static_cast<double>(end - begin);
  }
};

/// after < t < until of a published run, in a run of `total`: how the published loops write their conditions.
[[nodiscard]] constexpr Window open_window(std::int64_t after, std::int64_t until, std::int64_t total) {
  return {scale_iteration(after, total) + 1, scale_iteration(until, total)};
}
/// from <= t < until of a published run, in a run of `total`.
[[nodiscard]] constexpr Window closed_window(std::int64_t from, std::int64_t until, std::int64_t total) {
  return {scale_iteration(from, total), scale_iteration(until, total)};
}

/// When growing looks and when it acts (docs/spec/method.md, 4.2).
struct DensityPhases {
  Window statistics;            ///< iterations whose statistics are kept
  Window growing;               ///< iterations in which adjustments may fall
  Window pause;                 ///< … except these
  std::int64_t interval = 100;  ///< an adjustment at each multiple; does not scale, see above

  [[nodiscard]] constexpr bool observes(std::int64_t iteration) const { return statistics.contains(iteration); }
  [[nodiscard]] constexpr bool adjusts(std::int64_t iteration) const {
    return iteration % interval == 0 && statistics.contains(iteration) && growing.contains(iteration) &&
           !pause.contains(iteration);
  }

  /// Scaffold-GS: statistics for 500 < t < 15000, adjustments at 1600, 1700, … 14900 (134 of them).
  [[nodiscard]] static constexpr DensityPhases scaffold(std::int64_t total) {
    return {open_window(500, 15000, total), open_window(1500, 15000, total), {}, 100};
  }
  /// HAC and ContextGS: as Scaffold-GS, without 3000 <= t < 4000.
  [[nodiscard]] static constexpr DensityPhases hac(std::int64_t total) {
    return {open_window(500, 15000, total), open_window(1500, 15000, total), closed_window(3000, 4000, total), 100};
  }
  /// The published CompMarkGS code: adjustments from 600 on (its test of 1500 was dropped), without 3000 <= t < 4000
  /// (134 of them).
  [[nodiscard]] static constexpr DensityPhases official(std::int64_t total) {
    return {open_window(500, 15000, total), open_window(500, 15000, total), closed_window(3000, 4000, total), 100};
  }
};

}  // namespace compmark
