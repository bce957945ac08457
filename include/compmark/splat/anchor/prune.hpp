// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Pruning by opacity (docs/spec/method.md, 4.3): an anchor that was visited often enough to be judged goes if its
// opacities, summed over its K Gaussians and averaged over its visits, stay below a floor. The floor bounds the sum
// over K, not the mean (docs/spec/method.md, 7.16). O(N).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/growth_statistics.hpp"
#include "compmark/splat/anchor/space.hpp"

namespace compmark {

struct PruneSettings {
  double more_visits_than = 80;  ///< an anchor is judged after more visits than this (strictly)
  double min_opacity = 0.005;    ///< removed below this many per visit (strictly)
};

/// Visited often enough to be judged.
template <class T>
[[nodiscard]] bool judged(const GrowthStatistics<T>& statistics, std::size_t anchor, const PruneSettings& settings) {
  return static_cast<double>(statistics.visits[anchor]) > settings.more_visits_than;
}

/// Fills `kept` with the anchors that stay, ascending. A sum that is NaN removes nothing (the comparison is false).
template <class T>
void prune_by_opacity(const GrowthStatistics<T>& statistics, const PruneSettings& settings,
                      std::vector<std::uint32_t>& kept) {
  kept.clear();
  for (std::size_t a = 0; a < statistics.anchors(); ++a) {
    const bool transparent = statistics.opacity_sum[a] < static_cast<T>(settings.min_opacity) * statistics.visits[a];
    if (!(transparent && judged(statistics, a, settings))) kept.push_back(static_cast<std::uint32_t>(a));
  }
}

namespace detail {
/// Whether a Gaussian was on screen often enough to be judged: half as often as its anchor must have been visited.
template <class T>
[[nodiscard]] bool eligible(const GrowthStatistics<T>& statistics, std::size_t slot, const PruneSettings& settings) {
  return static_cast<double>(statistics.gradient_count[slot]) > settings.more_visits_than * 0.5;
}
/// NaN and infinity must neither grow nor vanish: they are counted and their statistics start again (AN5).
template <class T>
std::size_t drop_non_finite(GrowthStatistics<T>& statistics) {
  const auto drop = [](Buffer<T>& sum, Buffer<T>& count) {
    std::size_t dropped = 0;
    for (std::size_t i = 0; i < sum.size(); ++i) {
      if (std::isfinite(sum[i])) continue;
      sum[i] = count[i] = T{};
      ++dropped;
    }
    return dropped;
  };
  return drop(statistics.opacity_sum, statistics.visits) + drop(statistics.gradient_sum, statistics.gradient_count);
}
/// The statistics of what was judged start again.
template <class T>
void reset_judged(GrowthStatistics<T>& statistics, const PruneSettings& settings) {
  for (std::size_t slot = 0; slot < statistics.slots(); ++slot) {
    if (eligible(statistics, slot, settings)) statistics.gradient_sum[slot] = statistics.gradient_count[slot] = T{};
  }
  for (std::size_t anchor = 0; anchor < statistics.anchors(); ++anchor) {
    if (judged(statistics, anchor, settings)) statistics.opacity_sum[anchor] = statistics.visits[anchor] = T{};
  }
}
}  // namespace detail

/// The anchor of highest mean opacity, the first of equals; 0 if none was ever visited.
template <class T>
[[nodiscard]] std::uint32_t most_opaque_anchor(const GrowthStatistics<T>& statistics) {
  std::uint32_t best = 0;
  T best_opacity = -std::numeric_limits<T>::infinity();
  for (std::size_t a = 0; a < statistics.anchors(); ++a) {
    const T opacity = statistics.visits[a] > 0 ? statistics.opacity_sum[a] / statistics.visits[a] : T{};
    if (opacity > best_opacity) {
      best = static_cast<std::uint32_t>(a);
      best_opacity = opacity;
    }
  }
  return best;
}

/// Columns 3 … 5 of the log scaling (the base scale) are limited from above. The published code does so at each pruning
/// with 0.05, a value that looks as if meant for linear scales (docs/spec/method.md, 7.13); infinity leaves it out. NaN
/// stays NaN.
template <class T>
void limit_base_scale(MatrixView<T> scaling, double log_limit) {
  const T limit = static_cast<T>(log_limit);
  for (std::size_t a = 0; a < scaling.rows; ++a) {
    for (std::size_t column = 3; column < 6; ++column) {
      if (scaling(a, column) > limit) scaling(a, column) = limit;
    }
  }
}

/// The same where lengths are stretched: the limit is a length of the cells, so that what is far away may be as large
/// as it looks.
template <class T, Space S>
void limit_base_scale(MatrixView<T> scaling, MatrixView<const T> position, const S& space, double log_limit) {
  for (std::size_t a = 0; a < scaling.rows; ++a) {
    const T limit = static_cast<T>(log_limit + std::log(space.stretch(position.row(a))));
    for (std::size_t column = 3; column < 6; ++column) {
      if (scaling(a, column) > limit) scaling(a, column) = limit;
    }
  }
}

}  // namespace compmark
