// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/cholesky.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

using namespace compmark;

namespace {

/// G G^T + I of random normals: eigenvalues from 1 to about 4 n.
std::vector<double> random_positive(std::size_t n) {
  const Random random(n, 0, random_stage("test/cholesky"));
  std::vector<double> matrix(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t k = 0; k < n; ++k) matrix[i * n + j] += random.normal(i * n + k) * random.normal(j * n + k);
    }
    matrix[i * n + i] += 1;
  }
  return matrix;
}

/// Of A x = b with L L^T = A, for random b.
template <std::size_t Columns>
double largest_residual(const std::vector<double>& matrix, const std::vector<double>& lower, std::size_t n) {
  std::vector<double> x(n * Columns);
  const Random random(n, 1, random_stage("test/cholesky"));
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = random.normal(i);
  const std::vector<double> b = x;
  solve_lower<Columns>(lower, n, 0, x.data());
  solve_lower_transposed<Columns>(lower, n, x.data());
  double residual = 0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t c = 0; c < Columns; ++c) {
      double sum = -b[i * Columns + c];
      for (std::size_t j = 0; j < n; ++j) sum += matrix[i * n + j] * x[j * Columns + c];
      if (!(std::abs(sum) <= residual) && !std::isnan(residual)) residual = std::abs(sum);  // a NaN stays
    }
  }
  return residual;
}

/// Whether the solve with rows before `first` that are zero is that of the whole, and looks at nothing of them.
template <std::size_t Columns>
bool leaves_out_zeros(std::vector<double> lower, std::size_t n, std::size_t first) {
  std::vector<double> whole(n * Columns, 0.0);
  for (std::size_t i = first * Columns; i < whole.size(); ++i) whole[i] = static_cast<double>(i % 17) - 8;
  std::vector<double> part = whole;
  solve_lower<Columns>(lower, n, 0, whole.data());
  for (std::size_t i = first; i < n; ++i) {
    for (std::size_t k = 0; k < first; ++k) lower[i * n + k] = std::numeric_limits<double>::quiet_NaN();
  }
  solve_lower<Columns>(lower, n, first, part.data());
  double worst = 0;  // tiles begin elsewhere, so that the last bits may differ
  for (std::size_t i = 0; i < part.size(); ++i) {
    if (!(std::abs(part[i] - whole[i]) <= worst) && !std::isnan(worst)) worst = std::abs(part[i] - whole[i]);
  }
  return worst < 1e-12;
}

}  // namespace

TEST_CASE("math/cholesky: the factor of Pascal's matrix is Pascal's triangle, exactly") {
  constexpr std::size_t n = 12;
  std::vector<double> symmetric(n * n, 1.0), triangle(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      if (i > 0 && j > 0) symmetric[i * n + j] = symmetric[(i - 1) * n + j] + symmetric[i * n + j - 1];
      if (j <= i) triangle[i * n + j] = j == 0 ? 1 : triangle[(i - 1) * n + j - 1] + triangle[(i - 1) * n + j];
    }
  }
  SerialExecutor executor;
  REQUIRE(cholesky_in_place(std::span<double>(symmetric), n, executor));
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j) CHECK(symmetric[i * n + j] == triangle[i * n + j]);
  }
}

TEST_CASE("math/cholesky: L L^T is the matrix, the solves solve, and no thread count changes a bit") {
  for (const std::size_t n : {1u, 2u, 17u, 63u, 64u, 65u, 129u, 250u}) {  // either side of the blocks of 64 columns
    CAPTURE(n);
    const std::vector<double> matrix = random_positive(n);
    std::vector<double> lower = matrix;
    for (std::size_t i = 0; i < n; ++i) {  // nobody looks above the diagonal
      for (std::size_t j = i + 1; j < n; ++j) lower[i * n + j] = std::numeric_limits<double>::quiet_NaN();
    }
    std::vector<double> threaded = lower;
    SerialExecutor serial;
    ThreadExecutor threads(3);
    REQUIRE(cholesky_in_place(std::span<double>(lower), n, serial));
    REQUIRE(cholesky_in_place(std::span<double>(threaded), n, threads));
    double product_error = 0;
    bool same = true;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j <= i; ++j) {
        double sum = 0;
        for (std::size_t k = 0; k <= j; ++k) sum += lower[i * n + k] * lower[j * n + k];
        product_error = std::fmax(product_error, std::abs(sum - matrix[i * n + j]));
        same = same && lower[i * n + j] == threaded[i * n + j];
      }
    }
    CHECK(same);
    // Backward error of Cholesky: (n + 1) half ulps of the largest number on the diagonal (Higham, theorem 10.3).
    double largest = 0;
    for (std::size_t i = 0; i < n; ++i) largest = std::fmax(largest, matrix[i * n + i]);
    CHECK(product_error <= (static_cast<double>(n) + 1) * 1.2e-16 * largest);

    // Right-hand sides that fill no register, one, two, and several tiles, whatever the registers of this build are.
    CHECK(largest_residual<1>(matrix, lower, n) < 2e-12);  // measured 1.8e-13 at 250 rows and three of them
    CHECK(largest_residual<3>(matrix, lower, n) < 2e-12);
    CHECK(largest_residual<4>(matrix, lower, n) < 2e-12);
    CHECK(largest_residual<8>(matrix, lower, n) < 2e-12);
    CHECK(largest_residual<16>(matrix, lower, n) < 2e-12);
    CHECK(largest_residual<24>(matrix, lower, n) < 2e-12);
  }
}

TEST_CASE("math/cholesky: rows before the first that is not zero are not worked on") {
  for (const std::size_t n : {20u, 45u}) {
    std::vector<double> lower = random_positive(n);
    SerialExecutor executor;
    REQUIRE(cholesky_in_place(std::span<double>(lower), n, executor));
    for (const std::size_t first : {1u, 7u, 16u, 19u}) {
      CAPTURE(first);
      CHECK(leaves_out_zeros<1>(lower, n, first));
      CHECK(leaves_out_zeros<8>(lower, n, first));
      CHECK(leaves_out_zeros<16>(lower, n, first));
    }
  }
}

TEST_CASE("math/cholesky: what is not positive definite to rounding, or not finite, is refused") {
  const auto factors = [](std::vector<double> matrix, std::size_t n) {
    SerialExecutor executor;
    return cholesky_in_place(std::span<double>(matrix), n, executor);
  };
  CHECK(factors({4, 0, 2, 3}, 2));
  CHECK_FALSE(factors({4, 0, 2, -3}, 2));
  CHECK_FALSE(factors({0}, 1));
  CHECK_FALSE(factors({4, 0, 2, std::numeric_limits<double>::quiet_NaN()}, 2));
  CHECK_FALSE(factors({std::numeric_limits<double>::infinity()}, 1));
  // One direction twice: the second pivot is what rounding left of 0.1 + 0.2 - 0.3, a test against zero alone would
  // take it.
  const double third = 0.1 + 0.2, row = 0.3;
  CHECK(third - row * row / row > 0);
  CHECK_FALSE(factors({row, 0, row, third}, 2));
  // Beyond the first block of columns as well.
  std::vector<double> late = random_positive(90);
  CHECK(factors(late, 90));
  late[89 * 90 + 89] = 0;
  CHECK_FALSE(factors(late, 90));
}
