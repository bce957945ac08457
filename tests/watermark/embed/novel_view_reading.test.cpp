// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/embed/novel_view_reading.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/recipes/marked.hpp"
#include "compmark/splat/effect/background.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/pretrain/lattice_network.hpp"
#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;

struct SmoothOverColours : compmark::testing::SmallestSmoothRecipe {
  using Background = RandomBackground;
};
using MarkedSmooth = recipes::Marked<SmoothOverColours, LatticeDecoder<double>>;

/// A marked model whose residual is not zero, and everything a reading needs.
struct NovelViewReadingBench {
  static constexpr std::uint64_t seed = 3;
  static constexpr std::int64_t iteration = 2;
  static constexpr std::size_t view = 1;

  NovelViewReadingBench() : model(compmark::testing::random_model<MarkedSmooth>(7)) {
    LatticeSettings lattice;
    lattice.measure = LatticeMeasure::colour;
    lattice.bits = lattice.features = 4;
    lattice.sigma = {0.5};
    lattice.stride = 2;
    LatticeWeights<double> weights = random_lattice<double>(lattice, std::vector<double>{0.4}, 1, 1);
    for (std::size_t b = 0; b < 4; ++b) weights.head[b * 5] = 30;
    pipeline.template stage<MessageStage>().decoder = {lattice, std::move(weights)};
    pipeline.template stage<MessageStage>().message = {1, 0, 0, 1};
    const MatrixView<double> residual = values(model);
    const Random random(8, 0, random_stage("test residual"));
    for (std::size_t i = 0; i < residual.size(); ++i) residual.data[i] = 0.2 * random.normal(i);
  }
  static MatrixView<double> values(Model<MarkedSmooth>& of) {
    return of.arena.values(of.template blocks<EmbedderStage>().residual);
  }
  static MatrixView<double> gradients(Model<MarkedSmooth>& of) {
    return of.arena.gradients(of.template blocks<EmbedderStage>().residual);
  }
  static MarkPhases phases(double fidelity, double fall = 0) {
    MarkNumbers numbers = fidelity > 0 ? posthoc_mark() : mark_in_the_photographs();
    numbers.message.after = numbers.residual.after = numbers.message.ramp = 0;
    numbers.message.lambda = 1;
    numbers.message.novel_view_every = 1;
    numbers.posthoc.fidelity = fidelity;
    numbers.posthoc.fidelity_fall = fall;
    return {numbers, 100};
  }
  void clear() { std::fill(model.arena.all_gradients().begin(), model.arena.all_gradients().end(), 0.0); }
  double read(NovelViewReading<MarkedSmooth>& novel, double fidelity, double fall = 0) {
    const Pipeline<MarkedSmooth>::Phases photographed;
    const MarkPhases now = phases(fidelity, fall);
    static_cast<void>(fidelity > 0
                          ? novel.read_held(pipeline, model, views, view, seed, iteration, now, photographed, executor)
                          : novel.read(pipeline, model, views, view, seed, iteration, now, photographed, executor));
    return novel.report().total;
  }

  Model<MarkedSmooth> model;
  Pipeline<MarkedSmooth> pipeline;
  BlobViews views{.count = 6, .width = 24, .height = 20};
  ThreadExecutor executor{2};
};

}  // namespace

