// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/hac/hash_grid_cell.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "compmark/codec/hac/hash_grid_lanes.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

constexpr HashGridShape cell_shape{};

/// body(dimensions, dense) of a level.
template <class Body>
void dispatch_cell(const HashGridLevel& level, const Body& body) {
  using Two = std::integral_constant<int, 2>;
  using Three = std::integral_constant<int, 3>;
  if (level.dimensions == 3) {
    level.dense ? body(Three{}, std::true_type{}) : body(Three{}, std::false_type{});
  } else {
    level.dense ? body(Two{}, std::true_type{}) : body(Two{}, std::false_type{});
  }
}
template <class T>
std::vector<T> cell_positions(std::size_t count) {
  const Random random(5, 0, random_stage("hash grid cell test"));
  std::vector<T> unit(3 * count);
  for (std::size_t i = 0; i < unit.size(); ++i) {
    const double t = random.uniform(i);
    unit[i] = static_cast<T>(i % 5 == 0 ? t / 1000 : (i % 5 == 1 ? 1 - t / 1000 : t));  // many near the edges
  }
  for (std::size_t i = 0; i < 3; ++i) unit[i] = T(0), unit[3 + i] = T(1);
  return unit;
}

/// Corners against the layout's own numbering and against products of weights in double; how many neighbours the clamp
/// has moved.
template <class T>
std::size_t check_corners(double tolerance) {
  constexpr std::size_t count = 64;
  const std::vector<T> unit = cell_positions<T>(count);
  std::size_t clamped = 0, wrong_entries = 0;
  double worst = 0, worst_sum = 0;
  for (int index = 0; index < cell_shape.levels(); ++index) {
    const HashGridLevel level = cell_shape.level(index);
    dispatch_cell(level, [&](auto dimensions, auto dense) {
      for (std::size_t row = 0; row < count; ++row) {
        const detail::GridCell<T, dimensions> cell(level, unit.data() + 3 * row);
        REQUIRE(cell.inside);
        std::array<std::array<int, 2>, 3> vertex{};
        std::array<std::array<double, 2>, 3> share{};
        for (std::size_t d = 0; d < static_cast<std::size_t>(dimensions()); ++d) {
          const T t = unit[3 * row + static_cast<std::size_t>(level.axis[d])];
          const T p = std::fma(t, static_cast<T>(level.resolution - 2), T(0.5));
          const int below = static_cast<int>(std::floor(p));
          for (int side = 0; side < 2; ++side) {
            vertex[d][static_cast<std::size_t>(side)] = level.clamped(below + side);
            clamped += level.clamped(below + side) != below + side ? 1 : 0;
          }
          share[d] = {1 - (static_cast<double>(p) - below), static_cast<double>(p) - below};
        }
        std::size_t corner = 0;
        double sum = 0;
        cell.template corners<dense()>(level, [&](std::uint32_t entry, T weight) {
          const std::size_t a = corner & 1, b = corner >> 1 & 1, c = corner >> 2;
          const std::uint32_t expected =
              level.entry(static_cast<std::uint32_t>(vertex[0][a]), static_cast<std::uint32_t>(vertex[1][b]),
                          static_cast<std::uint32_t>(vertex[2][c]));
          wrong_entries += entry != expected ? 1 : 0;
          const double product = share[0][a] * share[1][b] * (dimensions() == 3 ? share[2][c] : 1);
          worst = std::max(worst, std::abs(static_cast<double>(weight) - product));
          sum += static_cast<double>(weight);
          ++corner;
        });
        CHECK(corner == std::size_t{1} << dimensions());
        worst_sum = std::max(worst_sum, std::abs(sum - 1));
      }
    });
  }
  CHECK(wrong_entries == 0);
  CHECK(worst < tolerance);
  CHECK(worst_sum < 8 * tolerance);
  return clamped;
}

}  // namespace

TEST_CASE("hac/hash_grid_cell: corners are the layout's entries, weights linear, their sum 1") {
  // Three roundings of a weight below 1, and the difference from p itself: four units.
  CHECK(check_corners<double>(4 * 2.3e-16) >
        100);  // the control: without the clamp these would be vertices that do not exist
  CHECK(check_corners<float>(4 * 1.2e-7) > 100);
}

TEST_CASE("hac/hash_grid_cell: outside of the box in an axis that the level reads, or not a number: not inside") {
  const HashGridLevel volume = cell_shape.level(0), plane = cell_shape.level(12);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), huge = std::numeric_limits<double>::infinity();
  for (const double bad : {-1e-9, 1 + 1e-9, nan, huge, -huge}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      std::array<double, 3> unit{0.5, 0.5, 0.5};
      unit[axis] = bad;
      CHECK_FALSE(detail::GridCell<double, 3>(volume, unit.data()).inside);
      const bool read = plane.axis[0] == static_cast<int>(axis) || plane.axis[1] == static_cast<int>(axis);
      CHECK(detail::GridCell<double, 2>(plane, unit.data()).inside == !read);
    }
  }
}

TEST_CASE("hac/hash_grid_cell: sixteen lanes have the same entries and weights to the bit" *
          doctest::skip(!detail::has_grid_lanes<float>)) {
  if constexpr (detail::has_grid_lanes<float>) {
    std::vector<float> unit = cell_positions<float>(16);
    unit[3 * 9 + 1] = -0.25f;
    unit[3 * 11] = std::numeric_limits<float>::quiet_NaN();
    alignas(64) float soa[3 * 16];
    detail::by_axis(unit.data(), soa);
    std::size_t compared = 0, different = 0, outside = 0;
    for (int index = 0; index < cell_shape.levels(); ++index) {
      const HashGridLevel level = cell_shape.level(index);
      dispatch_cell(level, [&](auto dimensions, auto dense) {
        using Lanes = detail::GridLanes<dimensions(), dense()>;
        detail::GridBlock<Lanes::corners> block;
        Lanes(level, soa, 16).store(block);
        for (std::size_t i = 0; i < 16; ++i) {
          const detail::GridCell<float, dimensions> cell(level, unit.data() + 3 * i);
          CHECK(cell.inside == ((block.inside >> i & 1u) != 0));
          if (!cell.inside) {
            ++outside;
            continue;
          }
          int corner = 0;
          cell.template corners<dense()>(level, [&](std::uint32_t entry, float weight) {
            different += entry != block.entry[corner][i] || weight != block.weight[corner][i] ? 1 : 0;
            ++corner;
            ++compared;
          });
        }
      });
    }
    CHECK(different == 0);
    CHECK(compared > 1500);
    CHECK(outside > 24);
  }
}
