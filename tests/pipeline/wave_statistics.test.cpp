// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/pipeline/wave_statistics.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/mark/pretrain/lattice_network.hpp"
#include "directional.hpp"
#include "small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::SmallestSmoothRecipe;

using Probe = detail::WaveProbe<SmallestSmoothRecipe, BlobViews, ThreadExecutor>;

DecoderFitSettings small_statistics() {
  DecoderFitSettings settings;
  settings.bits = 4;
  settings.waves = 6;
  settings.period = 0.4;
  settings.statistics_views = 20;
  settings.gradient_views = 3;
  settings.reach = 1;
  settings.stride = 2;
  settings.edits_per_view = 0;
  settings.ridge = 0.01;
  return settings;
}
/// A host, its waves and a probe of them; some of its anchors alone where `anchors` says so.
struct WaveBench {
  explicit WaveBench(const DecoderFitSettings& chosen = small_statistics())
      : settings(chosen),
        host(compmark::testing::random_model<SmallestSmoothRecipe>(7)) {
    lattice.measure = LatticeMeasure::colour;
    lattice.bits = settings.bits;
    lattice.features = settings.waves;
    lattice.sigma = {0.5};
    lattice.stride = 2;
    waves = random_lattice<double>(lattice, std::vector<double>{settings.period}, settings.seed, 1);
  }
  [[nodiscard]] Probe probe() { return {host, views, lattice, waves, settings, executor}; }

  DecoderFitSettings settings;
  Model<SmallestSmoothRecipe> host;
  BlobViews views{.count = 6, .width = 24, .height = 20};
  LatticeSettings lattice;
  LatticeWeights<double> waves;
  ThreadExecutor executor{2};
};

/// Means of the waves in the probe's view, of the render itself and not of its 8 bits: what the gradients are of.
std::vector<double> smooth_means(WaveBench& bench, const Probe& probe) {
  const LatticeDecoder<double> decoder(bench.lattice, bench.waves);
  LatticeDecoder<double>::Context context;
  decoder.pool(probe.image(), context, bench.executor);
  return {context.pooled.begin(), context.pooled.end()};
}
double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace

TEST_CASE("pipeline/wave_statistics: a wave's gradient is that of its mean") {
  WaveBench bench;
  Probe probe = bench.probe();
  probe.render("test", 1);
  const MatrixView<double> feature = bench.host.arena.values(bench.host.anchors.feature);
  REQUIRE(probe.parameters() == feature.size());
  const Random random(5, 0, random_stage("test direction"));
  std::vector<double> direction(feature.size()), start(feature.data, feature.data + feature.size());
  for (std::size_t i = 0; i < direction.size(); ++i) direction[i] = random.normal(i);
  std::vector<double> analytic;
  for (std::size_t k = 0; k < 6; ++k) {
    std::vector<double> gradient(probe.parameters());
    probe.wave_gradient(k, gradient);
    analytic.push_back(dot(gradient, direction));
  }
  // The best of a sweep: truncation against rounding (numerics sheet, section 4).
  std::vector<double> best(6, 1.0);
  for (const double h : {1e-4, 3e-5, 1e-5, 3e-6}) {
    std::vector<double> ahead, behind;
    for (const double sign : {1.0, -1.0}) {
      for (std::size_t i = 0; i < start.size(); ++i) feature.data[i] = start[i] + sign * h * direction[i];
      probe.render("test", 1);
      (sign > 0 ? ahead : behind) = smooth_means(bench, probe);
    }
    for (std::size_t k = 0; k < 6; ++k) {
      const double numeric = (ahead[k] - behind[k]) / (2 * h);
      best[k] = std::min(best[k], std::abs(numeric - analytic[k]) / std::abs(numeric));
    }
  }
  for (std::size_t k = 0; k < 6; ++k) {
    CAPTURE(k);
    CAPTURE(analytic[k]);
    CHECK(best[k] < 1e-6);
    // The control: the gradient of another wave is not this one's.
    CHECK(std::abs(analytic[(k + 1) % 6] - analytic[k]) > 1e-3 * std::abs(analytic[k]));
  }
}

