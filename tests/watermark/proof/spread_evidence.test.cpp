// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/math/binomial.hpp>
#include <compmark/watermark/proof/spread_evidence.hpp>
#include <cstddef>
#include <limits>
#include <vector>

namespace spread_evidence_test {
namespace {

using namespace compmark;

std::vector<std::int8_t> signs_of(std::uint64_t seed, std::size_t count) {
  const Random random(seed, 0, random_stage("test/signs"));
  std::vector<std::int8_t> signs;
  for (std::size_t i = 0; i < count; ++i) signs.push_back((random.bits(i) & 1) != 0 ? 1 : -1);
  return signs;
}

}  // namespace

TEST_CASE("watermark/proof/spread_evidence: the bound lies above the exact tail of fair signs, and near it") {
  // Sums of one size: T is a binomial.
  for (const std::size_t right : {60u, 70u, 80u, 95u, 100u}) {
    std::vector<std::int8_t> signs(100, 1);
    std::vector<double> sums(100, 2.5);
    for (std::size_t i = right; i < 100; ++i) sums[i] = -2.5;
    const SpreadEvidence evidence = spread_evidence(signs, sums);
    CHECK(evidence.deviations == doctest::Approx((2.0 * static_cast<double>(right) - 100) / 10));
    CHECK(evidence.cells == 100);
    CHECK(evidence.p_value >= binomial_tail(right, 100));
    CHECK(std::log(evidence.p_value) <= 0.5 * std::log(binomial_tail(right, 100)));
  }
}

TEST_CASE(
    "watermark/proof/spread_evidence: no key is better than one that agrees with every cell, and that one reaches it") {
  for (const double spread_of_sizes : {0.0, 1.0, 3.0}) {
    const Random random(3, 0, random_stage("test/sizes"));
    std::vector<double> sums(200);
    for (std::size_t i = 0; i < sums.size(); ++i)
      sums[i] = std::exp(spread_of_sizes * random.normal(i)) * ((random.bits(i + 1000) & 1) != 0 ? 1 : -1);
    std::vector<std::int8_t> agrees;
    for (const double sum : sums) agrees.push_back(sum > 0 ? 1 : -1);
    const SpreadEvidence best = spread_evidence(agrees, sums);
    CAPTURE(spread_of_sizes);
    CHECK(best.deviations == best.most_deviations);
    CHECK(best.p_value == best.least_p_value());
    for (std::uint64_t key = 1; key < 50; ++key) {
      const SpreadEvidence other = spread_evidence(signs_of(key, sums.size()), sums);
      CHECK(other.most_deviations == best.most_deviations);
      CHECK(other.p_value >= best.least_p_value());
    }
    // Cells that all say as much are worth their number, others less: of the widest, a fifth of it at most.
    const double of_cells = std::sqrt(200.0);
    if (spread_of_sizes == 0.0) CHECK(best.most_deviations == doctest::Approx(of_cells));
    if (spread_of_sizes == 3.0) CHECK(best.most_deviations * best.most_deviations < 200.0 / 5);
  }
  CHECK(SpreadEvidence{}.least_p_value() == 1);
}

TEST_CASE("watermark/proof/spread_evidence: random keys are at most p with probability p, whatever the pictures say") {
  // Sums that are all alike, of very different sizes, and one that outweighs all: the last is where a normal law fails.
  for (const int shape : {0, 1, 2}) {
    const Random random(9, 0, random_stage("test/sums"));
    std::vector<double> sums(500);
    for (std::size_t i = 0; i < sums.size(); ++i) {
      const double size = std::exp(3 * random.normal(i));
      sums[i] = shape == 0 ? 1 : shape == 1 ? size : i == 0 ? 100 : 1;
    }
    for (const double level : {0.3, 0.1, 0.01, 1e-3}) {
      std::size_t hits = 0, normal_hits = 0;
      constexpr std::size_t keys = 20'000;
      for (std::size_t k = 0; k < keys; ++k) {
        const SpreadEvidence evidence = spread_evidence(signs_of(k + 1, sums.size()), sums);
        if (evidence.p_value <= level) ++hits;
        if (0.5 * std::erfc(evidence.deviations / std::sqrt(2.0)) <= level) ++normal_hits;
      }
      CAPTURE(shape);
      CAPTURE(level);
      CAPTURE(hits);
      const double most = level * keys + 4 * std::sqrt(level * keys);
      CHECK(static_cast<double>(hits) <= most);
      // Negative control: by a normal law half of the keys have p below 0.3.
      if (shape == 2 && level == 0.3) CHECK(static_cast<double>(normal_hits) > most);
    }
  }
}

TEST_CASE("watermark/proof/spread_evidence: agreement is evidence; disagreement, nothing and extremes are none") {
  std::vector<std::int8_t> signs = signs_of(4, 400);
  std::vector<double> sums(signs.begin(), signs.end());
  CHECK(std::log(spread_evidence(signs, sums).p_value) == doctest::Approx(-200));
  // A p-value of 0 does not exist: the bound of 1,600 cells that all agree is e^-800.
  const std::vector<std::int8_t> many = signs_of(5, 1600);
  CHECK(spread_evidence(many, std::vector<double>(many.begin(), many.end())).p_value > 0);
  for (double& sum : sums) sum *= 1e200;  // whose squares overflow
  CHECK(spread_evidence(signs, sums).deviations == doctest::Approx(20));
  for (double& sum : sums) sum *= -1e-200;
  CHECK(spread_evidence(signs, sums).p_value == 1);
  for (double& sum : sums) sum *= 1e-300;  // whose squares are lost
  CHECK(spread_evidence(signs, sums).deviations == doctest::Approx(-20));
  std::fill(sums.begin(), sums.end(), 0.0);
  CHECK(spread_evidence(signs, sums).p_value == 1);
  CHECK(spread_evidence(signs, sums).cells == 0);
  CHECK(spread_evidence({}, {}).p_value == 1);
}

}  // namespace spread_evidence_test
