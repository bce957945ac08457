// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A training in which no Gaussian is drawn any more comes back, and one that lives is not touched.
#include "compmark/splat/training/revival.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <utility>

#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/training/checkpoint.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "support/coded_training.hpp"
#include "support/small_scene.hpp"

namespace revival_test {

using namespace compmark;
using compmark::testing::BlobViews;
using Run = Trainer<compmark::testing::SmallRecipe, ThreadExecutor>;

constexpr std::int64_t dying_iterations = 400;

TrainSettings dying_settings(std::int64_t most_revivals) {
  TrainSettings settings;
  settings.iterations = dying_iterations;
  settings.voxel_size = 0.05;
  settings.most_revivals = most_revivals;
  return settings;
}

/// Sets all opacities below 0, as a step too long leaves them.
void make_transparent(Run& run) {
  Run::State state = run.state();
  const HeadHandles& head = state.model.decoder.opacity;
  const auto weight = state.model.arena.values(head.weight2).flat();
  std::fill(weight.begin(), weight.end(), 0.0f);
  const auto bias = state.model.arena.values(head.bias2).flat();
  std::fill(bias.begin(), bias.end(), -2.0f);
  run.restore(std::move(state));
}
/// A training that dies after its first iterations.
void kill(Run& run, BlobViews& views) {
  REQUIRE(run.initialise(compmark::testing::cloud(300, 7)));
  for (int i = 0; i < 3; ++i) REQUIRE(run.step(views));
  make_transparent(run);
}

struct Life {
  std::int64_t revived_at = 0;
  std::size_t last_gaussians = 0;
  double first_error = 0, last_error = 0;  ///< of the colours, mean of six views
  Model<compmark::testing::SmallRecipe> model;
  Revival revival;
};
Life live(std::int64_t most_revivals, std::size_t threads = 2) {
  ThreadExecutor executor(threads);
  BlobViews views;
  Run run(dying_settings(most_revivals), views.size(), 1.0, executor);
  kill(run, views);
  Life life;
  while (!run.finished()) {
    const auto report = run.step(views);
    REQUIRE(report.ok());
    if (report->revived && life.revived_at == 0) life.revived_at = report->iteration;
    if (life.revived_at == 0) CHECK(report->forward.gaussians == 0);
    life.last_gaussians = report->forward.gaussians;
    if (report->iteration <= 9) life.first_error += report->loss.l1 / 6;
    if (report->iteration > dying_iterations - 6) life.last_error += report->loss.l1 / 6;
  }
  life.model = run.model();
  life.revival = run.state().revival;
  return life;
}

TEST_CASE("training/revival: a training that died comes back and learns; without the cure it stays dead") {
  const Life cured = live(3);
  CHECK(cured.revived_at == 3 + Revival::patience);
  CHECK(cured.revival.revivals == 1);
  CHECK(cured.last_gaussians > 0);
  CHECK(cured.last_error < 0.5 * cured.first_error);
  const Life dead = live(0);  // negative control
  CHECK(dead.revived_at == 0);
  CHECK(dead.last_gaussians == 0);
  CHECK(dead.last_error > 0.9 * dead.first_error);
  CHECK(compmark::testing::same_bits(cured.model, live(3, 1).model));
}

TEST_CASE(
    "training/revival: a run that is stopped while it is dead comes back in the same iteration, to the same bits") {
  const Life once = live(3);
  for (const std::int64_t stop : {10, 33, 200}) {
    CAPTURE(stop);
    ThreadExecutor executor(2);
    BlobViews views;
    const TrainSettings settings = dying_settings(3);
    Run run(settings, views.size(), 1.0, executor);
    kill(run, views);
    while (run.state().iteration < stop) REQUIRE(run.step(views));
    const compmark::testing::ScratchFolder folder("compmark-revival-test");
    const std::filesystem::path path = folder.path / "checkpoint.safetensors";
    REQUIRE(write_checkpoint(path, run.state(), settings, ModelInfo{}, 1.0));
    auto restored = read_checkpoint<Run>(path, settings, ModelInfo{});
    REQUIRE(restored.ok());
    CHECK(restored->state.revival == run.state().revival);
    Run again(settings, views.size(), 1.0, executor);
    again.restore(std::move(restored->state));
    while (!again.finished()) REQUIRE(again.step(views));
    CHECK(compmark::testing::same_bits(once.model, again.model()));
    CHECK_FALSE(read_checkpoint<Run>(path, dying_settings(2), ModelInfo{}).ok());  // that would be another run
    TrainSettings other = dying_settings(2);
    REQUIRE(write_checkpoint(path, run.state(), other, ModelInfo{}, 1.0));
    CHECK_FALSE(read_checkpoint<Run>(path, settings, ModelInfo{}).ok());
  }
}

TEST_CASE("training/revival: what is not drawn for want of anchors is no death, and tries have an end") {
  Revival revival;
  for (int i = 0; i < 1000; ++i) CHECK_FALSE(revival.count(0, 0));
  for (std::int64_t i = 1; i < Revival::patience; ++i) CHECK_FALSE(revival.count(5, 0));
  CHECK_FALSE(revival.count(5, 1));  // one that is drawn is enough
  CHECK(revival.empty == 0);
  for (std::int64_t i = 1; i < Revival::patience; ++i) CHECK_FALSE(revival.count(5, 0));
  CHECK(revival.count(5, 0));

  // Every try is in vain where opacities die again: killed after each, it is revived three times and then left.
  ThreadExecutor executor(2);
  BlobViews views;
  Run run(dying_settings(3), views.size(), 1.0, executor);
  std::size_t revived = 0;
  kill(run, views);
  for (int i = 0; i < 5 * Revival::patience; ++i) {
    const auto report = run.step(views);
    REQUIRE(report.ok());
    if (!report->revived) continue;
    ++revived;
    make_transparent(run);
  }
  CHECK(revived == 3);
  CHECK(run.state().revival.empty > Revival::patience);
}

TEST_CASE(
    "training/revival: set anew, half of the opacities are above 0, another half each time, and no moment is left") {
  using R = compmark::testing::SmallRecipe;
  Model<R> model;
  model.create(4, 1);
  Adam<float>::State optimizer;
  Adam<float>{}.prepare(model.arena.layout(), optimizer);
  std::fill(optimizer.first_moment.begin(), optimizer.first_moment.end(), 1.0f);
  std::fill(optimizer.steps.begin(), optimizer.steps.end(), std::uint64_t{7});
  renew_opacities(model.arena, model.decoder, optimizer, 3, 40);
  const auto bias = model.arena.values(model.decoder.opacity.bias2).flat();
  for (std::size_t k = 0; k < bias.size(); ++k) CHECK((bias[k] > 0) == (k % 2 == 0));
  const float before = bias[0];
  const auto kept =
      static_cast<std::size_t>(std::count(optimizer.first_moment.begin(), optimizer.first_moment.end(), 1.0f));
  std::size_t head = 0;
  for (const BlockHandle block : {model.decoder.opacity.weight1, model.decoder.opacity.bias1,
                                  model.decoder.opacity.weight2, model.decoder.opacity.bias2}) {
    head += model.arena.values(block).size();
    CHECK(optimizer.steps[block.index] == 0);
  }
  CHECK(kept == model.arena.layout().size() - head);  // and those of the others are as they were
  renew_opacities(model.arena, model.decoder, optimizer, 3, 70);
  CHECK(bias[0] != before);
}

}  // namespace revival_test
