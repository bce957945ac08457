// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cholesky factor A = L L^T of a dense symmetric matrix in double, of up to a few thousand rows, in blocks of columns,
// and the two triangular solves, in tiles that stay in registers (outer_tile.hpp). The same bits at any thread count.
// For a dozen rows at most, with nothing allocated: solve_positive in symmetric.hpp. Cost: n^3 / 3 multiply-adds for
// the factor, n^2 / 2 a column for a solve.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/outer_tile.hpp"

namespace compmark {

/// The lower factor of a symmetric matrix [n, n], row-major, in its place; what is above the diagonal is neither read
/// nor written. False, with the matrix spoilt, where it is not positive definite to rounding: a pivot of 1e-14 of what
/// stood on the diagonal, or not a number.
template <Executor E>
[[nodiscard]] bool cholesky_in_place(std::span<double> matrix, std::size_t n, E& executor) {
  COMPMARK_ASSERT(matrix.size() == n * n, "cholesky_in_place: size");
  constexpr std::size_t block = 64, strip = detail::strip_columns;
  std::vector<double> least_pivot(n);
  for (std::size_t i = 0; i < n; ++i) least_pivot[i] = 1e-14 * std::abs(matrix[i * n + i]);
  // What the columns from `begin` on leave of entry (i, j).
  const auto rest = [&](std::size_t i, std::size_t j, std::size_t begin) {
    const double *const row = matrix.data() + i * n, *const other = matrix.data() + j * n;
    double sum = row[j];
    for (std::size_t k = begin; k < j; ++k) sum -= row[k] * other[k];
    return sum;
  };
  std::vector<double> panel;  // strips [width, 16]: columns [begin, end) of the rows below
  for (std::size_t begin = 0; begin < n; begin += block) {
    const std::size_t end = std::min(n, begin + block), width = end - begin;
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = begin; j < i; ++j) matrix[i * n + j] = rest(i, j, begin) / matrix[j * n + j];
      const double pivot = rest(i, i, begin);
      if (!(pivot > least_pivot[i])) return false;
      matrix[i * n + i] = std::sqrt(pivot);
    }
    const std::size_t below = n - end, strips = detail::strips_of(below);
    panel.assign(strips * width * strip, 0.0);
    const auto rows_of = [&](std::size_t s) { return std::min(strip, below - s * strip); };
    executor.for_chunks(strips, 2, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t s = first; s < last; ++s) {
        double* const columns = panel.data() + s * width * strip;
        double* const corner = matrix.data() + (end + s * strip) * n + begin;
        for (std::size_t i = 0; i < rows_of(s); ++i) {
          for (std::size_t j = 0; j < width; ++j) columns[j * strip + i] = corner[i * n + j];
        }
        for (std::size_t j = 0; j < width; ++j) {
          const double* const row = matrix.data() + (begin + j) * n + begin;
          double* const column = columns + j * strip;
          for (std::size_t k = 0; k < j; ++k) {
            for (std::size_t i = 0; i < strip; ++i) column[i] -= row[k] * columns[k * strip + i];
          }
          for (std::size_t i = 0; i < strip; ++i) column[i] /= row[j];
        }
        for (std::size_t i = 0; i < rows_of(s); ++i) {
          for (std::size_t j = 0; j < width; ++j) corner[i * n + j] = columns[j * strip + i];
        }
      }
    });
    executor.for_chunks(strips, 2, [&](std::size_t first, std::size_t last, std::size_t) {
      double products[strip * strip];
      for (std::size_t s = first; s < last; ++s) {
        for (std::size_t t = 0; t <= s; ++t) {
          detail::strip_products(&panel[s * width * strip], &panel[t * width * strip], width, products);
          for (std::size_t i = 0; i < rows_of(s); ++i) {
            double* const row = matrix.data() + (end + s * strip + i) * n + end + t * strip;
            const std::size_t up_to = t == s ? i + 1 : strip;
            for (std::size_t c = 0; c < up_to; ++c) row[c] -= products[i * strip + c];
          }
        }
      }
    });
  }
  return true;
}

namespace detail {
/// Lanes in which the solves take their right-hand sides: 1 where so many do not fill whole registers.
template <std::size_t Columns>
inline constexpr int solve_lanes = Columns % static_cast<std::size_t>(native_width<double>) == 0 ? native_width<double>
                                                                                                 : 1;
}  // namespace detail

