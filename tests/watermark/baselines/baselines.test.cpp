// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The baselines as recipes: what they change and what they leave alone, their gradients, and small embeddings.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/baselines/gaussianmarker.hpp>
#include <compmark/watermark/baselines/guardsplat.hpp>
#include <compmark/watermark/baselines/threedgsw.hpp>
#include <compmark/watermark/baselines/unmarked_views.hpp>
#include <compmark/watermark/baselines/waterf.hpp>
#include <compmark/watermark/embed/base_model.hpp>
#include <compmark/watermark/embed/mark_report.hpp>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "support/colour_decoder.hpp"
#include "support/directional.hpp"
#include "support/short_embedding.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using HostRecipe = compmark::testing::SmallRecipe;
using GuardSplatted = recipes::GuardSplat<HostRecipe, LatticeDecoder<float>>;
using GaussianMarked = recipes::GaussianMarker<HostRecipe, LatticeDecoder<float>>;
using Waterfed = recipes::Waterf<HostRecipe, WaveletDecoder<LatticeDecoder<float>>>;
using ThreeDGswed = recipes::ThreeDGsw<HostRecipe, WaveletDecoder<LatticeDecoder<float>>>;

/// The mean over the bits and views of how far a model's renders lean towards the message: positive is right.
template <class Decoder>
double lean_of(const Model<HostRecipe>& model, const BlobViews& views, const Decoder& decoder,
               ThreadExecutor& executor) {
  const Pipeline<HostRecipe> pipeline;
  Pipeline<HostRecipe>::Context context;
  typename Decoder::Context reading;
  double sum = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    static_cast<void>(pipeline.forward(model, views.camera(i), i, context, executor));
    std::vector<float> logits(compmark::testing::eight_bits.size());
    decoder.forward(ImageView<const float>(context.image), logits, reading, executor);
    for (std::size_t b = 0; b < logits.size(); ++b)
      sum += (compmark::testing::eight_bits[b] != 0 ? 1 : -1) * static_cast<double>(logits[b]);
  }
  return sum / static_cast<double>(views.size() * compmark::testing::eight_bits.size());
}

/// Names of the blocks of two models of one shape whose values differ in a bit.
std::vector<std::string> changed_blocks(const Model<HostRecipe>& a, const Model<HostRecipe>& b) {
  std::vector<std::string> names;
  for (const ArenaLayout::Block& block : a.arena.layout().blocks()) {
    const auto one = a.arena.all_values().begin() + static_cast<std::ptrdiff_t>(block.offset);
    const auto other = b.arena.all_values().begin() + static_cast<std::ptrdiff_t>(block.offset);
    if (!std::equal(one, one + static_cast<std::ptrdiff_t>(block.size()), other)) names.emplace_back(block.name);
  }
  return names;
}

TrainSettings small_numbers(MarkNumbers mark, std::int64_t iterations) {
  TrainSettings settings;
  settings.iterations = iterations;
  settings.seed = 4;
  settings.mark = mark;
  settings.mark.message.logit_scale = 1;
  return settings;
}

Model<GuardSplatted> guard_splatted(const Model<HostRecipe>& host, const BlobViews& views, std::int64_t iterations,
                                    ThreadExecutor& executor) {
  TrainSettings settings = guardsplat_settings(small_numbers(guardsplat_mark(), iterations));
  settings.mark.message.lambda = 3;  // 40 x 48 pixels and 120 iterations
  Trainer<GuardSplatted, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
  set_watermark(trainer, compmark::testing::colours(), compmark::testing::eight_bits);
  trainer.start_from(with_room_for_stages<GuardSplatted>(host, 1));
  UnmarkedViews<HostRecipe, BlobViews, ThreadExecutor> unmarked(host, views, executor);
  REQUIRE(trainer.run(unmarked));
  return trainer.model();
}

}  // namespace

