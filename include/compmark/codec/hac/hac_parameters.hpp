// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Blocks of HAC's entropy model in the arena, their first values, and what is made up from all anchors when its context
// begins: the box that the hash grid covers (docs/spec/compression.md, 1.1: a fifth beyond the outermost anchors of the
// core, away from the origin or towards it) and the mean and deviation of every scalar, which the network's outputs
// count in. Sums in double, in row order. Cost of begin: one read of the table.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "compmark/codec/hac/hash_grid_layout.hpp"
#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/robust_ball.hpp"

namespace compmark {

struct HacHandles {
  BlockHandle mask;                      ///< "anchor.mask"          [N, K]           logit - 1
  BlockHandle grid;                      ///< "hash_grid"            [entries, 4]     counts as its sign
  BlockHandle weight1;                   ///< "context.0.weight"     [100, channels]
  BlockHandle bias1;                     ///< "context.0.bias"       [1, 100]
  BlockHandle weight2;                   ///< "context.2.weight"     [2 (D + 6 + 3 K) + 3, 100]
  BlockHandle bias2;                     ///< "context.2.bias"
  BlockHandle box;                       ///< "context.box"          [2, 3]           minimum, maximum; not trained
  BlockHandle statistics;                ///< "context.statistics"   [2, D + 6 + 3 K] mean, deviation; not trained
  BlockHandle feature, scaling, offset;  ///< of the anchor table, where the arena has one
};

/// Learning schedule of an entropy model's networks and grid: it starts with the iteration in which the rate counts
/// first (docs/spec/compression.md, 1.8).
inline constexpr LearningSchedule context_schedule{0.005, 0.00001, RateUnit::one, 10000};

/// The blocks that every context has: the box of the positions, and mean and deviation of the scalars; and those of the
/// anchors, where the arena has them.
template <class Attributes, class Handles, class T>
void add_common_blocks(ParameterArena<T>& arena, Handles& handles) {
  const auto add = [&](const char* name, std::size_t columns) {
    return arena.add(name, 2, columns, RowKind::fixed, BlockRole::context, LearningSchedule::fixed());
  };
  handles.box = add("context.box", 3);
  handles.statistics = add("context.statistics", static_cast<std::size_t>(Attributes::scalars));
  handles.feature = arena.layout().find("anchor.feature");
  handles.scaling = arena.layout().find("anchor.scaling");
  handles.offset = arena.layout().find("anchor.offset");
}

template <class T, class Network, class Attributes, HashGridShape shape>
HacHandles add_hac_blocks(ParameterArena<T>& arena, std::size_t anchor_rows, std::size_t offsets) {
  const auto add = [&](const char* name, int rows, int columns, const LearningSchedule& schedule) {
    return arena.add(name, static_cast<std::size_t>(rows), static_cast<std::size_t>(columns), RowKind::fixed,
                     BlockRole::context, schedule);
  };
  HacHandles handles;
  handles.mask = arena.add("anchor.mask", anchor_rows, offsets, RowKind::anchor, BlockRole::mask, offset_mask_schedule);
  handles.grid = arena.add("hash_grid", shape.entries(), static_cast<std::size_t>(shape.features), RowKind::fixed,
                           BlockRole::context, context_schedule);
  handles.weight1 = add("context.0.weight", Network::hidden, Network::inputs, context_schedule);
  handles.bias1 = add("context.0.bias", 1, Network::hidden, context_schedule);
  handles.weight2 = add("context.2.weight", Network::outputs, Network::hidden, context_schedule);
  handles.bias2 = add("context.2.bias", 1, Network::outputs, context_schedule);
  add_common_blocks<Attributes>(arena, handles);
  return handles;
}

/// PyTorch's default for Linear, U(-1, 1) / sqrt(fan_in); the grid U(-1e-4, 1e-4); masks at logit 1; box and statistics
/// of the unit box.
template <class T>
void initialise_hac(ParameterArena<T>& arena, const HacHandles& handles, std::uint64_t seed) {
  const auto fill = [&](BlockHandle handle, double bound) {
    const Random random(seed, 0, random_stage(arena.layout().block(handle).name));
    std::size_t index = 0;
    for (T& value : arena.values(handle).flat()) value = static_cast<T>(bound * (2 * random.uniform(index++) - 1));
  };
  const double first = 1 / std::sqrt(static_cast<double>(arena.layout().block(handles.weight1).columns));
  const double second = 1 / std::sqrt(static_cast<double>(arena.layout().block(handles.weight2).columns));
  fill(handles.weight1, first);
  fill(handles.bias1, first);
  fill(handles.weight2, second);
  fill(handles.bias2, second);
  fill(handles.grid, 1e-4);
  for (T& value : arena.values(handles.mask).flat()) value = T(0);
  for (const BlockHandle handle : {handles.box, handles.statistics}) {
    const MatrixView<T> block = arena.values(handle);
    std::fill_n(block.row(0), block.columns, T(0));
    std::fill_n(block.row(1), block.columns, T(1));
  }
}

/// Scalars of masked offsets, and of anchors without an unmasked one, are never coded and do not count. A channel that
/// does not vary gets a sixty-fourth of its published base step as deviation, so that the network's outputs have an
/// effect.
template <class Attributes, class T>
void begin_hac_context(ParameterArena<T>& arena, const HacHandles& handles, MatrixView<const T> position,
                       MatrixView<const T> feature, MatrixView<const T> scaling, MatrixView<const T> offset) {
  const MatrixView<T> box = arena.values(handles.box), statistics = arena.values(handles.statistics);
  const MatrixView<const T> mask = std::as_const(arena).values(handles.mask);
  // A few distant anchors would put all others into one cell of the grid. Anchors beyond the core are therefore outside
  // the box, where the grid gives no information.
  const RobustBall ball = robust_ball(position.rows, [&](std::size_t i) { return position.row(i); });
  const double core = ball.core();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    T least = 0, most = 0;
    bool any = false;
    for (std::size_t i = 0; i < position.rows; ++i) {
      const T x = position(i, axis);
      if (!std::isfinite(x) || ball.distance(position.row(i)) > core) continue;
      least = any ? std::min(least, x) : x;
      most = any ? std::max(most, x) : x;
      any = true;
    }
    box(0, axis) = least * (least < T(0) ? T(1.2) : T(0.8));
    box(1, axis) = most * (most > T(0) ? T(1.2) : T(0.8));
  }

