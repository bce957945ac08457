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

/// L y = b for `Columns` right-hand sides in the place of b [n, Columns], whose first `first` rows are zero. `lower` is
/// [n, n], above its diagonal anything.
template <std::size_t Columns>
void solve_lower(std::span<const double> lower, std::size_t n, std::size_t first, double* b) {
  constexpr int columns = static_cast<int>(Columns), most = native_width<double>;
  constexpr int width = columns % most == 0 && columns <= 2 * most ? most : 1;  // a row of b, in one or two packs
  constexpr int rows = width > 1 ? detail::outer_rows<double, width> : 1, packs = columns / width;
  std::size_t i = first;
  for (; width > 1 && i + rows <= n; i += rows) {
    Pack<double, width> sum[rows][packs];
    for (int r = 0; r < rows; ++r) {
      for (int p = 0; p < packs; ++p) sum[r][p] = Pack<double, width>(0.0);
    }
    detail::outer_tile<double, width, rows, packs>(lower.data() + i * n + first, n, 1, b + first * Columns, Columns,
                                                   i - first, sum);
    double known[rows * Columns];
    for (int r = 0; r < rows; ++r) {
      for (int p = 0; p < packs; ++p) sum[r][p].store(known + r * columns + p * width);
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
  for (; i < n; ++i) {
    const double* const row = lower.data() + i * n;
    double sum[Columns];
    std::copy_n(b + i * Columns, Columns, sum);
    for (std::size_t k = first; k < i; ++k) {
      for (std::size_t c = 0; c < Columns; ++c) sum[c] -= row[k] * b[k * Columns + c];
    }
    for (std::size_t c = 0; c < Columns; ++c) b[i * Columns + c] = sum[c] / row[i];
  }
}

/// L^T x = y in the place of y [n, Columns].
template <std::size_t Columns>
void solve_lower_transposed(std::span<const double> lower, std::size_t n, double* y) {
  for (std::size_t i = n; i-- > 0;) {
    const double* const row = lower.data() + i * n;
    double* const x = y + i * Columns;
    for (std::size_t c = 0; c < Columns; ++c) x[c] /= row[i];
    for (std::size_t k = 0; k < i; ++k) {
      for (std::size_t c = 0; c < Columns; ++c) y[k * Columns + c] -= row[k] * x[c];
    }
  }
}

}  // namespace compmark