TEST_CASE("baselines/guardsplat: the offsets alone change, and the bits lean the right way") {
  const BlobViews views;
  ThreadExecutor two(2), one(1);
  const auto host = compmark::testing::briefly_trained<HostRecipe>(views, two);
  REQUIRE(host.ok());
  const Model<GuardSplatted> marked = guard_splatted(*host, views, 120, two);
  // Before the offsets are baked every attribute and every network is the host's, to the bit.
  CHECK(changed_blocks(base_model(marked), *host).empty());
  const auto offset = marked.arena.values(marked.blocks<EmbedderStage>().residual);
  CHECK(std::any_of(offset.flat().begin(), offset.flat().end(), [](float value) { return value != 0; }));
  // Baked they are in the features, and in nothing else.
  const Model<HostRecipe> baked = baked_model(marked);
  CHECK(changed_blocks(baked, *host) == std::vector<std::string>{"anchor.feature"});
  // The control: a planted change of one number of a frozen attribute is seen.
  Model<HostRecipe> planted = baked;
  planted.arena.values(planted.anchors.scaling).data[3] += 1e-6f;
  const std::vector<std::string> seen = changed_blocks(planted, *host);
  CHECK(seen.size() == 2);
  CHECK(std::count(seen.begin(), seen.end(), "anchor.scaling") == 1);

  const auto decoder = compmark::testing::colours();
  const double before = lean_of(*host, views, decoder, two), after = lean_of(baked, views, decoder, two);
  CAPTURE(before);
  CAPTURE(after);
  CHECK(after > before + 0.05);
  CHECK(after > 0);

  CHECK(compmark::testing::same_values(marked, guard_splatted(*host, views, 120, one)));
  CHECK(!compmark::testing::same_values(marked, guard_splatted(*host, views, 60, one)));
}

TEST_CASE("baselines/guardsplat: without a message the unmarked renders hold the offsets at zero") {
  const BlobViews views;
  ThreadExecutor executor(2);
  const auto host = compmark::testing::briefly_trained<HostRecipe>(views, executor);
  REQUIRE(host.ok());
  TrainSettings settings = guardsplat_settings(small_numbers(guardsplat_mark(), 20));
  settings.mark.message.lambda = 0;
  const auto offsets_on = [&](auto& targets) {
    Trainer<GuardSplatted, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    set_watermark(trainer, compmark::testing::colours(), compmark::testing::eight_bits);
    trainer.start_from(with_room_for_stages<GuardSplatted>(*host, 1));
    REQUIRE(trainer.run(targets));
    const auto table = trainer.model().arena.values(trainer.model().template blocks<EmbedderStage>().residual);
    return static_cast<std::size_t>(
        std::count_if(table.flat().begin(), table.flat().end(), [](float value) { return value != 0; }));
  };
  UnmarkedViews<HostRecipe, BlobViews, ThreadExecutor> unmarked(*host, views, executor);
  CHECK(offsets_on(unmarked) == 0);
  const BlobViews photographs;  // the control: photographs are not what the model shows
  CHECK(offsets_on(photographs) > 0);
}

TEST_CASE("baselines/waterf: everything trains but the places of the anchors, and the bits lean the right way") {
  const BlobViews views;
  ThreadExecutor two(2), one(1);
  const auto host = compmark::testing::briefly_trained<HostRecipe>(views, two);
  REQUIRE(host.ok());
  const auto embedded = [&](std::int64_t iterations, ThreadExecutor& executor) {
    TrainSettings settings = waterf_settings(small_numbers(waterf_mark(), iterations));
    Trainer<Waterfed, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    set_watermark(trainer, WaveletDecoder<LatticeDecoder<float>>(compmark::testing::colours()),
                  compmark::testing::eight_bits);
    trainer.start_from(with_room_for_stages<Waterfed>(*host, 1));
    REQUIRE(trainer.run(views));
    CHECK(trainer.model().anchor_count() == host->anchor_count());
    return baked_model(trainer.model());
  };
  const Model<HostRecipe> marked = embedded(60, two);
  const std::vector<std::string> changed = changed_blocks(marked, *host);
  for (const ArenaLayout::Block& block : host->arena.layout().blocks()) {
    const bool here = std::find(changed.begin(), changed.end(), block.name) != changed.end();
    CAPTURE(std::string(block.name));
    CHECK(here == (block.name != "anchor.position"));
  }
  const WaveletDecoder<LatticeDecoder<float>> reading(compmark::testing::colours());
  const double before = lean_of(*host, views, reading, two), after = lean_of(marked, views, reading, two);
  CAPTURE(before);
  CAPTURE(after);
  CHECK(after > before + 0.05);
  CHECK(after > 0);
  CHECK(compmark::testing::same_values(marked, embedded(60, one)));
}

