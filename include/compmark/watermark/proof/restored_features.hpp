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
// Cost: where every anchor is in its place, two sorts; else a table of the distances of features, N M C products for M
// anchors that are left, of C numbers: 2 s of a thread beside other work for half of the chair's 26,535.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/nearest_rows.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/watermark/proof/report.hpp"

namespace compmark {

/// For each row of `one` [N, C] the row of `among` [M, C] that is its nearest, where it is the nearest of that row as
/// well, and nearer than seven tenths of the way to the second; else empty. Rows with a number that is not finite are
/// nobody's. Memory: 1,024 rows of `among`.
[[nodiscard]] inline std::vector<std::optional<std::uint32_t>> same_features(MatrixView<const float> one,
                                                                             MatrixView<const float> among) {
  constexpr float ratio = 0.7f;  // of distances; of the chair 26,400 of 26,535 pass after 8 bits or noise, all rightly
  constexpr std::size_t tile = 1024;
  constexpr float far = std::numeric_limits<float>::infinity();
  struct Nearest {
    float first = far, second = far;  ///< squared distances
    std::uint32_t row = 0;
    void look(float distance, std::uint32_t other) {
      if (distance < first) {
        second = std::exchange(first, distance);
        row = other;
      } else if (distance < second) {
        second = distance;
      }
    }
  };
  std::vector<Nearest> there(one.rows), back(among.rows);
  std::vector<float> columns(tile * one.columns), distance(tile);
  for (std::size_t begin = 0; begin < among.rows; begin += tile) {
    const std::size_t count = std::min(tile, among.rows - begin);
    for (std::size_t k = 0; k < one.columns; ++k) {
      for (std::size_t j = 0; j < count; ++j) columns[k * tile + j] = among(begin + j, k);
    }
    for (std::size_t row = 0; row < one.rows; ++row) {
      std::fill_n(distance.begin(), count, 0.0f);
      for (std::size_t k = 0; k < one.columns; ++k) {
        const float mine = one(row, k);
        const float* const theirs = columns.data() + k * tile;
        for (std::size_t j = 0; j < count; ++j) distance[j] += (mine - theirs[j]) * (mine - theirs[j]);
      }
      for (std::size_t j = 0; j < count; ++j) {  // one that is no number is nearest to nothing
        there[row].look(distance[j], static_cast<std::uint32_t>(begin + j));
        back[begin + j].look(distance[j], static_cast<std::uint32_t>(row));
      }
    }
  }
  std::vector<std::optional<std::uint32_t>> same(one.rows);
  for (std::size_t row = 0; row < one.rows; ++row) {
    const Nearest& nearest = there[row];
    if (nearest.first < ratio * ratio * nearest.second && back[nearest.row].row == row) same[row] = nearest.row;
  }
  return same;
}

/// Puts the features of the anchors of `suspected` that are anchors of `unmarked` into `unmarked`, raised as
/// above; numbers that are not finite stay out. Error: models whose features have other sizes, or no anchor in common.
[[nodiscard]] inline Result<RestoredFeatures> restore_features(ParameterArena<float>& unmarked,
                                                               const ParameterArena<float>& suspected) {
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
      same_places(std::as_const(unmarked).values(to.position), suspected.values(from.position));
  if (std::any_of(match.begin(), match.end(), [](const auto& one) { return !one.has_value(); })) {
    const auto by_feature = same_features(std::as_const(unmarked).values(to.feature), suspected.values(from.feature));
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
