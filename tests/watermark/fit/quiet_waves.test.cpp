// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/fit/quiet_waves.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"

using namespace compmark;

namespace {

constexpr std::size_t wave_count = 10, reading_count = 300, loud_count = 2;

/// Readings that two hidden numbers decide: loudly and in a straight line in two waves, quietly and in curves in the others; or quietly by chance.
detail::WaveStatistics readings(bool curves, ThreadExecutor& executor) {
  detail::WaveStatistics found;
  found.mean.assign(wave_count, 0.0);
  found.deviation.resize(wave_count * reading_count);
  const Random random(21, 0, random_stage("test/quiet waves"));
  for (std::size_t n = 0; n < reading_count; ++n) {
    const double s = 2 * random.uniform(3 * n) - 1, t = 2 * random.uniform(3 * n + 1) - 1;
    for (std::size_t k = 0; k < wave_count; ++k) {
      const double curve = std::sin(2 * s + static_cast<double>(k)) * std::cos(t * 2 - static_cast<double>(k));
      const double quiet = curves ? curve : random.normal(100000 + n * wave_count + k) / 2;
      found.deviation[k * reading_count + n] = k == 0 ? 3 * s : k == 1 ? 3 * t : 0.1 * quiet;
    }
  }
  for (std::size_t k = 0; k < wave_count; ++k) {
    double mean = 0;
    for (std::size_t n = 0; n < reading_count; ++n) mean += found.deviation[k * reading_count + n] / reading_count;
    for (std::size_t n = 0; n < reading_count; ++n) found.deviation[k * reading_count + n] -= mean;
    found.mean[k] = mean;
  }
  found.noise = detail::weighted_products(found.deviation, wave_count, 1, 0, executor);
  return found;
}
DecoderFitSettings settings_of(int coordinates) {
  DecoderFitSettings settings;
  settings.waves = static_cast<int>(wave_count);
  settings.coordinates = coordinates;
  settings.width = 0.5;
  settings.prediction_ridge = 1e-3;
  settings.edits_per_view = 0;
  return settings;
}

}  // namespace

TEST_CASE("fit/quiet_waves: the quiet directions are orthonormal and hear nothing of the loud ones") {
  ThreadExecutor executor(2);
  const detail::WaveStatistics found = readings(true, executor);
  const std::optional<detail::QuietWaves> quiet = detail::quiet_waves(found, settings_of(loud_count), executor);
  REQUIRE(quiet);
  REQUIRE(quiet->count == wave_count - loud_count);
  for (std::size_t i = 0; i < quiet->count; ++i) {
    for (std::size_t j = 0; j < quiet->count; ++j) {
      double product = 0;
      for (std::size_t k = 0; k < wave_count; ++k)
        product += quiet->direction[i * wave_count + k] * quiet->direction[j * wave_count + k];
      CHECK(std::abs(product - (i == j ? 1 : 0)) < 1e-12);
    }
    for (std::size_t d = 0; d < loud_count; ++d) {
      double product = 0;
      for (std::size_t k = 0; k < wave_count; ++k)
        product += quiet->direction[i * wave_count + k] * quiet->coordinate[d * wave_count + k];
      CHECK(std::abs(product) < 1e-12);
    }
  }
  // Without coordinates every wave is a direction, and the noise is what the waves say.
  const std::optional<detail::QuietWaves> all = detail::quiet_waves(found, settings_of(0), executor);
  REQUIRE(all);
  CHECK(all->count == wave_count);
  CHECK(all->noise == found.noise);
  CHECK(all->coefficient.empty());
}

TEST_CASE("fit/quiet_waves: what the view decides is not noise, what chance decides is") {
  ThreadExecutor executor(2);
  const auto missed = [&](bool curves) {  // share of the quiet directions' variance
    const detail::WaveStatistics found = readings(curves, executor);
    const std::optional<detail::QuietWaves> quiet = detail::quiet_waves(found, settings_of(loud_count), executor);
    REQUIRE(quiet);
    return detail::trace(quiet->noise, quiet->count) /
           detail::trace(detail::seen_along(found.noise, quiet->direction, wave_count), quiet->count);
  };
  const double curves = missed(true), chance = missed(false);
  MESSAGE("missed of curves ", curves, ", of chance ", chance);
  CHECK(curves < 0.05);
  CHECK(chance > 0.9);
}

TEST_CASE("fit/quiet_waves: the prediction of a decoder's bit is that of the regression") {
  ThreadExecutor executor(2);
  const detail::WaveStatistics found = readings(true, executor);
  const std::optional<detail::QuietWaves> quiet = detail::quiet_waves(found, settings_of(loud_count), executor);
  REQUIRE(quiet);
  std::vector<double> row(quiet->count);
  for (std::size_t k = 0; k < row.size(); ++k) row[k] = 1 + 0.3 * static_cast<double>(k);
  HostPrediction<double> host;
  quiet->add_prediction(0, 2, row, host);
  quiet->add_prediction(1, 2, row, host);
  REQUIRE(host.centres() == reading_count);
  REQUIRE(host.coordinates() == loud_count);
  // At a reading that it was fitted to the prediction leaves ridge times its coefficient (the law of the regression).
  HostPrediction<double>::Context context;
  for (const std::size_t n : {0u, 17u, 299u}) {
    std::vector<double> p(wave_count), logits(2);
    double said = 0;
    for (std::size_t k = 0; k < wave_count; ++k) p[k] = found.deviation[k * reading_count + n] + found.mean[k];
    for (std::size_t i = 0; i < row.size(); ++i) {
      for (std::size_t k = 0; k < wave_count; ++k)
        said += row[i] * quiet->direction[i * wave_count + k] * found.deviation[k * reading_count + n];
    }
    logits[0] = logits[1] = said;
    host.subtract(p, logits, context);
    CHECK(logits[0] == doctest::Approx(1e-3 * host.coefficient[n * 2]).epsilon(1e-6));
    CHECK(logits[1] == logits[0]);
    CHECK(std::abs(logits[0]) < 0.2 * std::abs(said) + 0.01);  // and that is little
  }
}
