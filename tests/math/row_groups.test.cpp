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
#include "support/spread_rows.hpp"

namespace {

using namespace compmark;
using compmark::testing::spread_rows;

}  // namespace

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
