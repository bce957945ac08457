// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/eigen_pairs.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {

std::vector<double> identity(std::size_t n) {
  std::vector<double> m(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) m[i * n + i] = 1;
  return m;
}
/// G G^T + shift I of random normals.
std::vector<double> random_positive(std::size_t n, std::uint64_t seed, double shift) {
  const Random random(seed, 0, random_stage("test/eigen pairs"));
  std::vector<double> m(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t k = 0; k < n; ++k) m[i * n + j] += random.normal(i * n + k) * random.normal(j * n + k);
    }
    m[i * n + i] += shift;
  }
  return m;
}

}  // namespace

TEST_CASE("math/eigen_pairs: the vibrating string has the eigenvalues of the textbook") {
  constexpr std::size_t n = 24;
  std::vector<double> a(n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    a[i * n + i] = 2;
    if (i > 0) a[i * n + i - 1] = a[(i - 1) * n + i] = -1;
  }
  const auto pairs = symmetric_eigen_pairs(a, identity(n), n);
  REQUIRE(pairs);
  for (std::size_t k = 0; k < n; ++k) {  // 2 - 2 cos(j pi / (n + 1)), the largest first
    const double expected = 2 - 2 * std::cos(static_cast<double>(n - k) * std::numbers::pi / (n + 1));
    CHECK(pairs->values[k] == doctest::Approx(expected).epsilon(1e-13));
  }
}

TEST_CASE("math/eigen_pairs: A w = lambda B w, and the vectors are orthonormal in B") {
  constexpr std::size_t n = 37;
  std::vector<double> a = random_positive(n, 1, 0);
  for (std::size_t i = 0; i < n; ++i) a[i * n + i] -= 40;  // of either sign
  const std::vector<double> b = random_positive(n, 2, 0.5);
  const auto pairs = symmetric_eigen_pairs(a, b, n);
  REQUIRE(pairs);
  double residual = 0, product = 0, size = 0;
  for (std::size_t k = 0; k < n; ++k) {
    if (k > 0) CHECK(pairs->values[k] <= pairs->values[k - 1]);
    const double* const w = pairs->vectors.data() + k * n;
    for (std::size_t l = 0; l < n; ++l) {
      const double* const u = pairs->vectors.data() + l * n;
      double dot = 0;
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j) dot += u[i] * b[i * n + j] * w[j];
      }
      product = std::fmax(product, std::abs(dot - (k == l ? 1 : 0)));
    }
    for (std::size_t i = 0; i < n; ++i) {
      double left = 0, right = 0;
      for (std::size_t j = 0; j < n; ++j) {
        left += a[i * n + j] * w[j];
        right += b[i * n + j] * w[j];
      }
      residual = std::fmax(residual, std::abs(left - pairs->values[k] * right));
      size = std::fmax(size, std::abs(left));
    }
  }
  CHECK(residual < 1e-11 * size);
  CHECK(product < 1e-12);
  CHECK(pairs->values.front() > 0);
  CHECK(pairs->values.back() < 0);
}

TEST_CASE("math/eigen_pairs: a matrix that is not positive definite, or not finite, gives nothing") {
  constexpr std::size_t n = 3;
  std::vector<double> indefinite = identity(n), broken = identity(n);
  indefinite[4] = -1;
  broken[4] = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(symmetric_eigen_pairs(identity(n), indefinite, n));
  CHECK_FALSE(symmetric_eigen_pairs(identity(n), broken, n));
  CHECK_FALSE(symmetric_eigen_pairs(broken, identity(n), n));
  CHECK(symmetric_eigen_pairs(identity(n), identity(n), n));
}
