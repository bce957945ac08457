// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Small dense symmetric problems in double: a Cholesky solve (normal equations of the SH fit) and the eigenvector of
// the largest eigenvalue by Jacobi rotations (mean of quaternions). Sizes of 4 to 16; nothing is allocated.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

#include "compmark/core/config.hpp"

namespace compmark {

/// Place of (i, j), j <= i, in a packed lower triangle.
[[nodiscard]] constexpr std::size_t packed_index(std::size_t i, std::size_t j) { return i * (i + 1) / 2 + j; }

/// Solves A X = B in place of B for `count` right-hand sides. `lower` is the packed lower triangle of a symmetric
/// positive definite A [n, n] and becomes its Cholesky factor; B is [n, count] row-major. False, with B untouched,
/// where A is not positive definite to rounding (or not finite). Cost: n^3 / 3 + 2 n^2 count flops.
[[nodiscard]] inline bool solve_positive(std::span<double> lower, std::size_t n, std::span<double> right,
                                         std::size_t count) {
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      double sum = lower[packed_index(i, j)];
      for (std::size_t k = 0; k < j; ++k) sum -= lower[packed_index(i, k)] * lower[packed_index(j, k)];
      if (i == j) {
        if (!(sum > 1e-14 * std::abs(lower[packed_index(i, i)]))) return false;
        lower[packed_index(i, i)] = std::sqrt(sum);
      } else {
        lower[packed_index(i, j)] = sum / lower[packed_index(j, j)];
      }
    }
  }
  for (std::size_t c = 0; c < count; ++c) {
    for (std::size_t i = 0; i < n; ++i) {
      double sum = right[i * count + c];
      for (std::size_t k = 0; k < i; ++k) sum -= lower[packed_index(i, k)] * right[k * count + c];
      right[i * count + c] = sum / lower[packed_index(i, i)];
    }
    for (std::size_t i = n; i-- > 0;) {
      double sum = right[i * count + c];
      for (std::size_t k = i + 1; k < n; ++k) sum -= lower[packed_index(k, i)] * right[k * count + c];
      right[i * count + c] = sum / lower[packed_index(i, i)];
    }
  }
  return true;
}

/// Unit eigenvector of the largest eigenvalue of a symmetric matrix, given as its packed lower triangle. Sign: the
/// component of largest magnitude is positive. Cyclic Jacobi, a fixed number of sweeps, so the result is a pure
/// function of the bits of the input.
template <std::size_t N>
[[nodiscard]] std::array<double, N> largest_eigenvector(std::span<const double> lower) {
  std::array<std::array<double, N>, N> a{}, vectors{};
  for (std::size_t i = 0; i < N; ++i) {
    for (std::size_t j = 0; j <= i; ++j) a[i][j] = a[j][i] = lower[packed_index(i, j)];
    vectors[i][i] = 1;
  }
  for (int sweep = 0; sweep < 12; ++sweep) {
    for (std::size_t p = 0; p < N; ++p) {
      for (std::size_t q = p + 1; q < N; ++q) {
        if (a[p][q] == 0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = (theta >= 0 ? 1 : -1) / (std::abs(theta) + std::hypot(theta, 1.0));
        const double c = 1 / std::hypot(t, 1.0), s = t * c;
        for (std::size_t k = 0; k < N; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq;
          a[k][q] = s * kp + c * kq;
        }
        for (std::size_t k = 0; k < N; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk;
          a[q][k] = s * pk + c * qk;
          const double vp = vectors[k][p], vq = vectors[k][q];
          vectors[k][p] = c * vp - s * vq;
          vectors[k][q] = s * vp + c * vq;
        }
      }
    }
  }
  std::size_t best = 0;
  for (std::size_t i = 1; i < N; ++i) best = a[i][i] > a[best][best] ? i : best;
  std::array<double, N> result{};
  std::size_t largest = 0;
  for (std::size_t i = 0; i < N; ++i) {
    result[i] = vectors[i][best];
    if (std::abs(result[i]) > std::abs(result[largest])) largest = i;
  }
  if (result[largest] < 0) {
    for (double& value : result) value = -value;
  }
  return result;
}

}  // namespace compmark
