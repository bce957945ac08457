// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/run/run_observer.hpp>
#include <compmark/app/run/train.hpp>

#include "app/run/small_run.hpp"

TEST_CASE("app/run/run_observer: one that overrides nothing lets a run go on, and has no clock") {
  using namespace compmark;
  const testing::SmallCapture scene("compmark-run-observer");
  ThreadExecutor executor(2);
  RunObserver silent;
  CHECK(silent.seconds() == 0);
  CHECK(silent.free_memory_bytes() == 0);
  const Result<RunOutcome> outcome = train_scene(scene.training("silent"), executor, silent);
  REQUIRE(outcome.ok());
  CHECK(outcome->results.train_seconds == 0);
  // What is told changes nothing of the model.
  testing::KeepingObserver told;
  REQUIRE(train_scene(scene.training("told"), executor, told).ok());
  CHECK(testing::same_file(outcome->model, scene.folder.path / "told/model.safetensors"));
}

namespace {

/// A machine with a megabyte left.
struct FullMachine : compmark::RunObserver {
  [[nodiscard]] double free_memory_bytes() const override { return 1e6; }
};

}  // namespace

TEST_CASE("app/run/run_observer: a scene that does not fit the memory it is told of is refused") {
  using namespace compmark;
  const testing::SmallCapture scene("compmark-run-memory");
  ThreadExecutor executor(1);
  FullMachine full;
  const Result<RunOutcome> outcome = train_scene(scene.training("full"), executor, full);
  REQUIRE_FALSE(outcome.ok());
  CHECK(outcome.error().kind == ErrorKind::exhausted);
}
