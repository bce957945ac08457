// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Kernel ridge regression: smooth functions of a few thousand points, f(x) = sum_i c_i exp(-|x - x_i|^2 / 2) with (K + ridge I) c = targets, and how
// far the values of each group of points would be missed without them, which needs no second fit: e_G = (((K + ridge I)^-1)_GG)^-1 c_G. A Cholesky factor in blocks of
// columns and triangular solves of 16 right-hand sides, in plain loops that a compiler turns into vectors. The same bits at any thread count.
// Cost: n^2 (n / 3 + dimensions / 2 + 2 targets) multiply-adds and 8 n^2 bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"

namespace compmark::inline v0 {

struct KernelRidge {
  std::vector<double> coefficient;     ///< [points, targets]
  std::vector<double> left_out_error;  ///< [points, targets]: target less what the fit to all other groups says there
};

namespace detail {

/// The lower factor of a symmetric matrix [n, n] in its place; what is above the diagonal is not looked at. False if it is not positive definite.
template <Executor E>
[[nodiscard]] bool cholesky_in_place(std::vector<double>& matrix, std::size_t n, E& executor) {
  constexpr std::size_t block = 64, tile_rows = 4, tile_columns = 16, grain = 32;
  std::vector<double> panel;  // columns [begin, end) of the rows below, a row a column, in whole tiles
  for (std::size_t begin = 0; begin < n; begin += block) {
    const std::size_t end = std::min(n, begin + block), width = end - begin;
    for (std::size_t i = begin; i < end; ++i) {
      double* const row = matrix.data() + i * n;
      for (std::size_t j = begin; j <= i; ++j) {
        const double* const other = matrix.data() + j * n;
        double sum = row[j];
        for (std::size_t k = begin; k < j; ++k) sum -= row[k] * other[k];
        if (j < i) {
          row[j] = sum / other[j];
        } else if (sum > 0) {
          row[i] = std::sqrt(sum);
        } else {
          return false;
        }
      }
    }
    const std::size_t below = n - end;
    if (below == 0) break;
    const std::size_t padded = (below + tile_columns - 1) / tile_columns * tile_columns;
    panel.assign(width * padded, 0.0);
    executor.for_chunks(below, grain, [&](std::size_t first, std::size_t last, std::size_t) {
      for (std::size_t i = first; i < last; ++i) {
        double* const row = matrix.data() + (end + i) * n;
        for (std::size_t j = begin; j < end; ++j) {
          const double* const other = matrix.data() + j * n;
          double sum = row[j];
          for (std::size_t k = begin; k < j; ++k) sum -= row[k] * other[k];
          row[j] = sum / other[j];
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

/// 16 right-hand sides of a triangular system at a time, [n, 16].
inline constexpr std::size_t solved_at_once = 16;
/// L y = b in the place of b, whose first `first` rows are zero.
inline void solve_lower(const std::vector<double>& lower, std::size_t n, std::size_t first, double* b) {
  for (std::size_t i = first; i < n; ++i) {
    const double* const row = lower.data() + i * n;
    double sum[solved_at_once];
    std::copy_n(b + i * solved_at_once, solved_at_once, sum);
    for (std::size_t k = first; k < i; ++k) {
      for (std::size_t c = 0; c < solved_at_once; ++c) sum[c] -= row[k] * b[k * solved_at_once + c];
    }
    for (std::size_t c = 0; c < solved_at_once; ++c) b[i * solved_at_once + c] = sum[c] / row[i];
  }
}
/// L^T x = y in the place of y.
inline void solve_upper(const std::vector<double>& lower, std::size_t n, double* y) {
  for (std::size_t i = n; i-- > 0;) {
    const double* const row = lower.data() + i * n;
    double* const x = y + i * solved_at_once;
    for (std::size_t c = 0; c < solved_at_once; ++c) x[c] /= row[i];
    for (std::size_t k = 0; k < i; ++k) {
      for (std::size_t c = 0; c < solved_at_once; ++c) y[k * solved_at_once + c] -= row[k] * x[c];
    }
  }
}

}  // namespace detail

/// `points` is [n, dimensions], scaled so that the kernel's width is 1; `targets` is [n, k], of mean zero where nothing is known. `ridge` above 0: what
/// of a target's variance, relative to the kernel's 1, no neighbour can know. `group` consecutive points, at most 16, are left out together: readings that
/// know of each other say nothing of how well a new one is told. Nothing if a number is not finite.
template <Executor E>
[[nodiscard]] std::optional<KernelRidge> kernel_ridge(std::span<const double> points, std::span<const double> targets,
                                                      std::size_t n, double ridge, E& executor, std::size_t group = 1) {
  COMPMARK_ASSERT(n > 0 && points.size() % n == 0 && targets.size() % n == 0 && ridge > 0 && group > 0 &&
                      group <= detail::solved_at_once && n % group == 0,
                  "kernel_ridge: sizes");
  const std::size_t dimensions = points.size() / n, count = targets.size() / n;
  for (const std::span<const double> values : {points, targets}) {
    for (const double x : values) {
      if (!std::isfinite(x)) return std::nullopt;
    }
  }
  std::vector<double> lower(n * n);
  executor.for_chunks(n, 16, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t i = first; i < last; ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        double square = 0;
        for (std::size_t d = 0; d < dimensions; ++d) {
          const double difference = points[i * dimensions + d] - points[j * dimensions + d];
          square += difference * difference;
        }
        lower[i * n + j] = std::exp(-square / 2);
      }
      lower[i * n + i] = 1 + ridge;
    }
  });
  if (!detail::cholesky_in_place(lower, n, executor)) return std::nullopt;

  constexpr std::size_t wide = detail::solved_at_once;
  const std::size_t whole = wide / group * group;  // groups are not cut
  std::vector<double> inverse(n * group, 0.0);  // of K + ridge I, its blocks on the diagonal, then their lower factors
  executor.for_chunks(n, whole, [&](std::size_t first, std::size_t last, std::size_t) {
    std::vector<double> unit(n * wide, 0.0);
    for (std::size_t i = first; i < last; ++i) unit[i * wide + i - first] = 1;
    detail::solve_lower(lower, n, first, unit.data());
    for (std::size_t k = first; k < n; ++k) {
      const double* const row = unit.data() + k * wide;
      for (std::size_t i = first; i < last; ++i) {
        const std::size_t start = i - i % group;
        for (std::size_t j = start; j <= i; ++j) inverse[i * group + j - start] += row[i - first] * row[j - first];
      }
    }
    for (std::size_t i = first; i < last; ++i) {
      const std::size_t start = i - i % group;
      for (std::size_t j = start; j <= i; ++j) {
        double sum = inverse[i * group + j - start];
        for (std::size_t k = start; k < j; ++k) sum -= inverse[i * group + k - start] * inverse[j * group + k - start];
        inverse[i * group + j - start] = j < i ? sum / inverse[j * group + j - start] : std::sqrt(sum);
      }
    }
  });
  KernelRidge fit;
  fit.coefficient.resize(n * count);
  fit.left_out_error.resize(n * count);
  executor.for_chunks(count, wide, [&](std::size_t first, std::size_t last, std::size_t) {
    std::vector<double> x(n * wide, 0.0);
    for (std::size_t i = 0; i < n; ++i)
      std::copy_n(targets.data() + i * count + first, last - first, x.data() + i * wide);
    detail::solve_lower(lower, n, 0, x.data());
    detail::solve_upper(lower, n, x.data());
    std::array<double, wide> error{};
    for (std::size_t c = 0; c < last - first; ++c) {
      for (std::size_t start = 0; start < n; start += group) {
        for (std::size_t i = 0; i < group; ++i) {
          const double* const row = inverse.data() + (start + i) * group;
          error[i] = x[(start + i) * wide + c];
          for (std::size_t k = 0; k < i; ++k) error[i] -= row[k] * error[k];
          error[i] /= row[i];
        }
        for (std::size_t i = group; i-- > 0;) {
          const double* const row = inverse.data() + (start + i) * group;
          error[i] /= row[i];
          for (std::size_t k = 0; k < i; ++k) error[k] -= row[k] * error[i];
        }
        for (std::size_t i = 0; i < group; ++i) {
          fit.coefficient[(start + i) * count + first + c] = x[(start + i) * wide + c];
          fit.left_out_error[(start + i) * count + first + c] = error[i];
        }
      }
    }
  });
  return fit;
}

}  // namespace compmark::inline v0