TEST_CASE("baselines/gaussianmarker: copies of half of the anchors train, and all else keeps its bits") {
  const BlobViews views;
  ThreadExecutor two(2), one(1);
  const auto host = compmark::testing::briefly_trained<HostRecipe>(views, two);
  REQUIRE(host.ok());
  const auto embedded = [&](ThreadExecutor& executor) {
    TrainSettings settings = gaussianmarker_settings(small_numbers(gaussianmarker_mark(), 120));
    settings.mark.message.lambda = 30;  // 40 x 48 pixels and 120 iterations
    Trainer<GaussianMarked, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    set_watermark(trainer, compmark::testing::colours(), compmark::testing::eight_bits);
    auto begun = GaussianMarked::begin(*host, views, 4, executor);
    REQUIRE(begun.ok());
    trainer.start_from(std::move(*begun));
    REQUIRE(trainer.run(views));
    return baked_model(trainer.model());
  };
  const Model<HostRecipe> marked = embedded(two);
  const std::size_t rows = host->anchor_count(), copies = marked.anchor_count() - rows;
  CHECK(copies > rows / 4);
  CHECK(copies <= (rows + 1) / 2);
  for (std::size_t b = 0; b < host->arena.layout().blocks().size(); ++b) {
    const ArenaLayout::Block& block = host->arena.layout().blocks()[b];
    CAPTURE(std::string(block.name));
    const auto before = host->arena.values(BlockHandle{b}), after = marked.arena.values(BlockHandle{b});
    CHECK(std::equal(before.flat().begin(), before.flat().end(), after.flat().begin()));  // the first rows, or all
  }
  // The copies have left their originals, but for the place.
  const auto moved = [&](BlockHandle block) {
    const auto before = host->arena.values(block), after = marked.arena.values(block);
    std::size_t count = 0;
    for (std::size_t i = rows; i < after.rows; ++i) {
      bool found = false;
      for (std::size_t row = 0; row < rows && !found; ++row)
        found = std::equal(before.row(row), before.row(row) + before.columns, after.row(i));
      if (!found) ++count;
    }
    return count;
  };
  CHECK(moved(host->anchors.position) == 0);
  CHECK(moved(host->anchors.feature) > copies / 2);
  CHECK(moved(host->anchors.offset) > copies / 2);
  const auto decoder = compmark::testing::colours();
  const double before = lean_of(*host, views, decoder, two), after = lean_of(marked, views, decoder, two);
  CAPTURE(before);
  CAPTURE(after);
  CHECK(after > before + 0.05);
  CHECK(compmark::testing::same_values(marked, embedded(one)));
}

TEST_CASE("baselines/3dgsw: a model that was pruned trains on, and the bits lean the right way") {
  const BlobViews views;
  ThreadExecutor two(2), one(1);
  auto host = compmark::testing::briefly_trained<HostRecipe>(views, two);
  REQUIRE(host.ok());
  host->arena.values(host->anchors.position)(5, 1) = 1e4f;  // out of sight
  const auto embedded = [&](std::int64_t iterations, ThreadExecutor& executor) {
    const TrainSettings settings = threedgsw_settings(small_numbers(threedgsw_mark(), iterations));
    Trainer<ThreeDGswed, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    set_watermark(trainer, WaveletDecoder<LatticeDecoder<float>>(compmark::testing::colours()),
                  compmark::testing::eight_bits);
    auto begun = ThreeDGswed::begin(*host, views, 4, executor);
    REQUIRE(begun.ok());
    trainer.start_from(std::move(*begun));
    REQUIRE(trainer.run(views));
    return baked_model(trainer.model());
  };
  const Model<HostRecipe> marked = embedded(60, two);
  const auto hidden = [](const Model<HostRecipe>& model) {
    const auto position = model.columns().position;
    std::size_t count = 0;
    for (std::size_t row = 0; row < position.rows; ++row) count += position(row, 1) > 1e3f ? 1 : 0;
    return count;
  };
  CHECK(hidden(*host) == 1);
  CHECK(hidden(marked) == 0);
  CHECK(marked.anchor_count() >= host->anchor_count() - 1);  // the others draw, and some may be split
  const WaveletDecoder<LatticeDecoder<float>> reading(compmark::testing::colours());
  const double before = lean_of(*host, views, reading, two), after = lean_of(marked, views, reading, two);
  CAPTURE(before);
  CAPTURE(after);
  CAPTURE(host->anchor_count());
  CAPTURE(marked.anchor_count());
  CHECK(after > before + 0.05);
  CHECK(compmark::testing::same_values(marked, embedded(60, one)));
}

