// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/symmetric.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

TEST_CASE("math/symmetric: solve_positive solves random normal equations") {
  const Random random(3, 0, random_stage("symmetric test"));
  constexpr std::size_t n = 16, samples = 40;
  std::vector<double> design(samples * n), lower(n * (n + 1) / 2), truth(n * 3), right(n * 3);
  for (std::size_t i = 0; i < design.size(); ++i) design[i] = random.normal(i);
  for (std::size_t i = 0; i < truth.size(); ++i) truth[i] = random.normal(1000 + i);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      double sum = 0;
      for (std::size_t s = 0; s < samples; ++s) sum += design[s * n + i] * design[s * n + j];
      if (j <= i) lower[packed_index(i, j)] = sum;
      for (std::size_t c = 0; c < 3; ++c) right[i * 3 + c] += sum * truth[j * 3 + c];
    }
  }
  REQUIRE(solve_positive(lower, n, right, 3));
  for (std::size_t i = 0; i < truth.size(); ++i) CHECK(right[i] == doctest::Approx(truth[i]).epsilon(1e-11));
}

TEST_CASE(
    "math/symmetric: a singular, an indefinite and a NaN matrix are refused and leave the right-hand side alone") {
  for (const std::array<double, 3>& matrix : {std::array<double, 3>{1, 1, 1}, std::array<double, 3>{1, 2, 1},
                                              std::array<double, 3>{1, std::numeric_limits<double>::quiet_NaN(), 1}}) {
    std::array<double, 3> lower = matrix;
    std::array<double, 2> right{1, 2};
    CHECK_FALSE(solve_positive(lower, 2, right, 1));
    CHECK(right == std::array<double, 2>{1, 2});
  }
}

TEST_CASE("math/symmetric: the mean of quaternions does not depend on their signs; the plain sum does") {
  const std::array<double, 4> q{0.5, 0.5, -0.5, 0.5};
  std::array<double, 10> moment{};
  std::array<double, 4> plain{};
  for (int i = 0; i < 8; ++i) {
    const double sign = i % 2 == 0 ? 1 : -1;  // q and -q are the same rotation
    std::array<double, 4> sample{};
    for (std::size_t k = 0; k < 4; ++k)
      sample[k] = sign * (q[k] + 0.01 * ((i / 2 + static_cast<int>(k)) % 2 == 0 ? 1 : -1));
    for (std::size_t r = 0; r < 4; ++r) {
      plain[r] += sample[r];
      for (std::size_t c = 0; c <= r; ++c) moment[packed_index(r, c)] += sample[r] * sample[c];
    }
  }
  const std::array<double, 4> mean = largest_eigenvector<4>(moment);
  double dot = 0, norm = 0, plain_norm = 0;
  for (std::size_t k = 0; k < 4; ++k)
    dot += mean[k] * q[k], norm += mean[k] * mean[k], plain_norm += plain[k] * plain[k];
  CHECK(norm == doctest::Approx(1).epsilon(1e-14));
  CHECK(std::abs(dot) > 1 - 1e-3);
  CHECK(plain_norm < 1e-20);  // negative control: the samples cancel
}

TEST_CASE("math/symmetric: eigenvector of a known matrix") {
  // [[2, 1], [1, 2]] has eigenvalue 3 at (1, 1) / sqrt 2.
  const std::array<double, 3> lower{2, 1, 2};
  const std::array<double, 2> vector = largest_eigenvector<2>(lower);
  CHECK(vector[0] == doctest::Approx(std::sqrt(0.5)).epsilon(1e-14));
  CHECK(vector[1] == doctest::Approx(std::sqrt(0.5)).epsilon(1e-14));
}
