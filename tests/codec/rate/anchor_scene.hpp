// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the tests of both entropy models share: a table of anchors in an arena, its model, and a loss: slopes times the
// distorted rows, plus the rate. A model's own scene derives from it and fills it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/codec/rate/rate.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"

namespace compmark::testing {

inline constexpr int D = 13, K = 3;  ///< channels of a feature, offsets of an anchor

template <class T, class ModelUnderTest, std::size_t anchors>
struct AnchorScene {
  using Model = ModelUnderTest;
  typename Model::Settings settings;
  ParameterArena<T> arena;
  BlockHandle position, offset, scaling, feature;
  typename Model::Handles handles;
  typename Model::Context context;
  std::vector<std::uint32_t> rows;
  std::vector<T> out[3], slope[3];
  RatePhase phase;

  /// Blocks and settings; the values are for the derived scene to fill.
  explicit AnchorScene(std::string_view stage) : random(6, 0, random_stage(stage)) {
    position =
        arena.add("anchor.position", anchors, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    offset =
        arena.add("anchor.offset", anchors, 3 * K, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    scaling = arena.add("anchor.scaling", anchors, 6, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    feature = arena.add("anchor.feature", anchors, D, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    handles = Model::add_parameters(arena, anchors);
    Model::initialise(arena, handles, 5);
    settings.lambda = 40;  // the rate's gradient and the slopes' are of one size
    settings.mask_weight = 3;
    settings.step_share = 1;
    phase = {.context = true, .seed = 3, .iteration = 12};
  }
  MatrixView<T> table(int which) { return arena.values(which == 0 ? feature : (which == 1 ? scaling : offset)); }
  MatrixView<T> view(std::vector<T>& values, int which) { return {values.data(), anchors, table(which).columns}; }
  template <Executor E>
  RateReport forward(E& executor) {
    for (int which = 0; which < 3; ++which) out[which].assign(table(which).flat().begin(), table(which).flat().end());
    return Model(settings).forward(arena, handles, rows, phase, std::as_const(arena).values(position), view(out[0], 0),
                                   view(out[1], 1), view(out[2], 2), context, executor);
  }
  double loss() {
    SerialExecutor serial;
    double sum = forward(serial).loss;
    for (const std::uint32_t row : rows) {
      for (int which = 0; which < 3; ++which) {
        for (std::size_t c = 0; c < table(which).columns; ++c) {
          sum += static_cast<double>(view(slope[which], which)(row, c)) *
                 static_cast<double>(view(out[which], which)(row, c));
        }
      }
    }
    return sum;
  }
  /// Gradients by the table: those of listed rows as the backward pass carries them on, and what the model wrote itself.
  template <Executor E>
  void backward(E& executor) {
    std::fill(arena.all_gradients().begin(), arena.all_gradients().end(), T(0));
    std::vector<T> d[3];
    for (int which = 0; which < 3; ++which) {
      d[which].assign(table(which).size(), T(0));
      for (const std::uint32_t row : rows) {
        for (std::size_t c = 0; c < table(which).columns; ++c)
          view(d[which], which)(row, c) = view(slope[which], which)(row, c);
      }
    }
    Model(settings).backward(arena, handles, rows, view(d[0], 0), view(d[1], 1), view(d[2], 2), context, executor);
    for (int which = 0; which < 3; ++which) {
      const MatrixView<T> to = arena.gradients(which == 0 ? feature : (which == 1 ? scaling : offset));
      for (const std::uint32_t row : rows) {
        for (std::size_t c = 0; c < to.columns; ++c) to(row, c) += view(d[which], which)(row, c);
      }
    }
  }

 protected:
  Random random;
  std::uint64_t at = 0;  ///< the next number of `random`

  void fill(BlockHandle block, double scale, double shift) {
    for (T& value : arena.values(block).flat()) value = static_cast<T>(shift + scale * random.normal(at++));
  }
  void kill_every_eleventh_anchor() {
    for (std::size_t i = 0; i < anchors; i += 11) {
      for (std::size_t k = 0; k < K; ++k) arena.values(handles.mask)(i, k) = T(-9) - static_cast<T>(k);
    }
  }
  void draw_slope(int which) {
    slope[which].resize(table(which).size());
    for (T& value : slope[which]) value = static_cast<T>(random.normal(at++));
  }
};

}  // namespace compmark::testing
