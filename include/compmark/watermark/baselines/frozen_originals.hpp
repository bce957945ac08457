// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Anchors of which some train and the others keep every bit, as GaussianMarker (Huang et al., NeurIPS 2024) trains the
// copies of a finished model's Gaussians and not the Gaussians. A block beside the anchors says which; before each step
// the gradients of the others are cleared, and Adam leaves a number alone that never had a gradient. The networks are
// everybody's: whoever freezes them sets their rates to 0 (frozen_model.hpp). Cost: one pass over the gradients.
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

class FrozenOriginalsStage : public Stage<FrozenOriginalsStage> {
 public:
  struct Handles {
    BlockHandle trains;  ///< "anchor.trains" [N, 1]: 0 in the rows that keep their bits
  };

  template <class Arena, class Anchors>
  static Handles add_parameters(Arena& arena, const Anchors& anchors, std::size_t /*views*/) {
    return {arena.add("anchor.trains", arena.layout().block(anchors.position).rows, 1, RowKind::anchor,
                      BlockRole::training, LearningSchedule::fixed())};
  }
  /// The anchors from row `first` on train, those before do not.
  template <class ModelType>
  static void train_from(ModelType& model, std::size_t first) {
    const auto trains = model.arena.values(model.template blocks<FrozenOriginalsStage>().trains);
    for (std::size_t row = 0; row < trains.rows; ++row) trains(row, 0) = row < first ? 0 : 1;
  }

  template <class Training, class State>
  void after_backward(const Training& training, State& /*state*/) const {
    auto& arena = training.model.arena;
    const auto trains = arena.values(training.model.template blocks<FrozenOriginalsStage>().trains);
    auto* const gradients = arena.all_gradients().data();
    for (const ArenaLayout::Block& block : arena.layout().blocks()) {
      if (block.kind != RowKind::anchor) continue;
      for (std::size_t row = 0; row < block.rows; ++row) {
        if (trains(row, 0) == 0) std::fill_n(gradients + block.offset + row * block.columns, block.columns, 0);
      }
    }
  }
};

}  // namespace compmark