TEST_CASE("embed/novel_view_reading: its gradient is that of what it reports, held to the unmarked render and not") {
  for (const std::pair<double, double>& held : {std::pair(0.0, 0.0), std::pair(40.0, 0.0), std::pair(40.0, 2.0)}) {
    const double fall = 1;
    const double fidelity = held.first, power = held.second;
    CAPTURE(fidelity);
    CAPTURE(power);
    NovelViewReadingBench bench;
    if (power > 0) {
      auto& loss = bench.pipeline.stage<MessageStage>().message_loss.settings;
      loss.rule = MessageRule::hinge;
      loss.margin = 30;  // of logits up to 30, scaled by 10: some bits are right by it, some are not
      loss.power = power;
    }
    NovelViewReading<MarkedSmooth> novel;
    bench.clear();
    const double total = bench.read(novel, fidelity, fall);
    CHECK(std::isfinite(total));
    if (power > 0) {  // the power is felt: another costs something else
      NovelViewReadingBench linear;
      linear.pipeline.template stage<MessageStage>().message_loss.settings =
          bench.pipeline.stage<MessageStage>().message_loss.settings;
      linear.pipeline.template stage<MessageStage>().message_loss.settings.power = 1;
      NovelViewReading<MarkedSmooth> read_linear;
      CHECK(std::abs(linear.read(read_linear, fidelity, fall) - total) > 1e-3 * total);
    }
    const MatrixView<double> residual = NovelViewReadingBench::values(bench.model),
                             gradient = NovelViewReadingBench::gradients(bench.model);
    const std::vector<double> start(residual.data, residual.data + residual.size());
    const std::vector<double> found(gradient.data, gradient.data + gradient.size());
    const Random random(6, 0, random_stage("test direction"));
    double analytic = 0;
    for (std::size_t i = 0; i < start.size(); ++i) analytic += found[i] * random.normal(i);
    double best = 1;
    for (const double h : {1e-4, 3e-5, 1e-5, 3e-6}) {  // the best of a sweep
      double at[2] = {};
      for (const int side : {0, 1}) {
        for (std::size_t i = 0; i < start.size(); ++i)
          residual.data[i] = start[i] + (side == 0 ? h : -h) * random.normal(i);
        at[side] = bench.read(novel, fidelity, fall);
      }
      const double numeric = (at[0] - at[1]) / (2 * h);
      best = std::min(best, std::abs(numeric - analytic) / std::abs(numeric));
    }
    CHECK(std::abs(analytic) > 1e-6);
    CHECK(best < 1e-6);
  }
}

TEST_CASE("embed/novel_view_reading: it is held to the unmarked render as much as its camera is near the photographs") {
  NovelViewReadingBench bench;
  NovelViewReading<MarkedSmooth> novel;
  const double even = bench.read(novel, 40), distortion = novel.report().distortion;
  const double fallen = bench.read(novel, 40, 2);
  CHECK(novel.report().distortion == distortion);
  const auto camera_of = [&](std::size_t i) { return bench.views.camera(i); };
  const Random random(NovelViewReadingBench::seed, NovelViewReadingBench::iteration, random_stage("between"));
  const Camera<double> camera = novel_view_camera(camera_of, bench.views.size(), NovelViewReadingBench::view, random,
                                                  NovelViewReading<MarkedSmooth>::reach);
  const double medians = PhotographDistance(camera_of, bench.views.size()).medians(camera);
  const double share = 2 / (1 + medians * medians);
  CHECK(std::abs(share - 1) > 0.1);  // else the fall is not seen here
  CHECK(fallen - even == doctest::Approx(40 * (share - 1) * distortion).epsilon(1e-9));
  // Its ends: twice, as it is, and a twentieth where nobody looked; a fall of 0 is none.
  const MarkPhases phases = NovelViewReadingBench::phases(40, 2);
  CHECK(phases.fidelity(0) == 80);
  CHECK(phases.fidelity(1) == 40);
  CHECK(phases.fidelity(std::numeric_limits<double>::infinity()) == 2);
  CHECK(NovelViewReadingBench::phases(40, 0).fidelity(7) == 40);
}

TEST_CASE("embed/novel_view_reading: gradients are added to those that are there") {
  NovelViewReadingBench bench;
  NovelViewReading<MarkedSmooth> novel;
  bench.clear();
  bench.read(novel, 40);
  const std::vector<double> once(bench.model.arena.all_gradients().begin(), bench.model.arena.all_gradients().end());
  bench.read(novel, 40);
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < once.size(); ++i) {
    worst = std::max(worst, std::abs(bench.model.arena.all_gradients()[i] - 2 * once[i]));
    largest = std::max(largest, std::abs(once[i]));
  }
  CHECK(largest > 0);
  CHECK(worst < 1e-12 * largest);
}

