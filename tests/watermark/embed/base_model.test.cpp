// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/codec/model/codec_fit_settings.hpp>
#include <compmark/watermark/embed/base_model.hpp>
#include <cstddef>
#include <vector>

#include "support/coded_training.hpp"

namespace base_model_test {
namespace {

using namespace compmark;
using testing::SmallContextGs;
using testing::SmallHac;
using testing::SmallRecipe;

Model<SmallRecipe> base() {
  Model<SmallRecipe> model;
  model.create(9, 3);
  model.voxel_size = 0.25;
  model.render.near_plane = 0.5;
  double value = 0;
  for (const ArenaLayout::Block& block : model.arena.layout().blocks()) {  // and not what lies between them
    for (float& v : model.arena.values(model.arena.layout().find(block.name)).flat())
      v = static_cast<float>(value += 0.01);
  }
  return model;
}

}  // namespace

TEST_CASE_TEMPLATE("embed/base_model: a model comes out of the room for a codec as it went in", R, SmallHac,
                   SmallContextGs) {
  const Model<SmallRecipe> before = base();
  const Model<R> roomy = with_room_for_stages<R>(before, 7);
  CHECK(roomy.anchor_count() == 9);
  CHECK(roomy.train_views == 3);
  CHECK(roomy.voxel_size == 0.25);
  CHECK(roomy.render.near_plane == 0.5);
  CHECK(roomy.arena.all_values().size() > before.arena.all_values().size());
  // The context is fresh, and another one with another seed.
  const auto values = [](const Model<R>& model) {
    const auto all = model.arena.all_values();
    return std::vector<float>(all.begin(), all.end());
  };
  CHECK(values(roomy) == values(with_room_for_stages<R>(before, 7)));
  CHECK(values(roomy) != values(with_room_for_stages<R>(before, 8)));

  const Model<SmallRecipe> after = base_model(roomy);
  CHECK(after.anchor_count() == 9);
  CHECK(after.voxel_size == 0.25);
  CHECK(after.render.near_plane == 0.5);
  CHECK(testing::same_bits(after, before));
}

TEST_CASE("embed/base_model: a codec is fitted to anchors that do not move") {
  // As compmark fit-codec does: no rate but the context's, from the first iteration on.
  const Model<SmallRecipe> before = [] {
    testing::BlobViews views;
    ThreadExecutor executor(2);
    TrainSettings settings = testing::short_settings(60);
    Trainer<SmallRecipe, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    REQUIRE(trainer.initialise(testing::cloud(300, 7)));
    while (!trainer.finished()) REQUIRE(trainer.step(views));
    return trainer.model();
  }();
  const auto bits_of = [&](double lambda) {
    TrainSettings settings = codec_fit_settings(testing::short_settings(80));
    settings.rate.lambda = lambda;
    testing::BlobViews views;
    ThreadExecutor executor(2);
    Trainer<SmallHac, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    trainer.start_from(with_room_for_stages<SmallHac>(before, 1));
    double bits = 0;
    while (!trainer.finished()) {
      REQUIRE(trainer.step(views));
      REQUIRE(trainer.context().template of<RateStage>().report.sampled > 0);
      if (trainer.state().iteration > 70)
        bits += trainer.context().template of<RateStage>().report.bits_per_scalar / 10;
    }
    CHECK(testing::same_bits(base_model(trainer.model()), before));
    return bits;
  };
  const double fine = bits_of(1e-4), coarse = bits_of(1e-1);
  MESSAGE("bits a scalar: ", fine, ", where they cost more ", coarse);
  CHECK(coarse < fine);
}

}  // namespace base_model_test
