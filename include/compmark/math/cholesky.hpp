// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cholesky factor A = L L^T of a dense symmetric matrix in double, of up to a few thousand rows, in blocks of columns,
// and the two triangular solves, in plain loops that a compiler turns into vectors. The same bits at any thread count.
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

namespace compmark {

/// The lower factor of a symmetric matrix [n, n], row-major, in its place; what is above the diagonal is neither read
/// nor written. False, with the matrix spoilt, where it is not positive definite to rounding: a pivot of 1e-14 of what
/// stood on the diagonal, or not a number.
template <Executor E>
[[nodiscard]] bool cholesky_in_place(std::span<double> matrix, std::size_t n, E& executor) {
  COMPMARK_ASSERT(matrix.size() == n * n, "cholesky_in_place: size");
  constexpr std::size_t block = 64, tile_rows = 4, tile_columns = 16, grain = 32;
  std::vector<double> least_pivot(n);
  for (std::size_t i = 0; i < n; ++i) least_pivot[i] = 1e-14 * std::abs(matrix[i * n + i]);
  // What the columns from `begin` on leave of entry (i, j).
  const auto rest = [&](std::size_t i, std::size_t j, std::size_t begin) {
    const double *const row = matrix.data() + i * n, *const other = matrix.data() + j * n;
    double sum = row[j];
    for (std::size_t k = begin; k < j; ++k) sum -= row[k] * other[k];
    return sum;
  };
  std::vector<double> panel;  // columns [begin, end) of the rows below, a row a column, in whole tiles
  for (std::size_t begin = 0; begin < n; begin += block) {
    const std::size_t end = std::min(n, begin + block), width = end - begin;
    for (std::size_t i = begin; i < end; ++i) {
      for (std::size_t j = begin; j < i; ++j) matrix[i * n + j] = rest(i, j, begin) / matrix[j * n + j];
      const double pivot = rest(i, i, begin);
      if (!(pivot > least_pivot[i])) return false;
      matrix[i * n + i] = std::sqrt(pivot);
    }
    const std::size_t below = n - end;
    if (below == 0) break;
    const std::size_t padded = (below + tile_columns - 1) / tile_columns * tile_columns;
    panel.assign(width * padded, 0.0);
    executor.for_chunks(below, grain, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i) {
        double* const row = matrix.data() + (end + i) * n;
        for (std::size_t j = begin; j < end; ++j) {
          row[j] = rest(end + i, j, begin) / matrix[j * n + j];
          panel[(j - begin) * padded + i] = row[j];
        }
      }
    });
    executor.for_chunks(below, grain, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; i += tile_rows) {
        const std::size_t rows = std::min(tile_rows, last - i);
        for (std::size_t j = 0; j < i + rows; j += tile_columns) {  // up to the diagonal
          double sum[tile_rows][tile_columns] = {};
          for (std::size_t k = 0; k < width; ++k) {
            const double *const x = panel.data() + k * padded + i, *const y = panel.data() + k * padded + j;
            for (std::size_t r = 0; r < rows; ++r) {
              for (std::size_t c = 0; c < tile_columns; ++c) sum[r][c] += x[r] * y[c];
            }
          }
          for (std::size_t r = 0; r < rows; ++r) {
            double* const row = matrix.data() + (end + i + r) * n + end;
            for (std::size_t c = 0; c < tile_columns && j + c <= i + r; ++c) row[j + c] -= sum[r][c];
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
  for (std::size_t i = first; i < n; ++i) {
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
