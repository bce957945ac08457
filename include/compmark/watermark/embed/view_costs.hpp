// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The recent message loss near each training view, from which sampled novel views are drawn
// (PosthocSettings::draw_by_cost). Some places of a capture take a mark later than others: on the cup, with equal
// draws, a few views end with half of the bits where the others have all (docs/notebook/watermark_experiments.md). It
// is part of the state of a run. Cost: O(views) an iteration.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {

class ViewCosts {
 public:
  std::vector<double> mean;  ///< [views], running; `unread` of a view that was not drawn yet

  static constexpr double unread = -1;

  /// Records the loss `cost` of a reading near `view` of `views`. A NaN is ignored, as the optimiser ignores its
  /// gradient.
  void add(std::size_t view, std::size_t views, double cost) {
    constexpr double memory = 0.9;
    if (mean.empty()) mean.assign(views, unread);
    COMPMARK_ASSERT(mean.size() == views && view < views, "ViewCosts: the views of a run are always the same");
    if (!std::isfinite(cost)) return;
    mean[view] = mean[view] < 0 ? cost : memory * mean[view] + (1 - memory) * cost;
  }

  /// Factors of the probabilities of the views: a `share` of each in proportion to its loss, or to the mean where it is
  /// unknown. No view gets 0: its loss may rise again. Empty before the first reading. Reuses the memory of `factor`.
  void factors(double share, std::vector<double>& factor) const {
    constexpr double least = 0.05;
    double sum = 0, known = 0;
    for (const double cost : mean) {
      if (cost < 0) continue;
      sum += cost;
      ++known;
    }
    const double average = known > 0 ? sum / known : 0;
    factor.assign(known > 0 ? mean.size() : 0, 1.0);
    if (!(average > 0)) return;
    for (std::size_t i = 0; i < mean.size(); ++i) {
      if (mean[i] >= 0) factor[i] = (1 - share) + share * std::max(least, mean[i] / average);
    }
  }
};

}  // namespace compmark
