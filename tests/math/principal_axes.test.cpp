// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/principal_axes.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/math/row_groups.hpp"
#include "support/spread_rows.hpp"

using namespace compmark;
using compmark::testing::spread_rows;

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