TEST_CASE("pipeline/wave_statistics: the gradient with random signs is the sum of the waves' own") {
  WaveBench bench;
  Probe probe = bench.probe();
  probe.render("test", 2);
  for (const std::size_t n : {0u, 1u}) {
    std::vector<double> sum(probe.parameters(), 0.0), one(probe.parameters()), together(probe.parameters());
    const Random random(bench.settings.seed, n, random_stage("decoder fit signs"));
    for (std::size_t k = 0; k < 6; ++k) {
      probe.wave_gradient(k, one);
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += random.uniform(k) < 0.5 ? -one[i] : one[i];
    }
    probe.signed_gradient(n, together);
    double worst = 0, largest = 0;
    for (std::size_t i = 0; i < sum.size(); ++i) {
      worst = std::max(worst, std::abs(sum[i] - together[i]));
      largest = std::max(largest, std::abs(sum[i]));
    }
    CHECK(largest > 0);
    CHECK(worst < 1e-12 * largest);
  }
}

TEST_CASE("pipeline/wave_statistics: the gradients of some anchors are rows of those of all") {
  WaveBench all, few([] {
    DecoderFitSettings settings = small_statistics();
    settings.anchors = 3;
    return settings;
  }());
  Probe of_all = all.probe(), of_few = few.probe();
  of_all.render("test", 0);
  of_few.render("test", 0);
  std::vector<double> whole(of_all.parameters()), part(of_few.parameters());
  of_all.wave_gradient(2, whole);
  of_few.wave_gradient(2, part);
  const std::size_t columns = whole.size() / 7;
  REQUIRE(part.size() == 3 * columns);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t c = 0; c < columns; ++c) CHECK(part[i * columns + c] == whole[i * 7 / 3 * columns + c]);
  }
}

TEST_CASE("pipeline/wave_statistics: reading a view leaves its render, and its gradients, as they are") {
  WaveBench bench;
  Probe probe = bench.probe();
  probe.render("test", 3);
  const std::vector<double> image(probe.image().data, probe.image().data + probe.image().size());
  std::vector<double> before(probe.parameters()), after(probe.parameters());
  probe.wave_gradient(0, before);
  static_cast<void>(probe.means());
  probe.wave_gradient(0, after);
  CHECK(before == after);
  CHECK(std::equal(image.begin(), image.end(), probe.image().data));
  // What is read are 8 bits: near the render's own means, and not they.
  const std::vector<double> exact = smooth_means(bench, probe), &read = probe.means();
  for (std::size_t k = 0; k < 6; ++k) {
    CHECK(read[k] == doctest::Approx(exact[k]).epsilon(0.2));
    CHECK(read[k] != exact[k]);
  }
}

TEST_CASE(
    "pipeline/wave_statistics: noise is the covariance of what is read, energy and agreement those of gradients") {
  WaveBench bench;
  Probe probe = bench.probe();
  const detail::WaveStatistics found = *detail::wave_statistics(probe, bench.settings, bench.executor);
  const std::size_t waves = 6, samples = 20;
  std::vector<std::vector<double>> read;
  std::vector<double> mean(waves, 0.0);
  for (std::size_t n = 0; n < samples; ++n) {
    probe.render("decoder fit", n, bench.settings.reach);
    read.emplace_back(probe.means().begin(), probe.means().end());
    for (std::size_t k = 0; k < waves; ++k) mean[k] += read.back()[k] / samples;
  }
  for (std::size_t k = 0; k < waves; ++k) {
    CHECK(found.mean[k] == doctest::Approx(mean[k]).epsilon(1e-12));
    for (std::size_t l = 0; l < waves; ++l) {
      double covariance = 0;
      for (const std::vector<double>& p : read) covariance += (p[k] - mean[k]) * (p[l] - mean[l]) / samples;
      CHECK(found.noise[k * waves + l] == doctest::Approx(covariance).epsilon(1e-9));
    }
  }

  const Random random(9, 0, random_stage("test quadratic"));
  double most = 0;
  for (std::size_t trial = 0; trial < 20; ++trial) {
    std::vector<double> w(waves);
    for (std::size_t k = 0; k < waves; ++k) w[k] = random.normal(trial * waves + k);
    const double energy = detail::quadratic(found.energy, w.data(), waves);
    const double agreement = detail::quadratic(found.agreement, w.data(), waves);
    CHECK(energy > 0);
    // |sum over u != v of g_u . g_v| is at most V (V - 1) of the mean square (Cauchy), and at least -V: views cannot all disagree.
    CHECK(agreement <= energy * (1 + 1e-9));
    CHECK(agreement >= -energy / 2 * (1 + 1e-9));  // 3 views: 1 / (V - 1)
    most = std::max(most, std::abs(agreement) / energy);
  }
  CHECK(most < 0.999);  // of views that differ: else agreement would be energy by another name
  CHECK(detail::trace(found.agreement, waves) < detail::trace(found.energy, waves));
}