/// L y = b for `Columns` right-hand sides in the place of b [n, Columns], whose first `first` rows are zero. `lower` is
/// [n, n], above its diagonal anything.
template <std::size_t Columns>
void solve_lower(std::span<const double> lower, std::size_t n, std::size_t first, double* b) {
  constexpr int width = detail::solve_lanes<Columns>, packs = Columns % (2 * width) == 0 ? 2 : 1;
  constexpr std::size_t group = static_cast<std::size_t>(width * packs);  // right-hand sides of a tile
  constexpr int tile_rows = detail::outer_rows<double, width>;
  std::size_t i = first;
  if constexpr (width > 1) {
    constexpr std::size_t rows = static_cast<std::size_t>(tile_rows);
    for (; i + rows <= n; i += rows) {
      double known[rows * Columns];  // what the rows before the tile say
      for (std::size_t column = 0; column < Columns; column += group) {
        Pack<double, width> sum[tile_rows][packs];
        for (int r = 0; r < tile_rows; ++r) {
          for (int p = 0; p < packs; ++p) sum[r][p] = Pack<double, width>(0.0);
        }
        detail::outer_tile<double, width, tile_rows, packs>(lower.data() + i * n + first, n, 1,
                                                            b + first * Columns + column, Columns, i - first, sum);
        for (int r = 0; r < tile_rows; ++r) {
          double* const row = known + static_cast<std::size_t>(r) * Columns + column;
          for (int p = 0; p < packs; ++p) sum[r][p].store(row + p * width);
        }
      }
      for (std::size_t r = 0; r < rows; ++r) {
        const double* const row = lower.data() + (i + r) * n + i;
        double* const own = b + (i + r) * Columns;
        for (std::size_t c = 0; c < Columns; ++c) own[c] -= known[r * Columns + c];
        for (std::size_t k = 0; k < r; ++k) {
          for (std::size_t c = 0; c < Columns; ++c) own[c] -= row[k] * b[(i + k) * Columns + c];
        }
        for (std::size_t c = 0; c < Columns; ++c) own[c] /= row[r];
      }
    }
  }
  for (; i < n; ++i) {  // rows that fill no tile
    const double* const row = lower.data() + i * n;
    double sum[Columns] = {};
    for (std::size_t k = first; k < i; ++k) {
      for (std::size_t c = 0; c < Columns; ++c) sum[c] += row[k] * b[k * Columns + c];
    }
    for (std::size_t c = 0; c < Columns; ++c) b[i * Columns + c] = (b[i * Columns + c] - sum[c]) / row[i];
  }
}

/// L^T x = y in the place of y [n, Columns].
template <std::size_t Columns>
void solve_lower_transposed(std::span<const double> lower, std::size_t n, double* y) {
  constexpr int width = detail::solve_lanes<Columns>, packs = static_cast<int>(Columns) / width;
  constexpr std::size_t rows = 8;  // of L at once: every row of y before them is read and written once for so many
  using P = Pack<double, width>;
  for (std::size_t end = n; end > 0;) {
    const std::size_t begin = end > rows ? end - rows : 0;
    for (std::size_t i = end; i-- > begin;) {
      const double* const row = lower.data() + i * n;
      double* const x = y + i * Columns;
      for (std::size_t c = 0; c < Columns; ++c) x[c] /= row[i];
      for (std::size_t k = begin; k < i; ++k) {
        for (std::size_t c = 0; c < Columns; ++c) y[k * Columns + c] -= row[k] * x[c];
      }
    }
    for (std::size_t k = 0; k < begin; ++k) {
      double* const row = y + k * Columns;
      P rest[packs];
      for (int p = 0; p < packs; ++p) rest[p] = P::load(row + p * width);
      for (std::size_t i = end; i-- > begin;) {
        const P element(-lower[i * n + k]);
        for (int p = 0; p < packs; ++p) rest[p] = fma(element, P::load(y + i * Columns + p * width), rest[p]);
      }
      for (int p = 0; p < packs; ++p) rest[p].store(row + p * width);
    }
    end = begin;
  }
}

}  // namespace compmark
