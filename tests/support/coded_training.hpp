// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Short trainings for compression, of any recipe with an entropy model.
#pragma once

#include <doctest/doctest.h>

#include <compmark/codec/rate/rate.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/context_gs.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstring>
#include <filesystem>
#include <span>
#include <utility>

#include "support/small_scene.hpp"
#include "support/tool.hpp"

namespace compmark::testing {

struct SmallHac : recipes::Hac<SmallRecipe> {};
struct SmallContextGs : recipes::ContextGs<SmallRecipe> {};

inline constexpr HashGridShape small_grid{
    .volume_levels = 3, .volume_cap_log2 = 10, .plane_levels = 1, .plane_cap_log2 = 9};
struct SmallGridHac : recipes::Hac<SmallRecipe, small_grid> {};

inline TrainSettings short_settings(std::int64_t iterations) {
  TrainSettings settings = *profile_settings("hac");
  settings.iterations = iterations;
  settings.voxel_size = 0.05;
  settings.rate.scaling_step = 0.01;
  settings.rate.sample = 0.3;
  return settings;
}

template <class R>
struct Trained {
  Model<R> model;
  RateReport rate;
};
/// Trains up to an iteration and shows the trainer to `use`. `stop` > 0: written to a checkpoint after so many iterations, read back and continued.
template <class R, class Use>
void train_until(const TrainSettings& settings, std::size_t threads, std::int64_t until, std::int64_t stop,
                 const Use& use) {
  BlobViews views;
  ThreadExecutor executor(threads);
  using Run = Trainer<R, ThreadExecutor>;
  Run trainer(settings, views.size(), 1.0, executor);
  REQUIRE(trainer.initialise(cloud(300, 7)));
  const auto go = [&](Run& run, std::int64_t last) {
    while (run.state().iteration < last) REQUIRE(run.step(views));
  };
  if (stop == 0) {
    go(trainer, until);
    return use(std::as_const(trainer));
  }
  go(trainer, stop);
  const ScratchFolder folder("compmark-stopped-training-test");
  const std::filesystem::path path = folder.path / "checkpoint.safetensors";
  REQUIRE(write_checkpoint(path, trainer.state(), settings, ModelInfo{}, 1.0));
  auto restored = read_checkpoint<Trainer<R, ThreadExecutor>>(path, settings, ModelInfo{});
  REQUIRE(restored.ok());
  Run again(settings, views.size(), 1.0, executor);
  again.restore(std::move(restored->state));
  go(again, until);
  use(std::as_const(again));
}
template <class R>
Trained<R> train_coded(std::size_t threads, std::int64_t iterations = 90, std::int64_t stop = 0) {
  Trained<R> trained;
  train_until<R>(short_settings(iterations), threads, iterations, stop, [&](const auto& trainer) {
    trained = {trainer.model(), trainer.context().template of<RateStage>().report};
  });
  return trained;
}
template <class A, class B>
bool same_bits(const Model<A>& a, const Model<B>& b) {
  const std::span<const float> x = a.arena.all_values(), y = b.arena.all_values();
  return x.size() == y.size() && std::memcmp(x.data(), y.data(), x.size_bytes()) == 0;
}

/// The same bits from 1, 2 and 4 threads, and after a stop in every phase: nothing, noise, first and later iterations of the context.
template <class R>
void check_reproducible() {
  const Trained<R> once = train_coded<R>(1);
  CHECK(once.rate.sampled > 0);
  CHECK(same_bits(once.model, train_coded<R>(2).model));
  CHECK(same_bits(once.model, train_coded<R>(4).model));
  for (const std::int64_t stop : {5, 20, 31, 60}) {
    CAPTURE(stop);
    CHECK(same_bits(once.model, train_coded<R>(2, 90, stop).model));
  }
}

}  // namespace compmark::testing
