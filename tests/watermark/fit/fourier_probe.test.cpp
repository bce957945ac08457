// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/fit/fourier_probe.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "compmark/watermark/fit/decoder_fit.hpp"
#include "fourier_bench.hpp"
#include "support/full_rasterizer.hpp"

namespace {

using namespace compmark;
using compmark::testing::FourierBench;
using compmark::testing::small_statistics;
using Probe = compmark::testing::FourierBenchProbe;

/// Of the cameras of the ring and between them, those on one side show more than there is memory for.
constexpr bool of_the_left(const Camera<double>& camera) { return camera.center_world[0] < 0; }
struct ProbedFull : compmark::testing::SmallestSmoothRecipe {
  using Rasterizer =
      compmark::testing::FullRasterizer<compmark::testing::SmallestSmoothRecipe::Rasterizer, of_the_left>;
};

/// Means of the features in the probe's view, of the render itself and not of its 8 bits: what the gradients are of.
std::vector<double> smooth_means(FourierBench& bench, const Probe& probe) {
  const LatticeDecoder<double> decoder(bench.lattice, bench.weights);
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

TEST_CASE("fit/fourier_probe: a feature's gradient is that of its mean") {
  FourierBench bench;
  Probe probe = bench.probe();
  REQUIRE(probe.render("test", 1).ok());
  const MatrixView<double> feature = bench.unmarked.arena.values(bench.unmarked.anchors.feature);
  REQUIRE(probe.parameters() == feature.size());
  const Random random(5, 0, random_stage("test direction"));
  std::vector<double> direction(feature.size()), start(feature.data, feature.data + feature.size());
  for (std::size_t i = 0; i < direction.size(); ++i) direction[i] = random.normal(i);
  std::vector<double> analytic;
  for (std::size_t k = 0; k < 6; ++k) {
    std::vector<double> gradient(probe.parameters());
    probe.feature_gradient(k, gradient);
    analytic.push_back(dot(gradient, direction));
  }
  // The best of a sweep: truncation against rounding.
  std::vector<double> best(6, 1.0);
  for (const double h : {1e-4, 3e-5, 1e-5, 3e-6}) {
    std::vector<double> ahead, behind;
    for (const double sign : {1.0, -1.0}) {
      for (std::size_t i = 0; i < start.size(); ++i) feature.data[i] = start[i] + sign * h * direction[i];
      REQUIRE(probe.render("test", 1).ok());
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
    // The control: the gradient of another feature is not this one's.
    CHECK(std::abs(analytic[(k + 1) % 6] - analytic[k]) > 1e-3 * std::abs(analytic[k]));
  }
}

TEST_CASE("fit/fourier_probe: the gradient with random signs is the sum of the features' own") {
  FourierBench bench;
  Probe probe = bench.probe();
  REQUIRE(probe.render("test", 2).ok());
  for (const std::size_t n : {0u, 1u}) {
    std::vector<double> sum(probe.parameters(), 0.0), one(probe.parameters()), together(probe.parameters());
    const Random random(bench.settings.seed, n, random_stage("decoder fit signs"));
    for (std::size_t k = 0; k < 6; ++k) {
      probe.feature_gradient(k, one);
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

TEST_CASE("fit/fourier_probe: the gradients of some anchors are rows of those of all") {
  FourierBench all, few([] {
    DecoderFitSettings settings = small_statistics();
    settings.anchors = 3;
    return settings;
  }());
  Probe of_all = all.probe(), of_few = few.probe();
  REQUIRE(of_all.render("test", 0).ok());
  REQUIRE(of_few.render("test", 0).ok());
  std::vector<double> whole(of_all.parameters()), part(of_few.parameters());
  of_all.feature_gradient(2, whole);
  of_few.feature_gradient(2, part);
  const std::size_t columns = whole.size() / 7;
  REQUIRE(part.size() == 3 * columns);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t c = 0; c < columns; ++c) CHECK(part[i * columns + c] == whole[i * 7 / 3 * columns + c]);
  }
}

TEST_CASE("fit/fourier_probe: reading a view leaves its render, and its gradients, as they are") {
  FourierBench bench;
  Probe probe = bench.probe();
  REQUIRE(probe.render("test", 3).ok());
  const std::vector<double> image(probe.image().data, probe.image().data + probe.image().size());
  std::vector<double> before(probe.parameters()), after(probe.parameters());
  probe.feature_gradient(0, before);
  static_cast<void>(probe.means());
  probe.feature_gradient(0, after);
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
    "fit/fourier_probe: a view of the statistics is read in a light of its own, and its gradients in the model's own") {
  FourierBench plain, lit([] {
    DecoderFitSettings settings = small_statistics();
    settings.tone = 0.05;
    return settings;
  }());
  Probe of_plain = plain.probe(), of_lit = lit.probe();
  REQUIRE(of_plain.render("decoder fit", 4, plain.settings.reach).ok());
  const std::vector<double> own = of_plain.means();
  REQUIRE(of_plain.render_statistics_view(4).ok());
  CHECK(of_plain.means() == own);  // no tone: the model's light
  REQUIRE(of_lit.render_statistics_view(4).ok());
  const std::vector<double> means = of_lit.means();
  CHECK(means != own);
  // By hand: the render in the tone of that number, in 8 bits.
  const ImageView<const double> render = of_lit.image();
  CHECK(std::equal(render.data, render.data + render.size(), of_plain.image().data));
  std::vector<double> toned(render.size());
  const Random random(lit.settings.seed, 4, random_stage("decoder fit tone"));
  const ImageView<double> image{toned.data(), 3, render.height, render.width};
  apply_tone<double>(drawn_tone<double>(0.05, random), render, image);
  for (double& value : toned) value = std::round(value * 255) / 255;
  LatticeDecoder<double>::Context reading;
  LatticeDecoder<double>(lit.lattice, lit.weights).pool(image, reading, lit.executor);
  for (std::size_t k = 0; k < 6; ++k) CHECK(means[k] == doctest::Approx(reading.pooled[k]).epsilon(1e-12));
  // The gradients are of the render, which is what a mark is hidden in.
  std::vector<double> there(of_lit.parameters()), here(of_plain.parameters());
  of_lit.feature_gradient(1, there);
  of_plain.feature_gradient(1, here);
  CHECK(there == here);
  // Another number has another light; a view that is no statistics view has the model's again.
  REQUIRE(of_lit.render("decoder fit", 4, lit.settings.reach).ok());
  CHECK(of_lit.means() == own);
}

TEST_CASE("fit/fourier_probe: there are as many regions as the smallest view has room for") {
  struct TwoSizes {
    [[nodiscard]] std::size_t size() const { return 2; }
    [[nodiscard]] Camera<double> camera(std::size_t i) const {
      return {.width = i == 0 ? 400 : 200, .height = i == 0 ? 300 : 150};
    }
  };
  DecoderFitSettings settings;
  CHECK(detail::region_count(TwoSizes{}, settings) == 6);  // 200 x 150 of 5,000
  settings.stride = 2;
  CHECK(detail::region_count(TwoSizes{}, settings) == 1);
  settings.stride = 1;
  settings.region_positions = 1000;
  CHECK(detail::region_count(TwoSizes{}, settings) == settings.regions);
  // One region is no limit, and asks for no views.
  settings.regions = 1;
  CHECK(detail::limit_views(settings) == 0);
  settings.regions = 24;
  CHECK(detail::limit_views(settings) == 256);
  settings.statistics_views = 100;
  CHECK(detail::limit_views(settings) == 100);
  settings.region_limit = 0;
  CHECK(detail::limit_views(settings) == 0);
}

TEST_CASE("fit/fourier_probe: the loudest region of a view is what a decoder says of it there") {
  FourierBench bench;
  bench.settings.regions = 6;
  bench.settings.limit_views = 9;
  const Random random(3, 0, random_stage("test head"));
  bench.weights.head.resize(24);
  bench.weights.bias.resize(4);
  for (std::size_t i = 0; i < 24; ++i) bench.weights.head[i] = random.normal(i);
  for (std::size_t b = 0; b < 4; ++b) bench.weights.bias[b] = random.normal(24 + b);
  Probe probe = bench.probe();
  LatticeSettings shape = bench.lattice;
  shape.regions = 6;
  const std::vector<double> found = *probe.loudest_regions(shape, bench.weights, NoFitObserver{});
  REQUIRE(found.size() == 9);
  CHECK(std::is_sorted(found.begin(), found.end()));
  // By hand: a region's features through the head, of the render's 8 bits, over all gates.
  shape.region_limit = 1e9;
  const LatticeDecoder<double> decoder(shape, bench.weights);
  std::vector<double> expected;
  for (std::size_t n = 0; n < 9; ++n) {
    REQUIRE(probe.render("decoder fit", n, bench.settings.reach).ok());
    std::vector<double> rounded(probe.image().data, probe.image().data + probe.image().size());
    for (double& value : rounded) value = std::round(std::clamp(value, 0.0, 1.0) * 255) / 255;
    LatticeDecoder<double>::Context reading;
    decoder.pool({rounded.data(), 3, probe.image().height, probe.image().width}, reading, bench.executor);
    double loudest = 0;
    for (std::size_t r = 0; r < reading.positions.regions; ++r) {
      double square = 0;
      for (std::size_t b = 0; b < bench.weights.bias.size(); ++b) {
        double says = bench.weights.bias[b] * reading.region_gate[r];
        for (std::size_t k = 0; k < 6; ++k) says += bench.weights.head[b * 6 + k] * reading.region_sum[r * 6 + k];
        square += says * says;
      }
      loudest = std::max(loudest, std::sqrt(square) / reading.all_gates);
    }
    expected.push_back(loudest);
  }
  CHECK(expected.front() != expected.back());
  std::sort(expected.begin(), expected.end());
  for (std::size_t n = 0; n < 9; ++n) CHECK(found[n] == doctest::Approx(expected[n]).epsilon(1e-12));
}

TEST_CASE("fit/fourier_probe: a view that could not be drawn is an error of the probe, the statistics and the fit") {
  struct Bench {
    DecoderFitSettings settings = small_statistics();
    LatticeSettings lattice = FourierBench().lattice;
    LatticeWeights<double> weights = FourierBench().weights;
    testing::BlobViews views{.count = 6, .width = 24, .height = 20};
    ThreadExecutor executor{2};
  };
  Bench bench;
  Model<ProbedFull> model = testing::random_model<ProbedFull>(7);
  detail::FourierProbe<ProbedFull, testing::BlobViews, ThreadExecutor> probe(
      model, bench.views, bench.lattice, bench.weights, bench.settings, bench.executor);
  std::vector<bool> drawn;
  for (std::size_t n = 0; n < 12; ++n) {
    const Result<Done> rendered = probe.render("test", n);
    CHECK(rendered.ok() == !of_the_left(probe.camera()));
    drawn.push_back(rendered.ok());
    if (!rendered) CHECK(rendered.error().field == "raster.pair_budget");
  }
  CHECK(std::count(drawn.begin(), drawn.end(), true) > 0);
  CHECK(std::count(drawn.begin(), drawn.end(), false) > 0);
  const auto field_of = [](const auto& result) {
    REQUIRE_FALSE(result.ok());
    return result.error().field;
  };
  CHECK(field_of(detail::fourier_statistics(probe, bench.settings, bench.executor)) == "raster.pair_budget");
  LatticeSettings limited = bench.lattice;
  limited.regions = 6;
  bench.weights.head.resize(24);
  bench.weights.bias.resize(4);
  CHECK(field_of(probe.loudest_regions(limited, bench.weights, NoFitObserver{})) == "raster.pair_budget");
  bench.settings.coordinates = 0;
  CHECK(field_of(fit_decoder(model, bench.views, bench.settings, bench.executor)) == "raster.pair_budget");
  // The control: the same where each view is drawn.
  Model<compmark::testing::SmallestSmoothRecipe> same = testing::random_model<testing::SmallestSmoothRecipe>(7);
  CHECK(fit_decoder(same, bench.views, bench.settings, bench.executor).ok());
}