TEST_CASE("pipeline/wave_statistics: every view is read edited too, and the noise is the weighted mean of both") {
  WaveBench bench;
  bench.settings.edits_per_view = 2;
  bench.settings.edit_weight = 0.3;
  bench.settings.edits.weight = {0, 1, 1, 0, 1, 1, 1, 0};  // there is no codec here
  Probe probe = bench.probe();
  const detail::WaveStatistics found = *detail::wave_statistics(probe, bench.settings, bench.executor);
  const std::size_t waves = 6, samples = 20, readings = 60;
  REQUIRE(found.deviation.size() == waves * readings);
  CHECK(found.per_view == 3);
  // The readings are those of the probe, in the order that is promised, less the clean ones' mean.
  probe.render("decoder fit", 3, bench.settings.reach);
  const std::vector<double> clean = probe.means(), edited = probe.edited_means(6, NoJpeg{});
  CHECK(clean != edited);
  for (std::size_t k = 0; k < waves; ++k) {
    CHECK(found.deviation[k * readings + 9] == doctest::Approx(clean[k] - found.mean[k]).epsilon(1e-12));
    CHECK(found.deviation[k * readings + 10] == doctest::Approx(edited[k] - found.mean[k]).epsilon(1e-12));
    double mean = 0;
    for (std::size_t n = 0; n < samples; ++n) mean += found.deviation[k * readings + 3 * n];
    CHECK(std::abs(mean) < 1e-12);
    for (std::size_t l = 0; l < waves; ++l) {
      double product = 0;
      for (std::size_t n = 0; n < readings; ++n) {
        product +=
            (n % 3 == 0 ? 0.7 / 20 : 0.3 / 40) * found.deviation[k * readings + n] * found.deviation[l * readings + n];
      }
      CHECK(found.noise[k * waves + l] == doctest::Approx(product).epsilon(1e-9));
    }
  }
  // An edit of nothing reads what is there: the stream of edits moves nothing else.
  AugmentationSettings nothing = no_augmentation();
  bench.settings.edits = nothing;
  Probe plain = bench.probe();
  plain.render("decoder fit", 3, bench.settings.reach);
  CHECK(plain.edited_means(6, NoJpeg{}) == clean);
}

TEST_CASE("pipeline/wave_statistics: where all views are one, what moves one moves the other") {
  // A single camera has no neighbour: its drawn views differ by roll and zoom alone.
  WaveBench one;
  one.views.count = 1;
  WaveBench ring;
  Probe narrow = one.probe(), wide = ring.probe();
  const detail::WaveStatistics same = *detail::wave_statistics(narrow, one.settings, one.executor);
  const detail::WaveStatistics differ = *detail::wave_statistics(wide, ring.settings, ring.executor);
  const double kept = detail::trace(same.agreement, 6) / detail::trace(same.energy, 6);
  const double lost = detail::trace(differ.agreement, 6) / detail::trace(differ.energy, 6);
  MESSAGE("agreement of one place ", kept, ", of a ring ", lost);
  CHECK(kept > lost);
}
