// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which anchors of two models are the same, by their features: each other's nearest, where the second is much farther.
// Exact, by searches in groups (math/row_groups.hpp), with the bits of the search of all pairs
// (reference_same_features.hpp) at any number of threads. Cost, in seconds of a processor beside other work: half of
// 26,535 anchors are found among all by .3 (all pairs: 1.6), of 80,000 by 1.8 (12); all of them after noise of .5 on
// every feature by .6 and 5.2 (benchmarks/anchor_same_features.bench.cpp).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/principal_axes.hpp"
#include "compmark/math/row_groups.hpp"

namespace compmark {

/// How much nearer the nearest is than the second, at most: seven tenths, as a ratio of squares. Of the chair 26,400 of
/// 26,535 anchors pass after 8 bits or noise, all rightly.
inline constexpr float same_feature_ratio = 0.7f * 0.7f;

/// For each row of `one` [N, C] the row of `among` [M, C] that is its nearest, where it is the nearest of that row as
/// well (of equal ones the lower), and nearer than seven tenths of the way to the second; else empty. Rows with a
/// number that is not finite are nobody's, and distances whose square overflows float are none. Memory: twice the rows.
template <Executor E>
[[nodiscard]] std::vector<std::optional<std::uint32_t>> same_features(MatrixView<const float> one,
                                                                      MatrixView<const float> among, E& executor) {
  COMPMARK_ASSERT(one.columns == among.columns, "same_features: columns");
  constexpr float far = std::numeric_limits<float>::infinity();
  constexpr std::size_t batch = 64;
  const PrincipalAxes axes = PrincipalAxes::of(one);
  const RowGroups there(among, axes, executor), back(one, axes, executor);
  std::vector<std::optional<std::uint32_t>> same(one.rows);
  executor.for_chunks(back.order().size(), batch, [&](std::size_t begin, std::size_t end, std::size_t) {
    const std::size_t count = end - begin;
    const std::uint32_t* const rows = back.order().data() + begin;
    std::array<RowGroups::Query, batch> queries;
    std::array<float, batch> first, second;
    std::array<std::uint32_t, batch> other{};
    const std::span<RowGroups::Query> asked(queries.data(), count);
    // The nearest, if it is much nearer than all others: one that is not much nearer than the nearest so far is not
    // looked for, since it could not be.
    for (std::size_t i = 0; i < count; ++i) {
      queries[i] = {one.row(rows[i]), far};
      first[i] = far;
    }
    there.within(asked, [&](std::size_t i, float distance, std::uint32_t candidate) {
      if (distance < first[i]) {
        first[i] = distance;
        other[i] = candidate;
      }
      return first[i] > 0 ? same_feature_ratio * first[i] : -1.0f;
    });
    // Whether another is nearly as near.
    for (std::size_t i = 0; i < count; ++i) {
      // Rounded up, and where numbers are so small that a part of one is none.
      second[i] = first[i] / same_feature_ratio * (1 + 1e-6f) + std::numeric_limits<float>::min();
      queries[i].reach = first[i] < far ? second[i] : -1.0f;
    }
    there.within(asked, [&](std::size_t i, float distance, std::uint32_t candidate) {
      if (candidate == other[i] || first[i] < same_feature_ratio * distance) return second[i];
      first[i] = far;
      return -1.0f;
    });
    // Whether it is nearer to another.
    for (std::size_t i = 0; i < count; ++i) {
      queries[i] = {first[i] < far ? among.row(other[i]) : nullptr, first[i] < far ? first[i] : -1.0f};
    }
    back.within(asked, [&](std::size_t i, float distance, std::uint32_t candidate) {
      if (!(distance < first[i] || (distance == first[i] && candidate < rows[i]))) return first[i];
      first[i] = far;
      return -1.0f;
    });
    for (std::size_t i = 0; i < count; ++i) {
      if (first[i] < far) same[rows[i]] = other[i];
    }
  });
  return same;
}

}  // namespace compmark