  const std::size_t scalars = static_cast<std::size_t>(Attributes::scalars), geometry = feature.columns + 6;
  const auto value = [&](std::size_t row, std::size_t c) -> double {
    if (c < feature.columns) return static_cast<double>(feature(row, c));
    if (c < geometry) return std::exp(static_cast<double>(scaling(row, c - feature.columns)));
    return static_cast<double>(offset(row, c - geometry));
  };
  const auto counts = [&](std::size_t row, std::size_t c) {
    return c < geometry ? any_unmasked(mask.row(row), mask.columns) : is_unmasked(mask(row, (c - geometry) / 3));
  };
  for (std::size_t c = 0; c < scalars; ++c) {
    double n = 0, sum = 0, squares = 0;
    for (int pass = 0; pass < 2; ++pass) {
      const double mean = n > 0 ? sum / n : 0;
      for (std::size_t row = 0; row < position.rows; ++row) {
        if (!counts(row, c)) continue;
        const double x = value(row, c);
        if (!std::isfinite(x)) continue;
        if (pass == 0) {
          sum += x;
          n += 1;
        } else {
          squares += (x - mean) * (x - mean);
        }
      }
    }
    const int group = c < feature.columns ? 0 : (c < geometry ? 1 : 2);
    const double least = Attributes::published_steps[static_cast<std::size_t>(group)] * Attributes::least_step;
    statistics(0, c) = static_cast<T>(n > 0 ? sum / n : 0);
    statistics(1, c) = static_cast<T>(std::max(n > 0 ? std::sqrt(squares / n) : 0, least));
  }
}

}  // namespace compmark
