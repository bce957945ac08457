// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/frozen_originals.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/model.hpp>
#include <cstddef>
#include <string>

#include "support/small_scene.hpp"

using namespace compmark;

namespace {

struct PartlyFrozen : testing::SmallRecipe {
  using Stages = StageList<FrozenOriginalsStage>;
};
struct FrozenTraining {
  Model<PartlyFrozen>& model;
};

}  // namespace

TEST_CASE("baselines/frozen_originals: gradients of the first rows are cleared, those of the others and networks not") {
  Model<PartlyFrozen> model;
  model.create(6, 2);
  FrozenOriginalsStage::train_from(model, 4);
  std::fill(model.arena.all_gradients().begin(), model.arena.all_gradients().end(), 2.0f);
  int state = 0;
  FrozenOriginalsStage().after_backward(FrozenTraining{model}, state);
  std::size_t anchors = 0;
  for (std::size_t b = 0; b < model.arena.layout().blocks().size(); ++b) {
    const ArenaLayout::Block& block = model.arena.layout().blocks()[b];
    CAPTURE(std::string(block.name));
    const auto gradient = model.arena.gradients(BlockHandle{b});
    for (std::size_t row = 0; row < gradient.rows; ++row) {
      const float expected = block.kind == RowKind::anchor && row < 4 ? 0.0f : 2.0f;
      for (std::size_t c = 0; c < gradient.columns; ++c) CHECK(gradient(row, c) == expected);
    }
    if (block.kind == RowKind::anchor) ++anchors;
  }
  CHECK(anchors == 5);  // the table's four, and what says which rows train
}
