// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/core/parameters.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string>

using namespace compmark;

namespace {

template <class T>
struct SmallArena {
  ParameterArena<T> arena;
  BlockHandle position =
      arena.add("anchor.position", 5, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  BlockHandle weight = arena.add("mlp.weight", 4, 7, RowKind::fixed, BlockRole::rendering, LearningSchedule::fixed());
  BlockHandle feature =
      arena.add("anchor.feature", 5, 2, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());

  SmallArena() {
    const auto fill = [](MatrixView<T> view, T start) {
      const auto flat = view.flat();
      std::iota(flat.begin(), flat.end(), start);
    };
    fill(arena.values(position), T(100));
    fill(arena.values(weight), T(200));
    fill(arena.values(feature), T(300));
  }
};

}  // namespace

TEST_CASE_TEMPLATE("core/parameters: blocks are named, aligned and do not overlap", T, float, double) {
  SmallArena<T> small;
  const ArenaLayout& layout = small.arena.layout();
  CHECK(layout.find("mlp.weight").index == small.weight.index);
  CHECK_FALSE(layout.find("absent").valid());
  std::size_t end = 0;
  for (const ArenaLayout::Block& block : layout.blocks()) {
    CHECK(block.offset % 16 == 0);
    CHECK(block.offset >= end);
    end = block.offset + block.size();
  }
  CHECK(layout.size() >= end);
  CHECK(small.arena.values(small.position)(0, 0) == T(100));  // adding later blocks kept the values of earlier ones
  CHECK(small.arena.gradients(small.weight).rows == 4);
  CHECK(small.arena.gradients(small.weight).columns == 7);
}

TEST_CASE("core/parameters: a block more does not copy those that stand already") {
  // A model adds a few large blocks and some twenty small ones. An arena that takes exactly what it needs moves with
  // every one of them.
  ParameterArena<float> arena;
  int moves = 0;
  const float* last = nullptr;
  for (int block = 0; block < 100; ++block) {
    arena
        .values(arena.add("block" + std::to_string(block), 64, 16, RowKind::fixed, BlockRole::rendering,
                          LearningSchedule::fixed()))
        .flat()[0] = static_cast<float>(block);
    moves += arena.all_values().data() == last ? 0 : 1;
    last = arena.all_values().data();
  }
  CHECK(moves <= 13);  // memory grows by a half: 1.5^12 > 100
  for (std::size_t block = 0; block < 100; ++block) {
    CHECK(arena.values(BlockHandle{block})(0, 0) == static_cast<float>(block));
    CHECK(arena.values(BlockHandle{block})(63, 15) == 0.0f);
  }
  for (const float gradient : arena.all_gradients()) CHECK(gradient == 0.0f);
}

TEST_CASE_TEMPLATE("core/parameters: one edit keeps and appends rows of all anchor blocks in step", T, float, double) {
  SmallArena<T> small;
  const std::array<std::uint32_t, 3> kept{0, 2, 4};
  small.arena.all_gradients()[0] = T(1);
  small.arena.edit_rows({kept, 2});

  const auto position = small.arena.values(small.position);
  const auto feature = small.arena.values(small.feature);
  REQUIRE(position.rows == 5);
  REQUIRE(feature.rows == 5);
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) CHECK(position(row, c) == T(100) + static_cast<T>(kept[row] * 3 + c));
    for (std::size_t c = 0; c < 2; ++c) CHECK(feature(row, c) == T(300) + static_cast<T>(kept[row] * 2 + c));
  }
  for (std::size_t row = 3; row < 5; ++row) {
    for (std::size_t c = 0; c < 3; ++c) CHECK(position(row, c) == T(0));
    for (std::size_t c = 0; c < 2; ++c) CHECK(feature(row, c) == T(0));
  }
  const auto weight = small.arena.values(small.weight);
  REQUIRE(weight.rows == 4);
  for (std::size_t i = 0; i < weight.size(); ++i) CHECK(weight.data[i] == T(200) + static_cast<T>(i));
  for (const T gradient : small.arena.all_gradients()) CHECK(gradient == T(0));
}

TEST_CASE_TEMPLATE("core/parameters: an edit that keeps every row changes no value", T, float, double) {
  SmallArena<T> small;
  const Buffer<T> before = [&] {
    Buffer<T> copy(small.arena.all_values().size());
    std::copy(small.arena.all_values().begin(), small.arena.all_values().end(), copy.begin());
    return copy;
  }();
  const std::array<std::uint32_t, 5> all{0, 1, 2, 3, 4};
  small.arena.edit_rows({all, 0});
  REQUIRE(small.arena.all_values().size() == before.size());
  for (std::size_t i = 0; i < before.size(); ++i) CHECK(small.arena.all_values()[i] == before[i]);
}

TEST_CASE("core/parameters: moments moved by move_rows stay in step with the values") {
  SmallArena<float> small;
  const ArenaLayout old_layout = small.arena.layout();
  Buffer<float> moments(old_layout.size());
  std::copy(small.arena.all_values().begin(), small.arena.all_values().end(), moments.begin());
  const std::array<std::uint32_t, 2> kept{1, 3};
  const RowEdit edit{kept, 4};
  small.arena.edit_rows(edit);
  Buffer<float> moved(small.arena.layout().size());
  move_rows<float>(old_layout, small.arena.layout(), edit, moments.span(), moved.span());
  for (std::size_t i = 0; i < moved.size(); ++i) CHECK(moved[i] == small.arena.all_values()[i]);
}

TEST_CASE("core/parameters: all rows can go and come back") {
  SmallArena<float> small;
  small.arena.edit_rows({{}, 0});
  CHECK(small.arena.values(small.position).rows == 0);
  small.arena.edit_rows({{}, 7});
  CHECK(small.arena.values(small.position).rows == 7);
  CHECK(small.arena.values(small.weight)(3, 6) == 200.0f + 27.0f);
}

TEST_CASE("core/parameters: gradients take memory when one is written first, are zero then, and follow the blocks") {
  ParameterArena<float> arena;
  const LearningSchedule schedule = LearningSchedule::constant(0.1);
  const BlockHandle first = arena.add("first", 3, 2, RowKind::anchor, BlockRole::rendering, schedule);
  const std::size_t values_alone = arena.memory_bytes();
  CHECK_FALSE(arena.has_gradients());
  CHECK(std::as_const(arena).all_gradients().empty());
  arena.values(first)(1, 1) = 5;
  CHECK(arena.memory_bytes() == values_alone);  // nobody who reads values pays for gradients
  arena.gradients(first)(1, 1) = 7;
  CHECK(arena.has_gradients());
  CHECK(arena.memory_bytes() > values_alone);
  CHECK(std::as_const(arena).gradients(first)(0, 0) == 0);
  const BlockHandle second = arena.add("second", 1, 40, RowKind::fixed, BlockRole::rendering, schedule);
  CHECK_FALSE(arena.has_gradients());
  CHECK(arena.gradients(second)(0, 39) == 0);
  CHECK(arena.gradients(first)(1, 1) == 7);  // what was there stays
  const std::vector<std::uint32_t> kept{1};
  arena.edit_rows({kept, 2});
  CHECK(arena.has_gradients());
  CHECK(arena.gradients(first)(0, 1) == 0);
  CHECK(arena.values(first)(0, 1) == 5);
}
