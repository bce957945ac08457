// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Frequency-aware growing in a whole training: in its window and nowhere else, the same bits however it is run and stopped.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <vector>

#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/pretrain/lattice_network.hpp"
#include "support/coded_training.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::SmallContextGs;
using compmark::testing::SmallHac;

using Decoder = LatticeDecoder<float>;
static_assert(Recipe<recipes::MarkedHac<Decoder>> && Recipe<recipes::MarkedContextGs<Decoder>>);
static_assert(grows_by_frequency<recipes::MarkedHac<Decoder>::DensityControl>);
static_assert(!grows_by_frequency<recipes::Scaffold::DensityControl>);

using Base = compmark::testing::SmallRecipe;
/// The loss alone, and with the growing that looks at it.
struct WithFrequencyLoss : Base {
  using FrequencyLoss = compmark::FrequencyLoss<float>;
};
struct Growing : WithFrequencyLoss {
  using DensityControl = FrequencyGrowth<float>;
};

constexpr std::int64_t growing_iterations = 120;

TrainSettings growing_settings() {
  TrainSettings s = *profile_settings("scaffold");
  s.iterations = growing_iterations;
  s.voxel_size = 0.05;
  s.statistics_after = 1000;  // of 30,000: the statistics begin with iteration 5
  s.grow_after = 1500;
  s.grow_until = 25000;
  s.grow_interval = 5;
  s.mark.frequency.after = 2000;
  s.mark.frequency.grow_from = 10000;   // iteration 40 …
  s.mark.frequency.grow_until = 17500;  // … to 69
  return s;
}

/// A training up to an iteration, or all of it; stopped after `stop` and read back if that is above 0.
template <class R>
Model<R> train(const TrainSettings& s, std::size_t threads = 2, std::int64_t until = growing_iterations,
               std::int64_t stop = 0) {
  Model<R> model;
  testing::train_until<R>(s, threads, until, stop, [&](const auto& trainer) { model = trainer.model(); });
  return model;
}

}  // namespace

TEST_CASE("training/frequency_growing: it is the other growing until its window begins, and another one in it") {
  const TrainSettings s = growing_settings();
  CHECK(testing::same_bits(train<WithFrequencyLoss>(s, 2, 39), train<Growing>(s, 2, 39)));
  const Model<WithFrequencyLoss> plain = train<WithFrequencyLoss>(s);
  const Model<Growing> growing = train<Growing>(s);
  MESSAGE(plain.anchor_count(), " anchors, frequency-aware ", growing.anchor_count());
  CHECK(growing.anchor_count() != plain.anchor_count());

  // In the window it chooses among the visible Gaussians; the band decides which.
  BlobViews views;
  ThreadExecutor executor(2);
  Trainer<Growing, ThreadExecutor> trainer(s, views.size(), 1.0, executor);
  REQUIRE(trainer.initialise(testing::cloud(300, 7)));
  const auto go = [&](std::int64_t last) {
    while (trainer.state().iteration < last) REQUIRE(trainer.step(views));
    return trainer.state().growth.last;
  };
  CHECK(go(39).visible == 0);
  const FrequencySelection inside = go(41);
  CHECK(inside.visible > 0);
  CHECK(inside.selected < inside.visible);
  CHECK(inside.coverage > 0);
  TrainSettings wide = s;
  wide.mark.frequency.band_lowest = -2;  // an error lies in 0 to 2
  wide.mark.frequency.band_highest = 2;
  Trainer<Growing, ThreadExecutor> other(wide, views.size(), 1.0, executor);
  REQUIRE(other.initialise(testing::cloud(300, 7)));
  while (other.state().iteration < 41) REQUIRE(other.step(views));
  const FrequencySelection all = other.state().growth.last;
  CHECK(all.coverage == 1);
  CHECK(all.selected > inside.selected);
  CHECK(2 * all.selected > all.visible);  // but for those whose mean is beyond the image

  // Without a loss there is nothing to look at, and without a window no time to: the other growing, to the bit.
  TrainSettings silent = s;
  silent.mark.frequency.lambda = 0;
  CHECK(testing::same_bits(train<WithFrequencyLoss>(silent), train<Growing>(silent)));
  TrainSettings never = s;
  never.mark.frequency.grow_until = never.mark.frequency.grow_from;
  CHECK(testing::same_bits(plain, train<Growing>(never)));
}

