// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A suspected model, put back together by who has the unmarked one. A mark is in the features of anchors. So what a
// thief threw away, doubled, moved or rounded does not matter, if the features that he left are read in the unmarked
// model, at the anchors that they belong to. A feature says itself which that is, since a mark moves it by far less than
// two anchors differ (chair: .54 and 2.9 in the mean); where features were attacked, places say it. What is left also
// speaks for what is gone: where n of N anchors are found, their differences to the unmarked features are raised N / n
// times, at most three times, beyond which the networks see features that they were never trained on (measured in
// docs/notebook/watermark_experiments.md). No key and no message has part in it, so that a p-value is what it was.
// Cost: where every anchor is in its place, two sorts; else a search of features too (splat/anchor/same_features.hpp),
// together .4 s of a processor for half of the chair's 26,535 anchors, 3 s for half of the fern's 80,000, and 6 s for
// all of the fern's after noise of .5 on their features.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/nearest_rows.hpp"
#include "compmark/splat/anchor/same_features.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/watermark/proof/report.hpp"

namespace compmark {

/// Puts the features of the anchors of `suspected` that are anchors of `unmarked` into `unmarked`, raised as
/// above; numbers that are not finite stay out. The same bits at any number of threads. Error: models whose features
/// have other sizes, or no anchor in common.
template <Executor E>
[[nodiscard]] Result<RestoredFeatures> restore_features(ParameterArena<float>& unmarked,
                                                        const ParameterArena<float>& suspected, E& executor) {
  constexpr double most_raised = 3;
  const AnchorHandles to = find_anchor_blocks(unmarked.layout()), from = find_anchor_blocks(suspected.layout());
  const auto columns = [](const ParameterArena<float>& arena, BlockHandle handle) {
    return handle.valid() ? arena.layout().block(handle).columns : std::size_t{0};
  };
  if (columns(unmarked, to.position) != 3 || columns(suspected, from.position) != 3 ||
      columns(unmarked, to.feature) == 0 || columns(unmarked, to.feature) != columns(suspected, from.feature)) {
    return Error{ErrorKind::invalid,
                 {},
                 "anchor.feature",
                 "has another size in the model than in the unmarked one",
                 "give the unmarked model that this one was made from"};
  }
  std::vector<std::optional<std::uint32_t>> match =
      same_places(std::as_const(unmarked).values(to.position), suspected.values(from.position), executor);
  if (std::any_of(match.begin(), match.end(), [](const auto& one) { return !one.has_value(); })) {
    const auto by_feature =
        same_features(std::as_const(unmarked).values(to.feature), suspected.values(from.feature), executor);
    for (std::size_t row = 0; row < match.size(); ++row) {
      if (by_feature[row]) match[row] = by_feature[row];
    }
  }
  RestoredFeatures restored;
  restored.anchors = match.size();
  restored.found = static_cast<std::size_t>(
      std::count_if(match.begin(), match.end(), [](const auto& one) { return one.has_value(); }));
  if (restored.found == 0) {
    return Error{ErrorKind::invalid,
                 {},
                 "anchor.position",
                 "no anchor is one of the unmarked model's",
                 "give the unmarked model that this one was made from"};
  }
  restored.raised = std::min(most_raised, static_cast<double>(restored.anchors) / static_cast<double>(restored.found));
  const MatrixView<float> feature = unmarked.values(to.feature);
  const MatrixView<const float> marked = suspected.values(from.feature);
  for (std::size_t row = 0; row < match.size(); ++row) {
    if (!match[row]) continue;
    for (std::size_t k = 0; k < feature.columns; ++k) {
      const double before = static_cast<double>(feature(row, k));
      const auto there =
          static_cast<float>(before + restored.raised * (static_cast<double>(marked(*match[row], k)) - before));
      if (std::isfinite(there)) feature(row, k) = there;
    }
  }
  return restored;
}

}  // namespace compmark
