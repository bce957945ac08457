// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Eigenvalues and eigenvectors of symmetric matrices of a few hundred rows by cyclic Jacobi rotations, and of a pencil A w = lambda B w with B
// positive definite (Cholesky of B, then L^-1 A L^-T). Jacobi is slower than a tridiagonal reduction, a page long, and accurate to rounding for small
// eigenvalues too. No library: with Eigen's solvers the umbrella header takes a tenth longer to parse (measured), and g++ 12 warns falsely about them.
// Cost: 6 n^3 flops a sweep and 7 to 12 sweeps: 0.3 s for n = 320, but 10 s for n = 512, whose columns share their cache sets.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark::inline v0 {

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
        double* const row_p = matrix.data() + p * n;
        double* const row_q = matrix.data() + q * n;
        for (std::size_t k = 0; k < n; ++k) {
          const double a = row_p[k], b = row_q[k];
          row_p[k] = c * a - s * b;
          row_q[k] = s * a + c * b;
        }
        for (std::size_t k = 0; k < n; ++k) {
          double* const row = matrix.data() + k * n;
          const double a = row[p], b = row[q];
          row[p] = c * a - s * b;
          row[q] = s * a + c * b;
        }
        double* const vector_p = rows.data() + p * n;
        double* const vector_q = rows.data() + q * n;
        for (std::size_t k = 0; k < n; ++k) {
          const double a = vector_p[k], b = vector_q[k];
          vector_p[k] = c * a - s * b;
          vector_q[k] = s * a + c * b;
        }
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
  for (const double x : m) {
    if (!std::isfinite(x)) return std::nullopt;
  }
  EigenPairs pairs;
  symmetric_eigen(m, n, pairs.values, pairs.vectors);
  for (std::size_t r = 0; r < n; ++r) {
    double* const w = pairs.vectors.data() + r * n;  // L^T w = v
    for (std::size_t i = n; i-- > 0;) {
      w[i] /= lower[i * n + i];
      for (std::size_t k = 0; k < i; ++k) w[k] -= lower[i * n + k] * w[i];
    }
  }
  return pairs;
}

}  // namespace compmark::inline v0
