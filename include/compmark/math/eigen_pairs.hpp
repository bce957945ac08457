// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Eigenvalues and eigenvectors of symmetric matrices of a few hundred rows by cyclic Jacobi rotations, and of a pencil
// A w = lambda B w with B positive definite (Cholesky of B, then L^-1 A L^-T). Jacobi is slower than a tridiagonal
// reduction, a page long, and accurate to rounding for small eigenvalues too. No library: with Eigen's solvers the
// umbrella header takes a tenth longer to parse (measured), and g++ 12 warns falsely about them. Cost: 6 n^3 flops a
// sweep and 7 to 12 sweeps: 0.3 s for n = 320, but 10 s for n = 512, whose columns share their cache sets.
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
#include "compmark/math/cholesky.hpp"

namespace compmark {

/// Eigenvalues (descending) and eigenvectors (rows of `vectors`) of a symmetric matrix [n, n], which is destroyed.
inline void symmetric_eigen(std::vector<double>& matrix, std::size_t n, std::vector<double>& values,
                            std::vector<double>& vectors) {
  std::vector<double> rows(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) rows[i * n + i] = 1;
  for (int sweep = 0; sweep < 40; ++sweep) {
    double off = 0, all = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) (i == j ? all : off) += matrix[i * n + j] * matrix[i * n + j];
    }
    if (!(off > 1e-30 * (all + off))) break;
    for (std::size_t p = 0; p + 1 < n; ++p) {
      for (std::size_t q = p + 1; q < n; ++q) {
        const double apq = matrix[p * n + q];
        if (apq == 0 || std::abs(apq) < 1e-18 * std::sqrt(std::abs(matrix[p * n + p] * matrix[q * n + q]))) continue;
        const double theta = (matrix[q * n + q] - matrix[p * n + p]) / (2 * apq);
        const double t = (theta >= 0 ? 1.0 : -1.0) / (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        const auto rotate_rows = [&](std::vector<double>& m) {
          double *const row_p = m.data() + p * n, *const row_q = m.data() + q * n;
          for (std::size_t k = 0; k < n; ++k) {
            const double x = row_p[k], y = row_q[k];
            row_p[k] = c * x - s * y;
            row_q[k] = s * x + c * y;
          }
        };
        rotate_rows(matrix);
        for (std::size_t k = 0; k < n; ++k) {
          double* const row = matrix.data() + k * n;
          const double x = row[p], y = row[q];
          row[p] = c * x - s * y;
          row[q] = s * x + c * y;
        }
        rotate_rows(rows);
      }
    }
  }
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return matrix[a * n + a] > matrix[b * n + b]; });
  values.resize(n);
  vectors.resize(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    values[i] = matrix[order[i] * n + order[i]];
    std::copy_n(rows.data() + order[i] * n, n, vectors.data() + i * n);
  }
}

struct EigenPairs {
  std::vector<double> values;   ///< [n], the largest first
  std::vector<double> vectors;  ///< [n, n], row k is that of values[k]; w^T B w = 1
};

/// `a` and `b` are [n, n], symmetric. Nothing where `b` is not positive definite to rounding, or a number is not
/// finite.
[[nodiscard]] inline std::optional<EigenPairs> symmetric_eigen_pairs(std::span<const double> a,
                                                                     std::span<const double> b, std::size_t n) {
  COMPMARK_ASSERT(a.size() == n * n && b.size() == n * n, "symmetric_eigen_pairs: sizes");
  std::vector<double> lower(b.begin(), b.end());
  SerialExecutor executor;
  if (!cholesky_in_place(std::span<double>(lower), n, executor)) return std::nullopt;
  // m = L^-1 A L^-T: a row of the symmetric A is a column, so solving for the rows gives A L^-T, and for the rows of
  // its transpose the whole.
  std::vector<double> m(a.begin(), a.end());
  for (int side = 0; side < 2; ++side) {
    for (std::size_t i = 0; i < n; ++i) solve_lower<1>(lower, n, 0, m.data() + i * n);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < i; ++j) std::swap(m[i * n + j], m[j * n + i]);
    }
  }
  for (const double x : m) {
    if (!std::isfinite(x)) return std::nullopt;
  }
  EigenPairs pairs;
  symmetric_eigen(m, n, pairs.values, pairs.vectors);
  for (std::size_t r = 0; r < n; ++r)  // L^T w = v
    solve_lower_transposed<1>(lower, n, pairs.vectors.data() + r * n);
  return pairs;
}

}  // namespace compmark
