// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Eigenvalues and eigenvectors of a symmetric pencil, A w = lambda B w with B positive definite, for a few hundred dimensions: Cholesky of B, then
// cyclic Jacobi rotations of L^-1 A L^-T, which are slower than a tridiagonal reduction, a page long, and accurate to rounding for small eigenvalues
// too. And the inner products of many long rows. Plain loops and no library: Eigen's solvers cost every includer their parse and g++ 12 false warnings.
// Cost: some 10 sweeps of 6 n^3 flops; n = 192 takes half a second.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"

namespace compmark::inline v0 {

struct EigenPairs {
  std::vector<double> values;   ///< [n], the largest first
  std::vector<double> vectors;  ///< [n, n], row k is that of values[k]; w^T B w = 1
};

/// `a` and `b` are [n, n], symmetric. Nothing where `b` is not positive definite to rounding, or a number is not finite.
[[nodiscard]] inline std::optional<EigenPairs> symmetric_eigen_pairs(std::span<const double> a,
                                                                     std::span<const double> b, std::size_t n) {
  COMPMARK_ASSERT(a.size() == n * n && b.size() == n * n, "symmetric_eigen_pairs: sizes");
  std::vector<double> lower(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = b[i * n + j];
      for (std::size_t k = 0; k < j; ++k) sum -= lower[i * n + k] * lower[j * n + k];
      if (i == j && !(sum > 1e-14 * std::abs(b[i * n + i]))) return std::nullopt;
      lower[i * n + j] = i == j ? std::sqrt(sum) : sum / lower[j * n + j];
    }
  }
  // m = L^-1 A L^-T: solve for the columns, then for the rows of what came out.
  std::vector<double> m(a.begin(), a.end());
  for (int side = 0; side < 2; ++side) {
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        const double factor = lower[i * n + k];
        for (std::size_t c = 0; c < n; ++c) m[i * n + c] -= factor * m[k * n + c];
      }
      for (std::size_t c = 0; c < n; ++c) m[i * n + c] /= lower[i * n + i];
    }
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < i; ++j) std::swap(m[i * n + j], m[j * n + i]);
    }
  }
  double size = 0;
  for (const double x : m) size += x * x;
  if (!std::isfinite(size)) return std::nullopt;

  std::vector<double> v(n * n, 0.0);  // rows are vectors
  for (std::size_t i = 0; i < n; ++i) v[i * n + i] = 1;
  for (int sweep = 0; sweep < 60; ++sweep) {
    double off = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < i; ++j) off += m[i * n + j] * m[i * n + j];
    }
    if (off <= 1e-26 * size) break;
    for (std::size_t p = 0; p + 1 < n; ++p) {
      for (std::size_t q = p + 1; q < n; ++q) {
        const double apq = m[p * n + q];
        if (apq == 0) continue;
        const double theta = (m[q * n + q] - m[p * n + p]) / (2 * apq);
        const double t = (theta < 0 ? -1 : 1) / (std::abs(theta) + std::hypot(theta, 1.0));
        const double c = 1 / std::hypot(t, 1.0), s = t * c;
        double *const rp = m.data() + p * n, *const rq = m.data() + q * n;
        for (std::size_t k = 0; k < n; ++k) {  // rows
          const double x = rp[k], y = rq[k];
          rp[k] = c * x - s * y;
          rq[k] = s * x + c * y;
        }
        for (std::size_t k = 0; k < n; ++k) {  // columns
          double* const row = m.data() + k * n;
          const double x = row[p], y = row[q];
          row[p] = c * x - s * y;
          row[q] = s * x + c * y;
        }
        rp[q] = rq[p] = 0;
        double *const vp = v.data() + p * n, *const vq = v.data() + q * n;
        for (std::size_t k = 0; k < n; ++k) {
          const double x = vp[k], y = vq[k];
          vp[k] = c * x - s * y;
          vq[k] = s * x + c * y;
        }
      }
    }
  }
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t i, std::size_t j) { return m[i * n + i] > m[j * n + j]; });
  EigenPairs pairs;
  pairs.vectors.resize(n * n);
  for (std::size_t r = 0; r < n; ++r) {
    pairs.values.push_back(m[order[r] * n + order[r]]);
    double* const w = pairs.vectors.data() + r * n;  // L^T w = v
    std::copy_n(v.data() + order[r] * n, n, w);
    for (std::size_t i = n; i-- > 0;) {
      w[i] /= lower[i * n + i];
      for (std::size_t k = 0; k < i; ++k) w[k] -= lower[i * n + k] * w[i];
    }
  }
  return pairs;
}

/// [rows, rows]: inner products of the rows of a [rows, columns] table, in double. Chunks of columns in parallel, added in their order. Cost: rows^2
/// columns multiply-adds.
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

}  // namespace compmark::inline v0
