// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/fit/fourier_statistics.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "fourier_bench.hpp"

namespace {

using namespace compmark;
using compmark::testing::FourierBench;
using Probe = compmark::testing::FourierBenchProbe;

}  // namespace

TEST_CASE("fit/fourier_statistics: noise is the covariance of what is read, energy and agreement those of gradients") {
  FourierBench bench;
  Probe probe = bench.probe();
  const detail::FourierStatistics found = *detail::fourier_statistics(probe, bench.settings, bench.executor);
  const std::size_t features = 6, samples = 20;
  std::vector<std::vector<double>> read;
  std::vector<double> mean(features, 0.0);
  for (std::size_t n = 0; n < samples; ++n) {
    REQUIRE(probe.render("decoder fit", n, bench.settings.reach).ok());
    read.emplace_back(probe.means().begin(), probe.means().end());
    for (std::size_t k = 0; k < features; ++k) mean[k] += read.back()[k] / samples;
  }
  for (std::size_t k = 0; k < features; ++k) {
    CHECK(found.mean[k] == doctest::Approx(mean[k]).epsilon(1e-12));
    for (std::size_t l = 0; l < features; ++l) {
      double covariance = 0;
      for (const std::vector<double>& p : read) covariance += (p[k] - mean[k]) * (p[l] - mean[l]) / samples;
      CHECK(found.noise[k * features + l] == doctest::Approx(covariance).epsilon(1e-9));
    }
  }

  const Random random(9, 0, random_stage("test quadratic"));
  double most = 0;
  for (std::size_t trial = 0; trial < 20; ++trial) {
    std::vector<double> w(features);
    for (std::size_t k = 0; k < features; ++k) w[k] = random.normal(trial * features + k);
    const double energy = detail::quadratic(found.energy, w.data(), features);
    const double agreement = detail::quadratic(found.agreement, w.data(), features);
    CHECK(energy > 0);
    // |sum over u != v of g_u . g_v| is at most V (V - 1) of the mean square (Cauchy), and at least -V: views cannot all disagree.
    CHECK(agreement <= energy * (1 + 1e-9));
    CHECK(agreement >= -energy / 2 * (1 + 1e-9));  // 3 views: 1 / (V - 1)
    most = std::max(most, std::abs(agreement) / energy);
  }
  CHECK(most < 0.999);  // of views that differ: else agreement would be energy by another name
  CHECK(detail::trace(found.agreement, features) < detail::trace(found.energy, features));
}

TEST_CASE("fit/fourier_statistics: every view is read edited too, and the noise is the weighted mean of both") {
  FourierBench bench;
  bench.settings.edits_per_view = 2;
  bench.settings.edit_weight = 0.3;
  bench.settings.edits.weight = {0, 1, 1, 0, 1, 1, 1, 0};  // there is no codec here
  Probe probe = bench.probe();
  const detail::FourierStatistics found = *detail::fourier_statistics(probe, bench.settings, bench.executor);
  const std::size_t features = 6, samples = 20, readings = 60;
  REQUIRE(found.deviation.size() == features * readings);
  CHECK(found.per_view == 3);
  // The readings are those of the probe, in the order that is promised, less the clean ones' mean.
  REQUIRE(probe.render("decoder fit", 3, bench.settings.reach).ok());
  const std::vector<double> clean = probe.means(), edited = probe.edited_means(6, NoJpeg{});
  CHECK(clean != edited);
  for (std::size_t k = 0; k < features; ++k) {
    CHECK(found.deviation[k * readings + 9] == doctest::Approx(clean[k] - found.mean[k]).epsilon(1e-12));
    CHECK(found.deviation[k * readings + 10] == doctest::Approx(edited[k] - found.mean[k]).epsilon(1e-12));
    double mean = 0;
    for (std::size_t n = 0; n < samples; ++n) mean += found.deviation[k * readings + 3 * n];
    CHECK(std::abs(mean) < 1e-12);
    for (std::size_t l = 0; l < features; ++l) {
      double product = 0;
      for (std::size_t n = 0; n < readings; ++n) {
        product +=
            (n % 3 == 0 ? 0.7 / 20 : 0.3 / 40) * found.deviation[k * readings + n] * found.deviation[l * readings + n];
      }
      CHECK(found.noise[k * features + l] == doctest::Approx(product).epsilon(1e-9));
    }
  }
  // An edit of nothing reads what is there: the stream of edits moves nothing else.
  AugmentationSettings nothing = no_augmentation();
  bench.settings.edits = nothing;
  Probe plain = bench.probe();
  REQUIRE(plain.render("decoder fit", 3, bench.settings.reach).ok());
  CHECK(plain.edited_means(6, NoJpeg{}) == clean);
}

TEST_CASE("fit/fourier_statistics: where all views are one, what moves one moves the other") {
  // A single camera has no neighbour: its sampled views differ by roll and zoom alone.
  FourierBench one;
  one.views.count = 1;
  FourierBench ring;
  Probe narrow = one.probe(), wide = ring.probe();
  const detail::FourierStatistics same = *detail::fourier_statistics(narrow, one.settings, one.executor);
  const detail::FourierStatistics differ = *detail::fourier_statistics(wide, ring.settings, ring.executor);
  const double kept = detail::trace(same.agreement, 6) / detail::trace(same.energy, 6);
  const double lost = detail::trace(differ.agreement, 6) / detail::trace(differ.energy, 6);
  MESSAGE("agreement of one place ", kept, ", of a ring ", lost);
  CHECK(kept > lost);
}
