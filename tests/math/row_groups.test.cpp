// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/row_groups.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/math/principal_axes.hpp"

namespace {

using namespace compmark;

/// Rows that differ much in few directions, not along the columns.
std::vector<float> spread_rows(std::size_t rows, std::size_t columns, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("test/row groups"));
  std::vector<float> made(rows * columns);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t k = 0; k < columns; ++k) {
      const std::size_t at = row * columns + k;
      made[at] =
          static_cast<float>(3 * random.normal(row) * std::sin(static_cast<double>(k)) + random.normal(9'000 + at));
    }
  }
  return made;
}

}  // namespace

TEST_CASE("math/principal_axes: orthonormal, the widest first, and no two rows nearer than in their coordinates") {
  constexpr std::size_t rows = 500, columns = 24;
  const std::vector<float> numbers = spread_rows(rows, columns, 1);
  const MatrixView<const float> view{numbers.data(), rows, columns};
  const PrincipalAxes axes = PrincipalAxes::of(view);
  REQUIRE(axes.axes.size() == PrincipalAxes::most * columns);
  for (std::size_t a = 0; a < PrincipalAxes::most; ++a) {
    for (std::size_t b = 0; b < PrincipalAxes::most; ++b) {
      double product = 0;
      for (std::size_t k = 0; k < columns; ++k) product += axes.axes[a * columns + k] * axes.axes[b * columns + k];
      CHECK(std::abs(product - (a == b ? 1 : 0)) < 1e-12);
    }
  }
  std::vector<std::array<float, PrincipalAxes::most>> at(rows);
  std::array<double, PrincipalAxes::most> variance{};
  for (std::size_t row = 0; row < rows; ++row) {
    const double length = axes.coordinates(view.row(row), at[row]);
    double inside = 0;
    for (std::size_t a = 0; a < PrincipalAxes::most; ++a) {
      inside += static_cast<double>(at[row][a]) * static_cast<double>(at[row][a]);
      variance[a] += static_cast<double>(at[row][a]) * static_cast<double>(at[row][a]) / rows;
    }
    CHECK(std::sqrt(inside) <= length * (1 + 1e-6));
  }
  for (std::size_t a = 1; a < PrincipalAxes::most; ++a) CHECK(variance[a] <= variance[a - 1] * (1 + 1e-6));
  CHECK(variance[0] > 10 * variance[1]);  // the direction that was put in
  for (std::size_t row = 1; row < rows; ++row) {
    double inside = 0;
    for (std::size_t a = 0; a < PrincipalAxes::most; ++a)
      inside += std::pow(static_cast<double>(at[row][a]) - static_cast<double>(at[row - 1][a]), 2);
    CHECK(inside <= static_cast<double>(squared_row_distance(view.row(row), view.row(row - 1), columns)) * (1 + 1e-5));
  }
}

TEST_CASE("math/row_groups: every row that is within reach is visited, once, and what is visited is within reach") {
  constexpr std::size_t rows = 900, asked = 40;
  // In coordinates of 8 columns rows are as far apart as they are, so that rounding alone decides at the reach itself.
  for (const std::size_t columns : {8u, 24u}) {
    CAPTURE(columns);
    const std::vector<float> numbers = spread_rows(rows, columns, 2), other = spread_rows(asked, columns, 3);
    const MatrixView<const float> view{numbers.data(), rows, columns};
    const PrincipalAxes axes = PrincipalAxes::of(view);
    ThreadExecutor executor(2);
    const RowGroups groups(view, axes, executor);
    std::vector<std::uint32_t> order = groups.order();
    std::sort(order.begin(), order.end());
    REQUIRE(order.size() == rows);
    for (std::uint32_t row = 0; row < rows; ++row) REQUIRE(order[row] == row);
    using Found = std::vector<std::pair<std::uint32_t, float>>;
    std::vector<RowGroups::Query> queries(asked);
    std::vector<Found> expected(asked), found(asked);
    std::size_t all = 0;
    for (std::size_t q = 0; q < asked; ++q) {
      std::vector<float> distance;
      for (std::uint32_t row = 0; row < rows; ++row)
        distance.push_back(squared_row_distance(other.data() + q * columns, view.row(row), columns));
      std::vector<float> sorted = distance;
      std::sort(sorted.begin(), sorted.end());
      // To the very distance of a row: of every second the nearest, of the others from none to many.
      queries[q] = {other.data() + q * columns, q == 0 ? -1.0f : sorted[q % 2 == 1 ? 0 : q * q / 4]};
      for (std::uint32_t row = 0; row < rows; ++row) {
        if (distance[row] <= queries[q].reach) expected[q].emplace_back(row, distance[row]);
      }
      all += expected[q].size();
    }
    const std::vector<RowGroups::Query> before = queries;
    groups.within(queries, [&](std::size_t q, float distance, std::uint32_t row) {
      found[q].emplace_back(row, distance);
      return before[q].reach;
    });
    for (Found& of : found) std::sort(of.begin(), of.end());
    CHECK(found == expected);
    CHECK(all > 2000);
    // One who has enough is asked no more.
    queries = before;
    std::vector<std::size_t> calls(asked);
    groups.within(queries, [&](std::size_t q, float, std::uint32_t) {
      ++calls[q];
      return -1.0f;
    });
    for (std::size_t q = 0; q < asked; ++q) CHECK(calls[q] == (q == 0 ? 0 : 1));
  }
}
