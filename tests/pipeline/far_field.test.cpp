// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A recipe with a contracted space trains, is resumed, and asks for its ball; where the ball holds everything it ends in the bits of the
// recipe without.
#include <doctest/doctest.h>

#include <algorithm>
#include <bit>
#include <compmark/anchor/contracted_space.hpp>
#include <compmark/core/executor.hpp>
#include <compmark/pipeline/checkpoint.hpp>
#include <compmark/pipeline/trainer.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <vector>

#include "small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;

struct Plain : DefaultRecipe<float, DecoderShape{.feature_dim = 8, .offsets = 3}> {};
struct Contracted : DefaultRecipe<float, DecoderShape{.feature_dim = 8, .offsets = 3}> {
  using Space = ContractedSpace;
};
static_assert(sizeof(Model<Plain>) == sizeof(Model<Contracted>));  // the space is no part of a model

TrainSettings short_run(double radius) {
  TrainSettings settings;
  settings.iterations = 60;
  settings.grow_interval = 10;
  settings.statistics_after = 1000;
  settings.grow_after = 2000;
  settings.grow_until = 29000;
  settings.gradient_threshold = 1e-5;
  settings.voxel_size = 0.05;
  settings.init_factor = 4;
  settings.effects.space_radius = radius;
  return settings;
}

/// All values of the trained model, as bits; grows on the way.
template <class R>
std::vector<std::uint32_t> trained(const TrainSettings& settings) {
  SerialExecutor executor;
  const BlobViews views;
  Trainer<R, SerialExecutor> trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(200, 1)).ok());
  const std::size_t before = trainer.model().anchor_count();
  REQUIRE(trainer.run(views).ok());
  CHECK(trainer.model().anchor_count() > before);
  std::vector<std::uint32_t> bits;
  for (const float x : trainer.model().arena.all_values()) {
    CHECK(std::isfinite(x));
    bits.push_back(std::bit_cast<std::uint32_t>(x));
  }
  return bits;
}

}  // namespace

TEST_CASE("pipeline/far_field: with all of the scene in the ball training has the bits of the plain recipe") {
  const std::vector<std::uint32_t> plain = trained<Plain>(short_run(0));
  CHECK(trained<Contracted>(short_run(1000)) == plain);
  CHECK(trained<Contracted>(short_run(0.4)) != plain);  // the control: half of the cloud is outside
}

TEST_CASE(
    "pipeline/far_field: a contraction without a radius is refused, and its numbers are part of what is resumed") {
  SerialExecutor executor;
  Trainer<Contracted, SerialExecutor> trainer(short_run(0), 6, 3.3, executor);
  const Result<Done> refused = trainer.initialise(cloud(20, 1));
  REQUIRE(!refused.ok());
  CHECK(refused.error().field == "space_radius");
  CHECK(settings_json(short_run(1)) != settings_json(short_run(2)));
  CHECK(!settings_json(short_run(0)).contains("effects"));
}
