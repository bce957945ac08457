// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/anchor_split.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/watermark/baselines/anchor_copies.hpp>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "support/directional.hpp"

using namespace compmark;

TEST_CASE("baselines/anchor_split: both halves are smaller and moved, and nothing else is touched") {
  using R = testing::SmoothRecipe;
  const Model<R> model = testing::random_model<R>(5);
  const std::vector<std::uint32_t> all{0, 1, 2, 3, 4}, split{1, 4};
  const Model<R> whole = with_copies(model, all, split);
  Model<R> halves = whole;
  split_copies(halves, split, 6);
  const auto before = whole.columns(), after = halves.columns();
  for (std::size_t row = 0; row < 7; ++row) {
    const bool is_half = row == 1 || row == 4 || row >= 5;
    CAPTURE(row);
    for (std::size_t c = 0; c < 6; ++c)
      CHECK(after.scaling(row, c) ==
            doctest::Approx(before.scaling(row, c) - (is_half && c >= 3 ? std::log(1.6) : 0)).epsilon(1e-12));
    for (std::size_t c = 0; c < after.offset.columns; ++c) {
      const double moved = std::abs(after.offset(row, c) - before.offset(row, c));
      // Half of the anchor's size, times a normal number: none of these few is above 4.
      const double size = std::exp(before.scaling(row, 3 + c % 3) - before.scaling(row, c % 3));
      CHECK((is_half ? moved > 0 && moved < 2 * size : moved == 0));
    }
  }
  // The two halves of an anchor lie apart, and another seed has other places.
  CHECK(after.offset(1, 0) != after.offset(5, 0));
  Model<R> others = whole;
  split_copies(others, split, 7);
  CHECK(others.columns().offset(1, 0) != after.offset(1, 0));
  for (const BlockHandle block : {whole.anchors.position, whole.anchors.feature}) {
    const auto kept = whole.arena.values(block), now = std::as_const(halves).arena.values(block);
    CHECK(std::equal(kept.flat().begin(), kept.flat().end(), now.flat().begin()));
  }
}
