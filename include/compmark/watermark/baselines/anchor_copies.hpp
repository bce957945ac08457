// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A model with some of its anchors, and copies of some behind them. A copy has every attribute of its anchor, so that
// its Gaussians lie in those of the original: where all anchors are copied, the transmittance of every pixel is squared
// and an opacity a becomes 1 - (1 - a)^2. Cost: a copy of the model.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/config.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/recipe.hpp"

namespace compmark {

/// The anchors `kept` (rows of `model`, ascending), then copies of the rows `copied`.
template <Recipe R>
[[nodiscard]] Model<R> with_copies(const Model<R>& model, std::span<const std::uint32_t> kept,
                                   std::span<const std::uint32_t> copied) {
  Model<R> result = model;
  result.arena.edit_rows(RowEdit{kept, copied.size()});
  const auto blocks = model.arena.layout().blocks();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const ArenaLayout::Block& from = blocks[b];
    if (from.kind != RowKind::anchor) continue;
    const ArenaLayout::Block& to = result.arena.layout().blocks()[b];
    const auto* const source = model.arena.all_values().data() + from.offset;
    auto* const target = result.arena.all_values().data() + to.offset;
    for (std::size_t i = 0; i < copied.size(); ++i) {
      COMPMARK_ASSERT(copied[i] < from.rows, "with_copies: a row beyond the model");
      std::copy_n(source + copied[i] * from.columns, from.columns, target + (kept.size() + i) * to.columns);
    }
  }
  return result;
}

}  // namespace compmark
