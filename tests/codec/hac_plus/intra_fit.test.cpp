// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/hac_plus/intra_fit.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include "compmark/codec/coder/gaussian_tables.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

/// Two scalars of deviation 4 bins, the second `share` of the first's deviation and the rest its own.
IntraSample pairs(std::size_t anchors, double share) {
  const Random random(9, 1, random_stage("intra fit test"));
  IntraSample sample;
  sample.channels = 2;
  for (std::size_t i = 0; i < anchors; ++i) {
    const double first = random.normal(2 * i),
                 second = share * first + std::sqrt(1 - share * share) * random.normal(2 * i + 1);
    for (const double deviation : {first, second}) {
      sample.predicted.push_back({0, 2048 * 2});
      sample.symbol.push_back(static_cast<std::int32_t>(std::lround(4 * deviation)));
      sample.coded.push_back(1);
      sample.near.push_back(0);
    }
    sample.has_near.push_back(0);
  }
  return sample;
}

TEST_CASE("hac_plus/intra_fit: finds the regression of one scalar on another, and saves what information theory says") {
  const GaussianTables tables;
  const IntraSample sample = pairs(4000, 0.9);
  const IntraContext none = IntraContext::none(2), fitted = fit_intra(sample);
  CHECK(std::abs(fitted.mean[0] - 0.9 * 32) <= 1.5);  // rounding of a weight, and the pull
  // The deviation falls to sqrt(1 - 0.81) = 0.436 of what it was: by 1.2 octaves.
  CHECK(std::abs(fitted.spread_bias[1] + 1.198 * 32) <= 5);
  const double saved = (intra_bits(tables, none, sample) - intra_bits(tables, fitted, sample)) / 4000;
  CHECK(std::abs(saved - 1.198) < 0.04);  // of a sample of 4,000 with levels of an eighth of an octave
}

TEST_CASE("hac_plus/intra_fit: finds nothing in scalars that say nothing of one another") {
  const GaussianTables tables;
  const IntraSample sample = pairs(4000, 0);
  const IntraContext fitted = fit_intra(sample);
  CHECK(std::abs(int{fitted.mean[0]}) <= 1);
  CHECK(std::abs(int{fitted.spread[0]}) <= 1);
  const double saved = (intra_bits(tables, IntraContext::none(2), sample) - intra_bits(tables, fitted, sample)) / 4000;
  CHECK(std::abs(saved) < 0.01);
}

TEST_CASE("hac_plus/intra_fit: finds what the anchors beside an anchor say") {
  const GaussianTables tables;
  const Random random(9, 2, random_stage("intra fit test"));
  IntraSample sample = pairs(4000, 0);
  for (std::size_t i = 0; i < sample.near.size(); ++i) {  // half of the deviation, and as much of their own
    sample.near[i] = static_cast<std::int16_t>(std::lround(512 * (sample.symbol[i] / 8.0 + 0.5 * random.normal(i))));
    sample.has_near[i / 2] = 1;
  }
  const IntraContext fitted = fit_intra(sample);
  // n = z / 2 + v / 2 for z, v of deviation 1: the best guess of z is n, and leaves sqrt(1 / 2) of its deviation.
  CHECK(std::abs(int{fitted.near[0]} - 32) <= 2);
  CHECK(std::abs(int{fitted.near[1]} - 32) <= 2);
  const double saved = (intra_bits(tables, IntraContext::none(2), sample) - intra_bits(tables, fitted, sample)) / 4000;
  CHECK(std::abs(saved - 1) < 0.05);
}

TEST_CASE("hac_plus/intra_fit: the derivatives of a bin's probability are those of differences") {
  for (const float distance : {-3.0f, -0.4f, 0.0f, 0.7f, 2.5f}) {
    for (const float level : {-1.0f, 0.0f, 1.5f}) {
      const auto mass = [&](float d, float l) { return static_cast<double>(detail::bin_mass(d, l).mass); };
      const detail::BinMass bin = detail::bin_mass(distance, level);
      constexpr float h = 1.0f / 64;  // of floats: errors of h^2 and of 2^-24 / h
      CHECK(std::abs((mass(distance - h, level) - mass(distance + h, level)) / (2 * h) -
                     static_cast<double>(bin.by_mean)) < 1e-3);
      CHECK(std::abs((mass(distance, level + h) - mass(distance, level - h)) / (2 * h) -
                     static_cast<double>(bin.by_spread)) < 1e-3);
    }
  }
}

TEST_CASE("hac_plus/intra_fit: no anchors and too many scalars are left without weights") {
  IntraSample sample;
  sample.channels = 5;
  CHECK(fit_intra(sample) == IntraContext::none(5));
  CHECK(fit_intra(pairs(10, 0.9), {.most_channels = 1}) == IntraContext::none(2));
}

}  // namespace
