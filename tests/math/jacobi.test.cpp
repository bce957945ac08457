// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/jacobi.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/math/eigen_pairs.hpp"

using namespace compmark;

TEST_CASE("math/jacobi: rotations and the tridiagonal solver give the same pairs") {
  for (const std::size_t n : {1u, 2u, 9u, 64u}) {
    const Random random(n, 0, random_stage("test/jacobi"));
    std::vector<double> matrix(n * n);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j <= i; ++j) matrix[i * n + j] = matrix[j * n + i] = random.normal(i * n + j);
    }
    const std::optional<EigenPairs> pairs = symmetric_eigen_pairs(matrix, n);
    REQUIRE(pairs);
    std::vector<double> values, vectors;
    symmetric_eigen(matrix, n, values, vectors);
    for (std::size_t k = 0; k < n; ++k) {
      CHECK(std::abs(values[k] - pairs->values[k]) < 1e-13 * std::sqrt(static_cast<double>(n)) * 4);
      double dot = 0;  // up to the sign
      for (std::size_t i = 0; i < n; ++i) dot += vectors[k * n + i] * pairs->vectors[k * n + i];
      CHECK(std::abs(dot) == doctest::Approx(1).epsilon(1e-9));
      std::size_t largest = 0;
      for (std::size_t i = 0; i < n; ++i) {
        if (std::abs(pairs->vectors[k * n + i]) > std::abs(pairs->vectors[k * n + largest])) largest = i;
      }
      CHECK(pairs->vectors[k * n + largest] > 0);
    }
  }
}

TEST_CASE("math/jacobi: small eigenvalues beside large ones are accurate to their own rounding") {
  // A = [[1e8, 1], [1, 1]]: the small one is 1 - 1e-8, which a solver that rounds to 1e-16 of the largest knows to 1e-8.
  std::vector<double> matrix{1e8, 1, 1, 1}, values, vectors;
  symmetric_eigen(matrix, 2, values, vectors);
  const long double t = 1e8L + 1, d = 1e8L - 1, small = (t - std::sqrt(t * t - 4 * d)) / 2;
  CHECK(values[1] == doctest::Approx(static_cast<double>(small)).epsilon(1e-15));
}
