// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A checkpoint with the right shapes and a right checksum whose numbers no run can have: refused with the tensor's name.
#include "compmark/splat/training/checkpoint_state.hpp"

#include <doctest/doctest.h>

#include <compmark/core/executor.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/small_scene.hpp"
#include "support/tool.hpp"

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;
using compmark::testing::ScratchFolder;
using compmark::testing::SmallRecipe;

TEST_CASE("training/checkpoint_state: numbers that no run can have are refused by name, those of a run are read") {
  using Run = Trainer<SmallRecipe, SerialExecutor>;
  TrainSettings settings;
  settings.iterations = 300;
  settings.voxel_size = 0.05;
  settings.statistics_after = 0;
  settings.grow_after = 1000;
  SerialExecutor executor;
  const BlobViews views;
  Run trainer(settings, views.size(), 3.3, executor);
  REQUIRE(trainer.initialise(cloud(100, 1)).ok());
  for (int i = 0; i < 8; ++i) REQUIRE(trainer.step(views).ok());

  const ScratchFolder folder("compmark-checkpoint-state-test");
  const std::filesystem::path path = folder.path / "checkpoint.safetensors";
  const auto refused = [&](const auto& damage, double seconds = 1) -> std::string {
    typename Run::State state = trainer.state();
    damage(state);
    REQUIRE(write_checkpoint(path, state, settings, ModelInfo{}, seconds).ok());
    const auto read = read_checkpoint<Trainer<SmallRecipe, SerialExecutor>>(path, settings, ModelInfo{});
    if (read.ok()) return {};
    CHECK(!read.error().remedy.empty());
    return read.error().field;
  };
  const auto none = [](auto&) {};
  CHECK(refused(none).empty());
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, inf, -inf}) {
    CHECK(refused([&](auto& state) { state.optimizer.first_moment[7] = bad; }) == "optimizer.first_moment");
    CHECK(refused([&](auto& state) { state.optimizer.second_moment[7] = bad; }) == "optimizer.second_moment");
    CHECK(refused([&](auto& state) { state.growth.statistics.visits[3] = bad; }) == "growth.visits");
    CHECK(refused([&](auto& state) { state.growth.statistics.gradient_count[3] = bad; }) == "growth.gradient_count");
    CHECK(refused([&](auto& state) { state.model.arena.all_values()[0] = bad; }) == "anchor.position");
  }
  CHECK(refused([](auto& state) { state.optimizer.second_moment[7] = -1e-3f; }) == "optimizer.second_moment");
  CHECK(refused([](auto& state) { state.optimizer.steps[1] = 9; }) == "optimizer.steps");
  CHECK(refused([](auto& state) { state.growth.statistics.visits[3] = 9; }) == "growth.visits");
  CHECK(refused([](auto& state) { state.growth.statistics.opacity_sum[3] = -2; }) == "growth.opacity_sum");
  CHECK(refused([](auto& state) { state.growth.statistics.gradient_sum[3] = -2; }) == "growth.gradient_sum");
  CHECK(refused([](auto& state) { state.iteration = -1; }) == "iteration");
  CHECK(refused([](auto& state) { state.iteration = 301; }) == "iteration");
  for (const Revival bad : {Revival{9, 0}, Revival{0, 9}, Revival{-1, 0}, Revival{std::int64_t{1} << 62, 0}})
    CHECK(refused([&](auto& state) { state.revival = bad; }) == "progress.revival");
  CHECK(refused([](auto& state) { state.revival = {8, 1}; }).empty());
  for (const double seconds : {-1.0, std::numeric_limits<double>::infinity()}) CHECK(!refused(none, seconds).empty());
  // A sum that is no number is growing's to drop (docs/spec/numerics.md, AN5), and the greatest counts of this run are
  // its own.
  CHECK(refused([&](auto& state) { state.growth.statistics.gradient_sum[3] = nan; }).empty());
  CHECK(refused([](auto& state) {
          state.optimizer.steps[1] = 8;
          state.growth.statistics.visits[3] = 8;
        }).empty());

  // Figures that the state does not hold come back as they were. One that is not finite makes no checkpoint unreadable.
  const auto figures = [&](std::vector<double> kept) {
    REQUIRE(write_checkpoint(path, trainer.state(), settings, ModelInfo{}, 1, std::move(kept)).ok());
    return read_checkpoint<Run>(path, settings, ModelInfo{});
  };
  CHECK(figures({})->figures.empty());
  CHECK(figures({0.1, -3e-7})->figures == std::vector<double>{0.1, -3e-7});
  CHECK(figures({0.1, std::numeric_limits<double>::quiet_NaN()})->figures.empty());
}
