// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cells: rounding (docs/spec/numerics.md, AN1), full comparison (AN3, with the packed key that merges cells as negative
// control).
#include "compmark/splat/anchor/cells.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <set>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

TEST_CASE("anchor/cells: ties go to even (numerics AN1)") {
  const auto x_of = [](float x) {
    const std::array<float, 3> position{x, 0, 0};
    Cell cell;
    REQUIRE(cell_of(position.data(), 1.0, cell));
    return cell.x;
  };
  CHECK(x_of(0.5f) == 0);
  CHECK(x_of(-0.5f) == 0);
  CHECK(x_of(1.5f) == 2);
  CHECK(x_of(-1.5f) == -2);
  CHECK(x_of(2.5f) == 2);
  CHECK(x_of(-2.5f) == -2);
  CHECK(std::round(2.5f) == 3);  // negative controls: the other two conventions
  CHECK(std::floor(-1.5f + 0.5f) == -1);
}

TEST_CASE("anchor/cells: a position is the middle of its cell without bias, and comes back to it (QZ3)") {
  const double size = 0.013;
  const Random random(5, 0, random_stage("test/cells"));
  double sum = 0, sum_down = 0;
  constexpr std::uint64_t count = 100000;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::array<float, 3> position{static_cast<float>(random.uniform(i)), 0, 0};
    Cell cell;
    REQUIRE(cell_of(position.data(), size, cell));
    sum += cell.x - static_cast<double>(position[0]) / size;
    sum_down += std::floor(static_cast<double>(position[0]) / size) - static_cast<double>(position[0]) / size;
  }
  CHECK(std::abs(sum / count) < 0.02);       // in cells; the standard error is 0.001
  CHECK(std::abs(sum_down / count) > 0.45);  // negative control: rounded down, half a cell
  for (std::int32_t x = -32768; x < 32768; ++x) {
    const std::array<float, 3> middle{static_cast<float>(x * size), 0, 0};  // as an anchor's position is stored
    Cell cell;
    REQUIRE(cell_of(middle.data(), size, cell));
    REQUIRE(cell.x == x);
  }
}

TEST_CASE("anchor/cells: what is not in a cell is refused") {
  Cell cell;
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -3e9f, 2147483648.0f}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::array<float, 3> position{0, 0, 0};
      position[axis] = bad;
      CHECK_FALSE(cell_of(position.data(), 1.0, cell));
    }
  }
  const std::array<double, 3> edge{2147483647.0, -2147483647.0, 0};
  CHECK(cell_of(edge.data(), 1.0, cell));
  CHECK(cell == Cell{2147483647, -2147483647, 0});
  const std::array<float, 3> any{1, 1, 1};
  CHECK_FALSE(cell_of(any.data(), 0.0, cell));  // a cell of size zero holds nothing
}

TEST_CASE("anchor/cells: a million units away neighbouring cells are told apart, which float quotients do not") {
  const std::array<double, 3> near{1e6, 0, 0}, next{1e6 + 0.001, 0, 0};
  Cell a, b;
  REQUIRE(cell_of(near.data(), 0.001, a));
  REQUIRE(cell_of(next.data(), 0.001, b));
  CHECK(a.x == 1000000000);
  CHECK(b.x == a.x + 1);
  CHECK(std::nearbyint(static_cast<float>(near[0]) / 0.001f) == std::nearbyint(static_cast<float>(next[0]) / 0.001f));
}

TEST_CASE("anchor/cells: a cloud with outliers has as many cells as std::set says (numerics AN3)") {
  const Random random(1, 2, 3);
  std::vector<Cell> cells;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const double spread = i % 10 == 0 ? 1e6 : 0.05;
    const std::array<double, 3> position{(random.uniform(3 * i) - 0.5) * spread,
                                         (random.uniform(3 * i + 1) - 0.5) * spread,
                                         (random.uniform(3 * i + 2) - 0.5) * spread};
    Cell cell;
    REQUIRE(cell_of(position.data(), 0.001, cell));
    cells.push_back(cell);
    cells.push_back({cell.x + (1 << 21), cell.y, cell.z});  // the same 21 low bits
  }
  std::set<Cell> expected;
  std::set<std::uint64_t> packed;
  CellSet set;
  set.reset(cells.size());
  for (const Cell& cell : cells) {
    const std::uint32_t number = set.insert(cell);
    CHECK(set.cells()[number] == cell);
    expected.insert(cell);
    const auto low = [](std::int32_t v) {
      return static_cast<std::uint64_t>(static_cast<std::uint32_t>(v)) & 0x1FFFFF;
    };
    packed.insert(low(cell.x) | low(cell.y) << 21 | low(cell.z) << 42);
  }
  CHECK(set.size() == expected.size());
  CHECK(packed.size() < expected.size());  // negative control
  for (const Cell& cell : cells) REQUIRE(set.cells()[set.find(cell)] == cell);
  CHECK(set.find({1 << 30, 7, 7}) == CellSet::none);
  set.reset(0);
  CHECK(set.find(cells[0]) == CellSet::none);
}
