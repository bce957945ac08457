// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The anchor table in its arena: names, shapes, and law A5 (row edits move all columns in step).
#include "compmark/splat/anchor/table.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

using namespace compmark;

TEST_CASE("anchor/table: names and shapes follow the decoder's shape") {
  ParameterArena<float> arena;
  const AnchorHandles anchors = add_anchor_blocks(arena, 7, DecoderShape{50, 4});
  const AnchorColumns<float> columns = anchor_values(arena, anchors);
  CHECK(columns.rows() == 7);
  CHECK(columns.position.columns == 3);
  CHECK(columns.offset.columns == 12);
  CHECK(columns.scaling.columns == 6);
  CHECK(columns.feature.columns == 50);
  CHECK(arena.layout().block(anchors.feature).name == "anchor.feature");
  CHECK(arena.layout().block(anchors.feature).kind == RowKind::anchor);
  const AnchorHandles found = find_anchor_blocks(arena.layout());
  CHECK(found.position.index == anchors.position.index);
  CHECK(found.feature.index == anchors.feature.index);
  CHECK(anchor_count(arena.layout(), anchors) == 7);
  CHECK_FALSE(find_anchor_blocks(ArenaLayout{}).offset.valid());
}

TEST_CASE("anchor/table: keep and append move all columns in step (A5)") {
  ParameterArena<double> arena;
  const AnchorHandles anchors = add_anchor_blocks(arena, 5, DecoderShape{8, 2});
  const auto mark = [](const AnchorColumns<double>& columns, std::size_t row, double value) {
    for (const MatrixView<double>& block : {columns.position, columns.offset, columns.scaling, columns.feature}) {
      for (std::size_t c = 0; c < block.columns; ++c) block(row, c) = value + static_cast<double>(c) / 100;
    }
  };
  for (std::size_t row = 0; row < 5; ++row) mark(anchor_values(arena, anchors), row, static_cast<double>(row));
  const std::vector<std::uint32_t> kept{0, 3, 4};
  arena.edit_rows({kept, 2});
  const AnchorColumns<double> columns = anchor_values(arena, anchors);
  CHECK(columns.rows() == 5);
  CHECK(anchor_gradients(arena, anchors).rows() == 5);
  for (const MatrixView<double>& block : {columns.position, columns.offset, columns.scaling, columns.feature}) {
    for (std::size_t row = 0; row < 5; ++row) {
      for (std::size_t c = 0; c < block.columns; ++c)
        CHECK(block(row, c) == (row < 3 ? kept[row] + static_cast<double>(c) / 100 : 0));
    }
  }
}

TEST_CASE("anchor/table: a shape says how many inputs its heads have") {
  static_assert(DecoderShape{}.head_inputs() == 35);
  static_assert(DecoderShape{32, 10, true}.head_inputs() == 36);
  static_assert(DecoderShape{32, 10, true, false, 8}.color_inputs() == 44);
  static_assert(!DecoderShape{50, 10, false, true}.valid(), "a feature bank needs a width divisible by 4");
  static_assert(DecoderShape{50, 10}.valid());
  CHECK(DecoderShape{} == DecoderShape{32, 10, false, false, 0});
}