TEST_CASE("embed/novel_view_reading: the unmarked render is that without the residual, to the bit") {
  NovelViewReadingBench bench;
  NovelViewReading<MarkedSmooth> novel;
  bench.clear();
  bench.read(novel, 40);
  const std::vector<double> unmarked(novel.unmarked().data, novel.unmarked().data + novel.unmarked().size());
  const std::vector<double> image(novel.image().data, novel.image().data + novel.image().size());
  CHECK(unmarked != image);
  double square = 0;
  for (std::size_t i = 0; i < unmarked.size(); ++i) square += (image[i] - unmarked[i]) * (image[i] - unmarked[i]);
  CHECK(novel.report().distortion == doctest::Approx(square / static_cast<double>(unmarked.size())).epsilon(1e-12));

  // Another reading, of the same model with its residual taken away: what is rendered there is the unmarked render.
  const MatrixView<double> residual = NovelViewReadingBench::values(bench.model);
  std::fill(residual.data, residual.data + residual.size(), 0.0);
  NovelViewReading<MarkedSmooth> plain;
  bench.read(plain, 40);
  CHECK(std::equal(unmarked.begin(), unmarked.end(), plain.image().data));
  CHECK(std::equal(unmarked.begin(), unmarked.end(), plain.unmarked().data));
  CHECK(plain.report().distortion == 0);
}

TEST_CASE("embed/novel_view_reading: the view is drawn anew in every iteration, and is not the training view") {
  NovelViewReadingBench bench;
  NovelViewReading<MarkedSmooth> one, two;
  const Pipeline<MarkedSmooth>::Phases photographed;
  static_cast<void>(one.read_held(bench.pipeline, bench.model, bench.views, NovelViewReadingBench::view,
                                  NovelViewReadingBench::seed, NovelViewReadingBench::iteration,
                                  NovelViewReadingBench::phases(40), photographed, bench.executor));
  static_cast<void>(two.read_held(bench.pipeline, bench.model, bench.views, NovelViewReadingBench::view,
                                  NovelViewReadingBench::seed, NovelViewReadingBench::iteration + 1,
                                  NovelViewReadingBench::phases(40), photographed, bench.executor));
  CHECK_FALSE(std::equal(one.unmarked().data, one.unmarked().data + one.unmarked().size(), two.unmarked().data));
  Pipeline<MarkedSmooth>::Context context;
  static_cast<void>(bench.pipeline.forward(bench.model, bench.views.camera(NovelViewReadingBench::view),
                                           NovelViewReadingBench::view, context, bench.executor));
  CHECK_FALSE(std::equal(one.image().data, one.image().data + one.image().size(), context.image.data));
}

TEST_CASE("embed/novel_view_reading: what belongs to the photograph of the iteration is not in a view without one") {
  NovelViewReadingBench bench;
  Pipeline<MarkedSmooth>::Phases plain, coloured;
  coloured.of<BackgroundStage>() = {{0.9, 0.1, 0.6}, true};
  NovelViewReading<MarkedSmooth> one, two;
  const auto read = [&](NovelViewReading<MarkedSmooth>& reading, const Pipeline<MarkedSmooth>::Phases& phases) {
    static_cast<void>(reading.read_held(bench.pipeline, bench.model, bench.views, NovelViewReadingBench::view,
                                        NovelViewReadingBench::seed, NovelViewReadingBench::iteration,
                                        NovelViewReadingBench::phases(40), phases, bench.executor));
    return std::vector<double>(reading.image().data, reading.image().data + reading.image().size());
  };
  CHECK(read(one, plain) == read(two, coloured));
  CHECK(one.report().distortion == two.report().distortion);

  // Negative control: the photographed view of the iteration does have that colour behind it.
  const auto render = [&](const Pipeline<MarkedSmooth>::Phases& phases) {
    Pipeline<MarkedSmooth>::Context context;
    static_cast<void>(bench.pipeline.forward(bench.model, bench.views.camera(0), 0, context, bench.executor, phases));
    return std::vector<double>(context.image.data, context.image.data + context.image.size());
  };
  CHECK(render(plain) != render(coloured));
}
