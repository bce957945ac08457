// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/normals.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

TEST_CASE("math/normals: logarithm and cosine are those of the C library to rounding, at the ends too") {
  constexpr double unit = std::numeric_limits<double>::epsilon();
  double log_error = 0, cosine_error = 0;
  const auto look = [&](double u) {
    const double l = std::log(u);
    log_error = std::fmax(log_error, std::abs(detail::log_of_uniform(u) - l) / std::abs(l));
    // The reference has the reduction's own error, 2 pi v rounded: half a unit of an angle of up to 2 pi.
    cosine_error = std::fmax(cosine_error, std::abs(detail::cosine_of_turns(u) - std::cos(2 * std::numbers::pi * u)));
  };
  const Random random(2, 0, random_stage("normals test"));
  for (std::uint64_t i = 0; i < 200000; ++i) look(random.uniform(i));
  for (const double u : {0x1p-53, 0x1.8p-52, 1 - 0x1p-53, 0.25, 0.5, 0.75, std::sqrt(0.5), 0.5 + 0x1p-53}) look(u);
  CHECK(log_error < 1.5 * unit);   // measured: 0.7
  CHECK(cosine_error < 5 * unit);  // measured: 2.9; half a unit of 2 pi is 2
  CHECK(std::abs(detail::cosine_of_turns(0.25)) < unit);
  CHECK(detail::cosine_of_turns(0.5) == -1);
}

TEST_CASE("math/normals: those of Random::normal, from any index and in any number") {
  const Random random(9, 4, random_stage("normals test"));
  double error = 0;
  std::size_t other_floats = 0, all = 0;
  for (const std::size_t count :
       {std::size_t{1}, std::size_t{63}, std::size_t{64}, std::size_t{65}, std::size_t{30001}}) {
    const std::uint64_t first = 17 * count;
    std::vector<double> normals(count + 1, 7.0);
    fill_normals(random, first, std::span<double>(normals).first(count));
    CHECK(normals[count] == 7.0);  // and not one more
    for (std::size_t i = 0; i < count; ++i, ++all) {
      const double expected = random.normal(first + i);
      error = std::fmax(error, std::abs(normals[i] - expected));
      other_floats += static_cast<float>(normals[i]) != static_cast<float>(expected) ? 1 : 0;
    }
  }
  CHECK(error < 1e-14);  // measured: 1.9e-15, of numbers up to 5
  CHECK(other_floats <= 2);
  // Negative control: the neighbours' numbers are far away.
  std::vector<double> one(1);
  fill_normals(random, 5, one);
  CHECK(std::abs(one[0] - random.normal(6)) > 1e-3);
}
