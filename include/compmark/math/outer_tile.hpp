// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A tile of X^T Y in registers, where only the caller knows the lengths: the inner loop of Gram matrices, of Cholesky
// factors and of solves with many right-hand sides (row_products.hpp, cholesky.hpp). Products whose shape the compiler
// knows: dense.hpp. Each sum is one chain of multiply-adds in ascending order of the steps, so that its bits do not
// depend on the tile that it falls into. Cost: a step of a strip is 256 multiply-adds for 32 values that are read.
#pragma once

#include <cstddef>

#include "compmark/math/pack.hpp"

namespace compmark {
namespace detail {

/// sum[r][p] += x[r x_row + k x_step] * y[k y_step + p W + lane] for k below `steps`.
template <class T, int W, int Rows, int Packs>
COMPMARK_INLINE void outer_tile(const T* x, std::size_t x_row, std::size_t x_step, const T* y, std::size_t y_step,
                                std::size_t steps, Pack<T, W> (&sum)[Rows][Packs]) {
  COMPMARK_GCC_UNROLL(1)
  for (std::size_t k = 0; k < steps; ++k, x += x_step, y += y_step) {
    Pack<T, W> other[Packs];
    COMPMARK_GCC_UNROLL(8)
    for (int p = 0; p < Packs; ++p) other[p] = Pack<T, W>::load(y + p * W);
    COMPMARK_GCC_UNROLL(8)
    for (int r = 0; r < Rows; ++r) {
      const Pack<T, W> element(x[static_cast<std::size_t>(r) * x_row]);
      COMPMARK_GCC_UNROLL(8)
      for (int p = 0; p < Packs; ++p) sum[r][p] = fma(element, other[p], sum[r][p]);
    }
  }
}

/// Rows of such a tile that fit the registers beside two packs.
template <class T, int W>
inline constexpr int outer_rows = uses_mask_register<T, W> ? 8 : 4;

/// Columns of a strip: values that lie side by side for every step.
inline constexpr std::size_t strip_columns = 16;
/// Strips that hold so many columns.
[[nodiscard]] constexpr std::size_t strips_of(std::size_t columns) {
  return (columns + strip_columns - 1) / strip_columns;
}

/// products[r 16 + c] = sum over k of x[k 16 + r] y[k 16 + c], for two strips [steps, 16].
template <class T, int W = native_width<T>>
void strip_products(const T* x, const T* y, std::size_t steps, T* products) {
  constexpr int rows = outer_rows<T, W>, packs = 2 * W <= static_cast<int>(strip_columns) ? 2 : 1;
  constexpr std::size_t columns = static_cast<std::size_t>(packs * W);
  static_assert(strip_columns % columns == 0, "strip_products: packs of at most 16 lanes");
  for (std::size_t column = 0; column < strip_columns; column += columns) {
    for (std::size_t row = 0; row < strip_columns; row += static_cast<std::size_t>(rows)) {
      Pack<T, W> sum[rows][packs];
      COMPMARK_GCC_UNROLL(8)
      for (int r = 0; r < rows; ++r) {
        for (int p = 0; p < packs; ++p) sum[r][p] = Pack<T, W>(T{});
      }
      outer_tile<T, W, rows, packs>(x + row, 1, strip_columns, y + column, strip_columns, steps, sum);
      COMPMARK_GCC_UNROLL(8)
      for (int r = 0; r < rows; ++r) {
        T* const line = products + (row + static_cast<std::size_t>(r)) * strip_columns + column;
        for (int p = 0; p < packs; ++p) sum[r][p].store(line + p * W);
      }
    }
  }
}

}  // namespace detail
}  // namespace compmark
