// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Converts between a recipe and its Base, the recipe it adds stages to. A finished model of the base gets room for a
// mark, or for a codec's context; and the base's part of a trained model can be taken out again.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark {

/// The base's part, without the stages of R: after post-hoc embedding, the unmarked model.
template <Recipe R>
[[nodiscard]] Model<typename R::Base> base_model(const Model<R>& model) {
  using Scalar = typename R::Scalar;
  Model<typename R::Base> base;
  base.create(model.anchor_count(), model.train_views);
  base.render = model.render;
  base.voxel_size = model.voxel_size;
  for (const ArenaLayout::Block& block : base.arena.layout().blocks()) {
    const BlockHandle source = model.arena.layout().find(block.name);
    COMPMARK_ASSERT(source.valid() && model.arena.layout().block(source).size() == block.size(),
                    "base_model: the base recipe has a block that the model has not");
    const MatrixView<const Scalar> values = model.arena.values(source);
    std::copy_n(values.data, block.size(), base.arena.all_values().data() + block.offset);
  }
  return base;
}

/// The other way: a finished model of the base with blocks for the stages of R, to be trained on: the mark is zero and
/// the networks are fresh.
template <Recipe R>
[[nodiscard]] Model<R> with_room_for_stages(const Model<typename R::Base>& base, std::uint64_t seed) {
  using Scalar = typename R::Scalar;
  Model<R> model;
  model.create(base.anchor_count(), base.train_views);
  model.render = base.render;
  model.voxel_size = base.voxel_size;
  model.initialise_stages(seed);
  for (const ArenaLayout::Block& block : base.arena.layout().blocks()) {
    const MatrixView<Scalar> values = model.arena.values(model.arena.layout().find(block.name));
    std::copy_n(base.arena.all_values().data() + block.offset, block.size(), values.data);
  }
  return model;
}

}  // namespace compmark
