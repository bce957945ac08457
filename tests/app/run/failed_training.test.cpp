// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A training that dies is brought back and told so; one that cannot be is an error with a remedy.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/app/run/detail/run_loop_observer.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "support/small_scene.hpp"
#include "support/tool.hpp"

namespace failed_training {

using namespace compmark;
using Run = Trainer<compmark::testing::SmallRecipe, ThreadExecutor>;

struct Told : RunObserver {
  std::vector<std::string> notes;
  std::uint64_t revivals = 0;
  void on_note(const std::string& sentence) override { notes.push_back(sentence); }
  bool on_iteration(const RunProgress& progress) override {
    revivals = progress.revivals;
    return true;
  }
};

/// Runs a training whose opacities are all below 0 from the beginning.
detail::TrainObserver run_dead(std::int64_t most_revivals, Told& told) {
  const compmark::testing::ScratchFolder folder("compmark-failed-training-test");
  TrainSettings settings;
  settings.iterations = 200;
  settings.voxel_size = 0.05;
  settings.most_revivals = most_revivals;
  ThreadExecutor executor(2);
  compmark::testing::BlobViews views;
  Run run(settings, views.size(), 1.0, executor);
  REQUIRE(run.initialise(compmark::testing::cloud(300, 7)));
  Run::State state = run.state();
  const HeadHandles& head = state.model.decoder.opacity;
  const auto weight = state.model.arena.values(head.weight2).flat();
  std::fill(weight.begin(), weight.end(), 0.0f);
  const auto bias = state.model.arena.values(head.bias2).flat();
  std::fill(bias.begin(), bias.end(), -2.0f);
  run.restore(std::move(state));
  const ModelInfo info;
  detail::TrainObserver observer;
  observer.told = &told;
  observer.info = &info;
  observer.checkpoint = folder.path / "checkpoint.safetensors";
  observer.patience = 100;
  observer.growth = [](std::size_t, std::size_t) -> Result<Done> { return Done{}; };
  REQUIRE(run.run(views, observer));
  return observer;
}

TEST_CASE("app/run/failed_training: what comes back is told and counted, what does not is an error") {
  Told cured;
  CHECK_FALSE(run_dead(3, cured).failure.has_value());
  CHECK(cured.revivals == 1);
  REQUIRE(cured.notes.size() == 1);
  CHECK(cured.notes[0].find("opacities were set anew") != std::string::npos);
  Told dead;
  const auto failure = run_dead(0, dead).failure;
  REQUIRE(failure.has_value());
  CHECK(failure->field == "iteration 101");
  CHECK(failure->problem.find("no Gaussian") != std::string::npos);
  CHECK(dead.revivals == 0);
  CHECK(dead.notes.empty());
}

}  // namespace failed_training
