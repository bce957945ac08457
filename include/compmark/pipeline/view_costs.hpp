// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a message costs lately near each training view, and how much oftener than by its room a view is therefore drawn
// (PosthocSettings::draw_by_cost). Some places of a capture take a mark later than the others; of the cup, drawn as
// often, a few end with half of the bits where the others have all (docs/notebook/watermark_experiments.md). It is part
// of the state of a run. Cost: O(views) an iteration.
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

  /// That a reading near `view` of `views` cost so much; of one that is no number nothing is learned, as the optimiser
  /// learns nothing from it.
  void add(std::size_t view, std::size_t views, double cost) {
    constexpr double memory = 0.9;
    if (mean.empty()) mean.assign(views, unread);
    COMPMARK_ASSERT(mean.size() == views && view < views, "ViewCosts: the views of a run are always the same");
    if (!std::isfinite(cost)) return;
    mean[view] = mean[view] < 0 ? cost : memory * mean[view] + (1 - memory) * cost;
  }

  /// How much oftener each view is drawn: `share` of it in proportion to its cost, of the mean where it is not known.
  /// No view is forgotten: what costs nothing now may cost again. Empty before the first reading. Reuses the memory of
  /// `factor`.
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
