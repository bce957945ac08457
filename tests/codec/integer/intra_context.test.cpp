// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/integer/intra_context.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "compmark/codec/integer/integer_context.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

IntraContext random_intra(std::size_t channels, std::uint64_t seed) {
  const Random random(seed, channels, random_stage("intra context"));
  IntraContext context = IntraContext::none(channels);
  std::uint64_t draw = 0;
  for (auto* part : IntraContext::parts(context)) {
    for (std::int16_t& weight : *part) weight = static_cast<std::int16_t>(std::lround(4 * random.normal(draw++)));
  }
  return context;
}

TEST_CASE("integer/intra_context: the tables are those of the specification, and near the real numbers") {
  CHECK(deviation_table_hash() == 0xD3F336F8BA492C9Full);
  for (int i = 0; i < GaussianTables::levels; ++i) {
    const double sigma = std::exp2((i + GaussianTables::least_level) / 8.0), size = std::sqrt(sigma * sigma + 1 / 12.0);
    // Roots are cut to 2^-13 of 0.31 and more.
    CHECK(std::abs(detail::deviation_tables.size[static_cast<std::size_t>(i)] / 8192.0 / size - 1) < 5e-4);
    CHECK(std::abs(detail::deviation_tables.inverse[static_cast<std::size_t>(i)] * size / 0x1p24 - 1) < 5e-4);
  }
}

TEST_CASE("integer/intra_context: without weights it is HAC's own model, at every level, step and mean") {
  const IntraContext none = IntraContext::none(3);
  IntraState state(none);
  state.begin();
  const Random random(3, 1, random_stage("intra context"));
  for (std::uint64_t i = 0; i < 20'000; ++i) {
    const auto mean = static_cast<std::int32_t>(std::lround(1e5 * random.normal(3 * i))),
               sigma = static_cast<std::int32_t>(std::lround(20'000 * (random.uniform(3 * i + 1) - 0.5)));
    const int index = StepGrid::least + static_cast<int>(random.bits(3 * i + 2) % StepGrid::count);
    const SymbolModel hac = PanelModels::model(mean, sigma, index, step_reciprocal(index));
    const HashPrediction predicted = HashPrediction::of(mean, sigma, index, step_reciprocal(index));
    const SymbolModel mine = state.model(i % 3, predicted);
    REQUIRE(mine.mean == hac.mean);
    REQUIRE(mine.sigma_index == hac.sigma_index);
    state.tell(0, predicted, static_cast<std::int32_t>(i));
  }
}

TEST_CASE("integer/intra_context: a state tells what the formulas of its header say") {
  constexpr std::size_t channels = 9;
  const IntraContext context = random_intra(channels, 7);
  const Random random(4, 1, random_stage("intra context"));
  IntraState state(context);
  for (std::uint64_t anchor = 0; anchor < 200; ++anchor) {
    std::vector<std::int16_t> near;
    for (std::size_t t = 0; anchor != 0 && t < channels; ++t)
      near.push_back(static_cast<std::int16_t>(random.bits(1'000'000 + anchor * channels + t) % 1025 - 512));
    state.begin(near);
    std::vector<double> z(channels, 0), size(channels, 0);
    for (std::size_t t = 0; t < channels; ++t) {
      const std::uint64_t draw = (anchor * channels + t) * 4;
      const HashPrediction predicted{static_cast<std::int32_t>(std::lround(300 * random.normal(draw))),
                                     static_cast<std::int32_t>(std::lround(20'000 * random.uniform(draw + 1))) - 6400};
      if (random.uniform(draw + 2) < 0.2) continue;  // not coded
      const double table = static_cast<double>(HashPrediction::table(predicted.level)) + GaussianTables::least_level;
      const double sigma = std::exp2(table / 8), e = std::sqrt(sigma * sigma + 1 / 12.0);
      double mean = context.mean_bias[t], level = context.spread_bias[t];
      if (!near.empty()) {
        mean += context.near[t] * near[t] / 512.0;
        level += context.near_spread[t] * (std::abs(near[t] / 512.0) - 0.5);
      }
      for (std::size_t s = 0; s < t; ++s) {
        const std::size_t at = context.row(s) + t - s - 1;
        mean += context.mean[at] * z[s];
        level += context.spread[at] * size[s];
      }
      mean = predicted.mean / 32.0 + e * mean / 32;
      level = std::clamp(predicted.level / 256.0 + 8 * level / 32, -25.0, 56.0);
      const SymbolModel model = state.model(t, predicted);
      // Deviations are rounded to 2^-10 and tables to 5e-4; nine weights below 20/32 say at most 23 deviations.
      CHECK(std::abs(model.mean / 32.0 - mean) < 0.02 + 0.03 * e);
      CHECK(std::abs(model.sigma_index - 25 - level) < 0.55);
      const auto symbol = static_cast<std::int32_t>(std::lround(mean + e * random.normal(draw + 3)));
      z[t] = std::clamp((symbol - predicted.mean / 32.0) / e, -4.0, 4.0);
      size[t] = std::abs(z[t]) - 0.8;
      state.tell(t, predicted, symbol);
    }
  }
}

TEST_CASE("integer/intra_context: the greatest weights and deviations of the most scalars overflow nothing") {
  constexpr std::size_t channels = 4096 + 6 + 96;
  IntraContext context = IntraContext::none(channels);
  std::fill(context.mean.begin(), context.mean.end(), std::int16_t{127});
  std::fill(context.spread.begin(), context.spread.end(), std::int16_t{127});
  std::fill(context.mean_bias.begin(), context.mean_bias.end(), std::int16_t{127});
  IntraState state(context);
  state.begin();
  const HashPrediction predicted{-(1 << 29), HashPrediction::greatest_level};
  for (std::size_t s = 0; s + 1 < channels; ++s) state.tell(s, predicted, greatest_symbol);
  // Without an overflow the guess is up: 4,197 times 4 deviations of 128 bins, 4 weights each, held at 2^29.
  CHECK(state.model(channels - 1, predicted).mean > predicted.mean);
  CHECK(state.model(channels - 1, predicted).sigma_index == GaussianTables::levels - 1);
}

}  // namespace
