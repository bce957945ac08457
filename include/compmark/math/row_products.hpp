// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Inner products of a few hundred long rows: the Gram matrix of statistics and of gradients, in tiles that stay in
// registers (outer_tile.hpp).
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/outer_tile.hpp"

namespace compmark {

/// [rows, rows]: inner products of the rows of a [rows, columns] table, in double. Chunks of columns in parallel, added
/// in their order. Cost: rows^2 columns multiply-adds.
template <class T, Executor E>
[[nodiscard]] std::vector<double> row_products(std::span<const T> table, std::size_t rows, std::size_t columns,
                                               E& executor) {
  COMPMARK_ASSERT(table.size() == rows * columns, "row_products: sizes");
  constexpr std::size_t width = 256, at_once = 8, strip = detail::strip_columns, tile = strip * strip;
  const std::size_t strips = detail::strips_of(rows);
  std::vector<double> result(rows * rows, 0.0);
  std::vector<std::vector<double>> parts(at_once), blocks(at_once);
  for (std::size_t first = 0; first < columns; first += width * at_once) {
    const std::size_t count = std::min(columns - first, width * at_once);
    executor.for_chunks(count, width, [&](std::size_t begin, std::size_t end, std::size_t) {
      // part: tiles of products, those of row and column strips up to the diagonal; block: strips [width, 16].
      std::vector<double>&part = parts[begin / width], &block = blocks[begin / width];
      const std::size_t steps = end - begin;
      part.resize(strips * (strips + 1) / 2 * tile);
      block.assign(strips * width * strip, 0.0);
      for (std::size_t k = 0; k < rows; ++k) {
        const T* const row = table.data() + k * columns + first + begin;
        double* const line = block.data() + k / strip * width * strip + k % strip;
        for (std::size_t i = 0; i < steps; ++i) line[i * strip] = static_cast<double>(row[i]);
      }
      double* products = part.data();
      for (std::size_t k = 0; k < strips; ++k) {
        for (std::size_t l = 0; l <= k; ++l, products += tile)
          detail::strip_products(&block[k * width * strip], &block[l * width * strip], steps, products);
      }
    });
    for (std::size_t chunk = 0; chunk * width < count; ++chunk) {
      for (std::size_t k = 0; k < rows; ++k) {
        const std::size_t s = k / strip;
        const double* const products = parts[chunk].data() + s * (s + 1) / 2 * tile + k % strip * strip;
        for (std::size_t l = 0; l <= k; ++l) result[k * rows + l] += products[l / strip * tile + l % strip];
      }
    }
  }
  for (std::size_t k = 0; k < rows; ++k) {
    for (std::size_t l = 0; l < k; ++l) result[l * rows + k] = result[k * rows + l];
  }
  return result;
}

}  // namespace compmark
