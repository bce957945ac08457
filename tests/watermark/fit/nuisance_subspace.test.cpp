// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/fit/nuisance_subspace.hpp"

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

constexpr std::size_t feature_count = 10, reading_count = 300, nuisance_count = 2;

/// Readings that two hidden numbers decide: much and in a straight line in two features, little and in curves in the others; or little by chance.
detail::FourierStatistics readings(bool curves, ThreadExecutor& executor) {
  detail::FourierStatistics found;
  found.mean.assign(feature_count, 0.0);
  found.deviation.resize(feature_count * reading_count);
  const Random random(21, 0, random_stage("test/quiet waves"));
  for (std::size_t n = 0; n < reading_count; ++n) {
    const double s = 2 * random.uniform(3 * n) - 1, t = 2 * random.uniform(3 * n + 1) - 1;
    for (std::size_t k = 0; k < feature_count; ++k) {
      const double curve = std::sin(2 * s + static_cast<double>(k)) * std::cos(t * 2 - static_cast<double>(k));
      const double complement = curves ? curve : random.normal(100000 + n * feature_count + k) / 2;
      found.deviation[k * reading_count + n] = k == 0 ? 3 * s : k == 1 ? 3 * t : 0.1 * complement;
    }
  }
  for (std::size_t k = 0; k < feature_count; ++k) {
    double mean = 0;
    for (std::size_t n = 0; n < reading_count; ++n) mean += found.deviation[k * reading_count + n] / reading_count;
    for (std::size_t n = 0; n < reading_count; ++n) found.deviation[k * reading_count + n] -= mean;
    found.mean[k] = mean;
  }
  found.noise = detail::weighted_products(found.deviation, feature_count, 1, 0, executor);
  return found;
}
DecoderFitSettings settings_of(int coordinates) {
  DecoderFitSettings settings;
  settings.features = static_cast<int>(feature_count);
  settings.coordinates = coordinates;
  settings.width = 0.5;
  settings.prediction_ridge = 1e-3;
  settings.edits_per_view = 0;
  return settings;
}

}  // namespace

TEST_CASE("fit/nuisance_subspace: the complement is orthonormal, and nothing of the nuisance subspace is in it") {
  ThreadExecutor executor(2);
  const detail::FourierStatistics found = readings(true, executor);
  const std::optional<detail::NuisanceComplement> complement =
      detail::nuisance_complement(found, settings_of(nuisance_count), executor);
  REQUIRE(complement);
  REQUIRE(complement->count == feature_count - nuisance_count);
  for (std::size_t i = 0; i < complement->count; ++i) {
    for (std::size_t j = 0; j < complement->count; ++j) {
      double product = 0;
      for (std::size_t k = 0; k < feature_count; ++k)
        product += complement->direction[i * feature_count + k] * complement->direction[j * feature_count + k];
      CHECK(std::abs(product - (i == j ? 1 : 0)) < 1e-12);
    }
    for (std::size_t d = 0; d < nuisance_count; ++d) {
      double product = 0;
      for (std::size_t k = 0; k < feature_count; ++k)
        product += complement->direction[i * feature_count + k] * complement->coordinate[d * feature_count + k];
      CHECK(std::abs(product) < 1e-12);
    }
  }
  // Without coordinates every feature is a direction, and the noise is theirs.
  const std::optional<detail::NuisanceComplement> all = detail::nuisance_complement(found, settings_of(0), executor);
  REQUIRE(all);
  CHECK(all->count == feature_count);
  CHECK(all->noise == found.noise);
  CHECK(all->coefficient.empty());
}

TEST_CASE("fit/nuisance_subspace: what the view decides is not noise, what chance decides is") {
  ThreadExecutor executor(2);
  const auto missed = [&](bool curves) {  // share of the complement's variance
    const detail::FourierStatistics found = readings(curves, executor);
    const std::optional<detail::NuisanceComplement> complement =
        detail::nuisance_complement(found, settings_of(nuisance_count), executor);
    REQUIRE(complement);
    return detail::trace(complement->noise, complement->count) /
           detail::trace(detail::seen_along(found.noise, complement->direction, feature_count), complement->count);
  };
  const double curves = missed(true), chance = missed(false);
  MESSAGE("missed of curves ", curves, ", of chance ", chance);
  CHECK(curves < 0.05);
  CHECK(chance > 0.9);
}

TEST_CASE("fit/nuisance_subspace: the prediction of a decoder's bit is that of the regression") {
  ThreadExecutor executor(2);
  const detail::FourierStatistics found = readings(true, executor);
  const std::optional<detail::NuisanceComplement> complement =
      detail::nuisance_complement(found, settings_of(nuisance_count), executor);
  REQUIRE(complement);
  std::vector<double> row(complement->count);
  for (std::size_t k = 0; k < row.size(); ++k) row[k] = 1 + 0.3 * static_cast<double>(k);
  CoverPrediction<double> cover;
  complement->add_prediction(0, 2, row, cover);
  complement->add_prediction(1, 2, row, cover);
  REQUIRE(cover.centres() == reading_count);
  REQUIRE(cover.coordinates() == nuisance_count);
  // At a reading that it was fitted to the prediction leaves ridge times its coefficient (the law of the regression).
  CoverPrediction<double>::Context context;
  for (const std::size_t n : {0u, 17u, 299u}) {
    std::vector<double> p(feature_count), logits(2);
    double said = 0;
    for (std::size_t k = 0; k < feature_count; ++k) p[k] = found.deviation[k * reading_count + n] + found.mean[k];
    for (std::size_t i = 0; i < row.size(); ++i) {
      for (std::size_t k = 0; k < feature_count; ++k)
        said += row[i] * complement->direction[i * feature_count + k] * found.deviation[k * reading_count + n];
    }
    logits[0] = logits[1] = said;
    cover.subtract(p, logits, context);
    CHECK(logits[0] == doctest::Approx(1e-3 * cover.coefficient[n * 2]).epsilon(1e-6));
    CHECK(logits[1] == logits[0]);
    CHECK(std::abs(logits[0]) < 0.2 * std::abs(said) + 0.01);  // and that is little
  }
}
