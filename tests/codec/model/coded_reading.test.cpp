// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Readings of a model for a codec in post-hoc embedding: what is read is rounded as the file is, what it is held to is the unmarked model before rounding.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/splat/export/bake.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <compmark/watermark/embed/novel_view_reading.hpp>
#include <compmark/watermark/pretrain/lattice_network.hpp>
#include <vector>

#include "support/coded_training.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;

using MarkedSmallHac = recipes::Marked<testing::SmallHac, LatticeDecoder<float>>;

/// A model trained for the codec, with a residual, and a decoder of four bits.
struct CodedReadingBench {
  static constexpr std::uint64_t seed = 3;
  static constexpr std::int64_t iteration = 2;
  static constexpr std::size_t view = 1;

  explicit CodedReadingBench(double lambda = 0.001)
      : model(with_room_for_stages<MarkedSmallHac>(testing::train_coded<testing::SmallHac>(2).model, 1)) {
    LatticeSettings lattice;
    lattice.measure = LatticeMeasure::colour;
    lattice.bits = lattice.features = 4;
    lattice.sigma = {0.5};
    lattice.stride = 2;
    pipeline.template stage<MessageStage>().decoder = {lattice,
                                                       random_lattice<float>(lattice, std::vector<double>{0.4}, 1, 1)};
    pipeline.template stage<MessageStage>().message = {1, 0, 0, 1};
    const Random random(8, 0, random_stage("test residual"));
    const MatrixView<float> residual = model.arena.values(model.template blocks<EmbedderStage>().residual);
    for (std::size_t i = 0; i < residual.size(); ++i) residual.data[i] = 0.3f * static_cast<float>(random.normal(i));
    RateNumbers numbers = testing::short_settings(90).rate;
    numbers.lambda = lambda;
    pipeline.stage<RateStage>() = RateStage(entropy_model<MarkedSmallHac>(numbers));
    rounded.context = rounded.round = true;
    rounded.seed = seed;
  }
  static MarkPhases phases() {
    MarkNumbers numbers = posthoc_mark();
    numbers.message.after = numbers.residual.after = numbers.message.ramp = 0;
    numbers.message.lambda = 1;
    numbers.message.novel_view_every = 1;
    numbers.posthoc.fidelity = 40;
    return {numbers, 100};
  }
  void read(NovelViewReading<MarkedSmallHac>& novel) {
    Pipeline<MarkedSmallHac>::Phases photographed;
    photographed.of<RateStage>() = rounded;
    std::fill(model.arena.all_gradients().begin(), model.arena.all_gradients().end(), 0.0f);
    static_cast<void>(novel.read_held(pipeline, model, views, view, seed, iteration, phases(), photographed, executor));
  }
  /// The render of the same camera.
  std::vector<float> render(bool marked, const RatePhase& phase) {
    const Random random(seed, static_cast<std::uint64_t>(iteration), random_stage("between"));
    const auto cameras = [&](std::size_t i) -> Camera<double> { return views.camera(i); };
    Pipeline<MarkedSmallHac>::Context context;
    Pipeline<MarkedSmallHac>::Phases plain;
    plain.of<EmbedderStage>().embeds = marked;
    plain.of<RateStage>() = phase;
    static_cast<void>(pipeline.forward(
        model, novel_view_camera(cameras, views.size(), view, random, NovelViewReading<MarkedSmallHac>::reach), view,
        context, executor, plain));
    return {context.image.data, context.image.data + context.image.size()};
  }
  [[nodiscard]] double residual_gradient() const {
    double sum = 0;
    for (const float d : std::as_const(model).arena.gradients(model.template blocks<EmbedderStage>().residual).flat())
      sum += std::abs(static_cast<double>(d));
    return sum;
  }

  Model<MarkedSmallHac> model;
  Pipeline<MarkedSmallHac> pipeline;
  BlobViews views{.count = 6, .width = 24, .height = 20};
  ThreadExecutor executor{2};
  RatePhase rounded;
};

}  // namespace

TEST_CASE("model/coded_reading: the marked render is rounded, the unmarked one that it is held to is not, to the bit") {
  CodedReadingBench bench;
  NovelViewReading<MarkedSmallHac> novel;
  bench.read(novel);
  const std::vector<float> unmarked(novel.unmarked().data, novel.unmarked().data + novel.unmarked().size());
  const std::vector<float> image(novel.image().data, novel.image().data + novel.image().size());
  RatePhase silent = bench.rounded;
  silent.counts = false;
  CHECK(image == bench.render(true, silent));
  CHECK(unmarked == bench.render(false, {}));
  CHECK(unmarked != bench.render(false, silent));  // negative control: rounding shows
}

TEST_CASE("model/coded_reading: the rate does not count: what is learned is the message alone") {
  const auto gradient = [](double lambda) {
    CodedReadingBench bench(lambda);
    NovelViewReading<MarkedSmallHac> novel;
    bench.read(novel);
    return bench.residual_gradient();
  };
  const double message = gradient(0);
  CHECK(message > 0);
  CHECK(gradient(0.5) == message);
}
