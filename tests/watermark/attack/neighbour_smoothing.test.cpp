// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/attack/neighbour_smoothing.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/watermark/attack/model_attacks.hpp"

namespace neighbour_smoothing_test {
namespace {

using namespace compmark;

/// A grid of 7 x 6 x 5 anchors, a third apart.
struct Grid {
  static constexpr std::size_t sides[3] = {7, 6, 5}, rows = 7 * 6 * 5;
  ParameterArena<float> arena;
  BlockHandle position, feature, weight;
  Grid() {
    position = arena.add("anchor.position", rows, 3, RowKind::anchor, BlockRole::rendering, {});
    feature = arena.add("anchor.feature", rows, 4, RowKind::anchor, BlockRole::rendering, {});
    weight = arena.add("mlp_color.0.weight", 4, 4, RowKind::fixed, BlockRole::rendering, {});
    const Random random(5, 0, random_stage("test/grid"));
    std::uint64_t n = 0;
    for (float& value : arena.all_values()) value = static_cast<float>(random.normal(n++));
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        arena.values(position)(row, axis) = static_cast<float>(cell(row, axis)) / 3;
    }
  }
  [[nodiscard]] static std::size_t cell(std::size_t row, std::size_t axis) {
    return axis == 0 ? row % 7 : axis == 1 ? row / 7 % 6 : row / 42;
  }
  [[nodiscard]] static bool inside(std::size_t row) {
    bool in = true;
    for (std::size_t axis = 0; axis < 3; ++axis) in = in && cell(row, axis) > 0 && cell(row, axis) + 1 < sides[axis];
    return in;
  }
  [[nodiscard]] std::vector<float> of(BlockHandle block) const {
    const auto values = arena.values(block).flat();
    return {values.begin(), values.end()};
  }
};

}  // namespace

TEST_CASE("attack/neighbour_smoothing: strength 0 changes nothing, and at any other only features change, repeatably") {
  const Grid before;
  Grid none, once, again;
  REQUIRE(attack_model<ModelAttacks>("smooth_neighbours:0", none.arena).ok());
  CHECK(none.of(none.feature) == before.of(before.feature));
  REQUIRE(attack_model<ModelAttacks>("smooth_neighbours", once.arena, 1).ok());
  REQUIRE(attack_model<ModelAttacks>("smooth_neighbours", again.arena, 2).ok());
  CHECK(once.of(once.feature) == again.of(again.feature));
  CHECK(once.of(once.feature) != before.of(before.feature));
  CHECK(once.of(once.position) == before.of(before.position));
  CHECK(once.of(once.weight) == before.of(before.weight));
}

TEST_CASE("attack/neighbour_smoothing: a linear field is kept up to the edge, a curved one and noise are not") {
  const auto smoothed = [](const auto& field) {
    Grid grid;
    const MatrixView<float> feature = grid.arena.values(grid.feature);
    std::vector<double> before(Grid::rows);
    for (std::size_t row = 0; row < Grid::rows; ++row) {
      before[row] = field(row);
      for (std::size_t k = 0; k < feature.columns; ++k) feature(row, k) = static_cast<float>(before[row]);
    }
    REQUIRE(NeighbourSmoothingAttack::smooth(grid.arena, 1, 6).ok());  // the six faces of a cell
    double inside = 0, edge = 0;
    for (std::size_t row = 0; row < Grid::rows; ++row) {
      double& most = Grid::inside(row) ? inside : edge;
      most = std::max(most, std::abs(static_cast<double>(feature(row, 0)) - before[row]));
    }
    return std::vector<double>{inside, edge};
  };
  const auto x = [](std::size_t row, std::size_t axis) { return static_cast<double>(Grid::cell(row, axis)); };
  const std::vector<double> linear =
      smoothed([&](std::size_t row) { return 0.5 + x(row, 0) - 2 * x(row, 1) + 0.25 * x(row, 2); });
  CHECK(linear[0] < 1e-5);
  CHECK(linear[1] > 0.1);  // the control: at the edge neighbours are on one side
  // Six neighbours of weight 1/6, two of them a step along x: the mean of x^2 is larger by 1/3.
  CHECK(smoothed([&](std::size_t row) { return x(row, 0) * x(row, 0); })[0] == doctest::Approx(1.0 / 3).epsilon(1e-4));
  CHECK(smoothed([](std::size_t) { return 0.75; }) == std::vector<double>{0, 0});
}

TEST_CASE("attack/neighbour_smoothing: what anchors have for themselves is averaged away") {
  const auto spread = [](const Grid& grid) {
    double squares = 0;
    for (const float value : grid.of(grid.feature)) squares += static_cast<double>(value) * static_cast<double>(value);
    return std::sqrt(squares / static_cast<double>(4 * Grid::rows));
  };
  const Grid before;
  Grid half, whole;
  REQUIRE(attack_model<ModelAttacks>("smooth_neighbours:0.5", half.arena).ok());
  REQUIRE(attack_model<ModelAttacks>("smooth_neighbours:1", whole.arena).ok());
  CHECK(spread(whole) < 0.5 * spread(before));  // about 1 / sqrt(8) of independent numbers
  CHECK(spread(half) < 0.7 * spread(before));
  CHECK(spread(half) > spread(whole));
}

TEST_CASE("attack/neighbour_smoothing: anchors in one place or nowhere, one anchor, and none, are not a crash") {
  for (const std::size_t rows : {std::size_t{0}, std::size_t{1}, std::size_t{3}, std::size_t{20}}) {
    for (const float place : {0.0f, std::numeric_limits<float>::quiet_NaN()}) {
      CAPTURE(rows);
      CAPTURE(place);
      ParameterArena<float> arena;
      const BlockHandle position = arena.add("anchor.position", rows, 3, RowKind::anchor, BlockRole::rendering, {});
      const BlockHandle feature = arena.add("anchor.feature", rows, 2, RowKind::anchor, BlockRole::rendering, {});
      for (float& value : arena.values(position).flat()) value = place;
      for (std::size_t row = 0; row < rows; ++row) arena.values(feature)(row, 1) = static_cast<float>(row);
      REQUIRE(attack_model<ModelAttacks>("smooth_neighbours:1", arena).ok());
      for (const float value : arena.values(feature).flat()) CHECK(std::isfinite(value));
      if (rows == 3 && place == 0) CHECK(arena.values(feature)(0, 1) == doctest::Approx(1.5));  // of rows 1 and 2
      if (place != 0 && rows > 0) CHECK(arena.values(feature)(rows - 1, 1) == static_cast<float>(rows - 1));
    }
  }
}

}  // namespace neighbour_smoothing_test