namespace {

/// Bit b leans with the mean of channel b, as steeply as it is asked to.
struct MeanColours {
  using Scalar = double;
  static constexpr bool is_absent = false;
  struct Context {};
  static constexpr int bits() { return 3; }
  static constexpr int minimum_size() { return 4; }
  template <Executor E>
  void forward(ImageView<const double> image, std::span<double> logits, Context& /*context*/, E& /*executor*/) const {
    for (int c = 0; c < 3; ++c) {
      double sum = 0;
      for (std::size_t i = 0; i < image.plane_size(); ++i) sum += image.plane(c)[i] * std::sin(0.1 * double(i) + c);
      logits[static_cast<std::size_t>(c)] = 10 * sum / static_cast<double>(image.plane_size());
    }
  }
  template <Executor E>
  void backward(std::span<const double> d_logits, ImageView<double> d_image, Context& /*context*/,
                E& /*executor*/) const {
    for (int c = 0; c < 3; ++c) {
      const double slope = 10 * d_logits[static_cast<std::size_t>(c)] / static_cast<double>(d_image.plane_size());
      for (std::size_t i = 0; i < d_image.plane_size(); ++i)
        d_image.plane(c)[i] += slope * std::sin(0.1 * double(i) + c);
    }
  }
};
using SmoothHost = compmark::testing::SmoothRecipe;

}  // namespace

TEST_CASE_TEMPLATE("baselines: the directional derivative of the whole loss equals central differences", R,
                   recipes::GuardSplat<SmoothHost, MeanColours>, recipes::GaussianMarker<SmoothHost, MeanColours>,
                   recipes::Waterf<SmoothHost, WaveletDecoder<MeanColours>>,
                   recipes::ThreeDGsw<SmoothHost, WaveletDecoder<MeanColours>>) {
  Model<R> model = compmark::testing::random_model<R>(24);
  const BlockHandle offset = model.arena.layout().find("anchor.residual");
  const Random random(8, 0, random_stage("test residual"));
  if (offset.valid()) {
    auto table = model.arena.values(offset);
    for (std::size_t i = 0; i < table.size(); ++i) table.data[i] = 0.3 * random.normal(i);
  }
  const Camera<double> camera = compmark::testing::ring_camera(1, 5, 37, 29);
  std::vector<double> storage(3 * 37 * 29);
  for (std::size_t i = 0; i < storage.size(); ++i) storage[i] = 1.5 + random.uniform(i);
  const ImageView<const double> target{storage.data(), 3, 29, 37};

  Pipeline<R> pipeline;
  pipeline.template stage<MessageStage>().message = {1, 0, 1};
  pipeline.template stage<MessageStage>().message_loss.settings.logit_scale = 1;
  SerialExecutor executor;
  using PassContext = typename Pipeline<R>::Context;
  typename Pipeline<R>::Phases phases;
  phases.template of<MessageStage>().weight = 0.5;
  compmark::testing::check_directional_derivative(
      model,
      [&](PassContext& context) {
        static_cast<void>(pipeline.forward(model, camera, 1, context, executor, phases));
        double total = pipeline.loss(target, {0.2, 0, 1}, context, executor).total;
        if constexpr (present<typename R::Embedder>)
          total += pipeline.template stage<OffsetPenaltyStage>().loss_of(model.arena.values(offset));
        return total;
      },
      [&](PassContext& context) { pipeline.backward(model, camera, 1, context, executor); });
}