TEST_CASE(
    "training/frequency_growing: the same bits at any thread count, and after a stop before, in and after the window") {
  const TrainSettings s = growing_settings();
  const Model<Growing> once = train<Growing>(s, 1);
  CHECK(testing::same_bits(once, train<Growing>(s, 4)));
  for (const std::int64_t stop : {30, 52, 90}) {
    CAPTURE(stop);
    CHECK(testing::same_bits(once, train<Growing>(s, 2, growing_iterations, stop)));
  }
}

TEST_CASE("training/frequency_growing: a run with another window is not resumed") {
  const TrainSettings s = growing_settings();
  BlobViews views;
  ThreadExecutor executor(2);
  Trainer<Growing, ThreadExecutor> trainer(s, views.size(), 1.0, executor);
  REQUIRE(trainer.initialise(testing::cloud(300, 7)));
  REQUIRE(trainer.step(views));
  const testing::ScratchFolder folder("compmark-frequency-window-test");
  const std::filesystem::path path = folder.path / "checkpoint.safetensors";
  REQUIRE(write_checkpoint(path, trainer.state(), s, ModelInfo{}, 1.0));
  for (const auto& change : std::initializer_list<std::function<void(MarkNumbers&)>>{
           [](MarkNumbers& m) { m.frequency.grow_until = 15000; },
           [](MarkNumbers& m) { m.frequency.band_lowest = -0.3; }}) {
    TrainSettings other = s;
    change(other.mark);
    CHECK_FALSE((read_checkpoint<Trainer<Growing, ThreadExecutor>>(path, other, ModelInfo{}).ok()));
  }
}

TEST_CASE_TEMPLATE("training/frequency_growing: the whole method inside the codecs trains through its window", R,
                   recipes::MarkedHac<Decoder, SmallHac>, recipes::MarkedContextGs<Decoder, SmallContextGs>) {
  TrainSettings s = testing::short_settings(60);
  s.statistics_after = 1000;
  s.grow_after = 1500;
  s.grow_until = 25000;
  s.pause_from = s.pause_until = 0;
  s.grow_interval = 5;
  s.mark = mark_in_the_photographs();
  s.mark.message.after = s.mark.residual.after = 0;
  BlobViews views;
  ThreadExecutor executor(2);
  Trainer<R, ThreadExecutor> trainer(s, views.size(), 1.0, executor);
  LatticeSettings lattice;
  lattice.measure = LatticeMeasure::colour;
  lattice.bits = lattice.features = 4;
  lattice.sigma = {0.5};
  lattice.stride = 2;
  const std::vector<std::uint8_t> message{1, 0, 0, 1};
  set_watermark(trainer, {lattice, random_lattice<float>(lattice, std::vector<double>{0.4}, 1, 1)}, message);
  REQUIRE(trainer.initialise(testing::cloud(300, 7)));
  std::size_t adjusted = 0, selected = 0;
  while (!trainer.finished()) {
    const Result<IterationReport> report = trainer.step(views);
    REQUIRE(report);
    adjusted += report->adjusted ? 1 : 0;
    selected = std::max(selected, trainer.state().growth.last.selected);
    CHECK(report->skipped_blocks == 0);
  }
  CHECK(adjusted > 3);
  CHECK(selected > 0);
  CHECK(trainer.context().template of<RateStage>().report.sampled > 0);
  double size = 0;
  const Model<R>& model = trainer.model();
  for (const float f : model.arena.values(model.template blocks<EmbedderStage>().residual).flat())
    size += std::abs(static_cast<double>(f));
  CHECK(size > 0);
}
