// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Kernel ridge regression: smooth functions of a few thousand points, f(x) = sum_i c_i exp(-|x - x_i|^2 / 2) with (K +
// ridge I) c = targets, and how far the values of each group of points would be missed without them, which needs no
// second fit: e_G = (((K + ridge I)^-1)_GG)^-1 c_G. The same bits at any thread count.
// Cost: n^2 (n / 3 + dimensions / 2 + 2 targets) multiply-adds and 8 n^2 bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/cholesky.hpp"

namespace compmark {

struct KernelRidge {
  std::vector<double> coefficient;     ///< [points, targets]
  std::vector<double> left_out_error;  ///< [points, targets]: target less what the fit to all other groups says there
};

/// So many right-hand sides are solved for together, and so many points at most are left out together.
inline constexpr std::size_t kernel_ridge_columns = 16;

/// `points` is [n, dimensions], scaled so that the kernel's width is 1; `targets` is [n, k], of mean zero where nothing
/// is known. `ridge` above 0: what of a target's variance, relative to the kernel's 1, no neighbour can know. `group`
/// consecutive points, at most 16, are left out together: readings that know of each other say nothing of how well a
/// new one is told. Nothing if a number is not finite.
template <Executor E>
[[nodiscard]] std::optional<KernelRidge> kernel_ridge(std::span<const double> points, std::span<const double> targets,
                                                      std::size_t n, double ridge, E& executor, std::size_t group = 1) {
  COMPMARK_ASSERT(n > 0 && points.size() % n == 0 && targets.size() % n == 0 && ridge > 0 && group > 0 &&
                      group <= kernel_ridge_columns && n % group == 0,
                  "kernel_ridge: sizes");
  const std::size_t dimensions = points.size() / n, count = targets.size() / n;
  for (const std::span<const double> values : {points, targets}) {
    for (const double x : values) {
      if (!std::isfinite(x)) return std::nullopt;
    }
  }
  std::vector<double> lower(n * n);
  constexpr std::size_t lanes = 64;            // distances that are summed side by side
  std::vector<double> across(n * dimensions);  // [dimensions, n]
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t d = 0; d < dimensions; ++d) across[d * n + i] = points[i * dimensions + d];
  }
  executor.for_chunks(n, 16, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t begin = 0; begin < last; begin += lanes) {
      for (std::size_t i = std::max(first, begin); i < last; ++i) {
        const std::size_t together = std::min(lanes, i - begin);
        double square[lanes] = {};
        for (std::size_t d = 0; d < dimensions; ++d) {
          const double own = points[i * dimensions + d];
          const double* const others = across.data() + d * n + begin;
          for (std::size_t j = 0; j < together; ++j) square[j] += (own - others[j]) * (own - others[j]);
        }
        for (std::size_t j = 0; j < together; ++j) lower[i * n + begin + j] = std::exp(-square[j] / 2);
      }
    }
    for (std::size_t i = first; i < last; ++i) lower[i * n + i] = 1 + ridge;
  });
  if (!cholesky_in_place(std::span<double>(lower), n, executor)) return std::nullopt;

  constexpr std::size_t wide = kernel_ridge_columns;
  const std::size_t whole = wide / group * group, square = group * group;  // groups are not cut
  std::vector<double> inverse(n * group, 0.0);  // of K + ridge I, its blocks on the diagonal, then their lower factors
  std::vector<std::uint8_t> definite(n / group, 0);
  executor.for_chunks(n, whole, [&](std::size_t first, std::size_t last, std::size_t) {
    std::vector<double> unit(n * wide, 0.0);
    for (std::size_t i = first; i < last; ++i) unit[i * wide + i - first] = 1;
    solve_lower<wide>(lower, n, first, unit.data());
    for (std::size_t k = first; k < n; ++k) {
      const double* const row = unit.data() + k * wide;
      for (std::size_t i = first; i < last; ++i) {
        const std::size_t start = i - i % group;
        for (std::size_t j = start; j <= i; ++j) inverse[i * group + j - start] += row[i - first] * row[j - first];
      }
    }
    SerialExecutor alone;
    for (std::size_t g = first / group; g < last / group; ++g)
      definite[g] = cholesky_in_place(std::span(inverse).subspan(g * square, square), group, alone) ? 1 : 0;
  });
  if (std::find(definite.begin(), definite.end(), 0) != definite.end()) return std::nullopt;
  KernelRidge fit;
  fit.coefficient.resize(n * count);
  fit.left_out_error.resize(n * count);
  executor.for_chunks(count, wide, [&](std::size_t first, std::size_t last, std::size_t) {
    std::vector<double> x(n * wide, 0.0);
    for (std::size_t i = 0; i < n; ++i)
      std::copy_n(targets.data() + i * count + first, last - first, x.data() + i * wide);
    solve_lower<wide>(lower, n, 0, x.data());
    solve_lower_transposed<wide>(lower, n, x.data());
    std::array<double, wide> error{};
    for (std::size_t c = 0; c < last - first; ++c) {
      for (std::size_t start = 0; start < n; start += group) {
        const std::span<const double> block = std::span<const double>(inverse).subspan(start * group, square);
        for (std::size_t i = 0; i < group; ++i) error[i] = x[(start + i) * wide + c];
        solve_lower<1>(block, group, 0, error.data());
        solve_lower_transposed<1>(block, group, error.data());
        for (std::size_t i = 0; i < group; ++i) {
          fit.coefficient[(start + i) * count + first + c] = x[(start + i) * wide + c];
          fit.left_out_error[(start + i) * count + first + c] = error[i];
        }
      }
    }
  });
  return fit;
}

}  // namespace compmark
