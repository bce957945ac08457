// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Inner products of a few hundred long rows: the Gram matrix of statistics and of gradients. Tiles of 4 x 16 sums that
// a compiler keeps in registers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"

namespace compmark {

/// [rows, rows]: inner products of the rows of a [rows, columns] table, in double. Chunks of columns in parallel, added
/// in their order. Cost: rows^2 columns multiply-adds.
template <class T, Executor E>
[[nodiscard]] std::vector<double> row_products(std::span<const T> table, std::size_t rows, std::size_t columns,
                                               E& executor) {
  COMPMARK_ASSERT(table.size() == rows * columns, "row_products: sizes");
  constexpr std::size_t width = 256, at_once = 8, tile_rows = 4, tile_columns = 16;
  const std::size_t padded = (rows + tile_columns - 1) / tile_columns * tile_columns;
  std::vector<double> result(rows * rows, 0.0);
  std::vector<std::vector<double>> parts(at_once), blocks(at_once);
  for (std::size_t first = 0; first < columns; first += width * at_once) {
    const std::size_t count = std::min(columns - first, width * at_once);
    executor.for_chunks(count, width, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::vector<double>&part = parts[begin / width], &block = blocks[begin / width];  // block: [width, padded]
      part.assign(padded * padded, 0.0);
      block.assign(width * padded, 0.0);
      for (std::size_t k = 0; k < rows; ++k) {
        const T* const row = table.data() + k * columns + first;
        for (std::size_t i = begin; i < end; ++i) block[(i - begin) * padded + k] = static_cast<double>(row[i]);
      }
      for (std::size_t k = 0; k < padded; k += tile_rows) {
        for (std::size_t l = 0; l < k + tile_rows; l += tile_columns) {  // up to the diagonal
          double sum[tile_rows][tile_columns] = {};
          for (std::size_t i = 0; i < end - begin; ++i) {
            const double *const x = block.data() + i * padded + k, *const y = block.data() + i * padded + l;
            for (std::size_t r = 0; r < tile_rows; ++r) {
              for (std::size_t c = 0; c < tile_columns; ++c) sum[r][c] += x[r] * y[c];
            }
          }
          for (std::size_t r = 0; r < tile_rows; ++r) {
            for (std::size_t c = 0; c < tile_columns; ++c) part[(k + r) * padded + l + c] = sum[r][c];
          }
        }
      }
    });
    for (std::size_t chunk = 0; chunk * width < count; ++chunk) {
      for (std::size_t k = 0; k < rows; ++k) {
        for (std::size_t l = 0; l <= k; ++l) result[k * rows + l] += parts[chunk][k * padded + l];
      }
    }
  }
  for (std::size_t k = 0; k < rows; ++k) {
    for (std::size_t l = 0; l < k; ++l) result[l * rows + k] = result[k * rows + l];
  }
  return result;
}

}  // namespace compmark
