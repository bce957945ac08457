// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/any_model.hpp>
#include <compmark/app/files.hpp>
#include <compmark/app/run/detail/train_effects.hpp>
#include <compmark/app/run/train.hpp>
#include <cstddef>
#include <filesystem>
#include <string>

#include "app/run/small_run.hpp"

namespace {

using namespace compmark;
using testing::KeepingObserver;

TEST_CASE("app/run/train: a run leaves its files, and tells what it did") {
  const testing::SmallCapture scene("compmark-run-train");
  ThreadExecutor executor(2);
  KeepingObserver told;
  const TrainSceneSettings settings = scene.training("run");
  const Result<RunOutcome> outcome = train_scene(settings, executor, told);
  REQUIRE(outcome.ok());
  CHECK(outcome->model == settings.out / "model.safetensors");
  CHECK(outcome->results.model_sha256 == *file_sha256(outcome->model));
  CHECK(outcome->results.recipe == "scaffold");
  CHECK(outcome->results.train_seconds == 30);  // of the observer's clock
  CHECK(outcome->views == 2);
  CHECK(told.beginnings.size() == 1);
  CHECK(told.progress.size() == 30);
  CHECK(told.progress.back().total == 30);
  CHECK(told.ends == 1);
  CHECK(told.measured == 2);
  CHECK(told.seen == 2);
  CHECK(told.findings == 1);
  CHECK(told.finished == 1);
  CHECK_FALSE(std::filesystem::exists(settings.out / "checkpoint.safetensors"));
  CHECK_FALSE(std::filesystem::exists(settings.out / "report.html"));  // a page is the observer's
  const Result<RunResults> results = read_results(settings.out / "results.json");
  REQUIRE(results.ok());
  CHECK(results->test->psnr == outcome->results.test->psnr);
  const Result<AnyModel> model = AnyModel::open(outcome->model, executor);
  REQUIRE(model.ok());
  CHECK(model->anchor_count() == outcome->results.anchors);
}

TEST_CASE("app/run/train: a run that is stopped and resumed, on another number of threads, ends in the same bits") {
  const testing::SmallCapture scene("compmark-run-resume");
  ThreadExecutor one(1), three(3);
  KeepingObserver whole, first, second, again;
  REQUIRE(train_scene(scene.training("whole"), one, whole).ok());
  TrainSceneSettings settings = scene.training("parts");
  first.stop_after = 13;
  const Result<RunOutcome> stopped = train_scene(settings, three, first);
  REQUIRE_FALSE(stopped.ok());
  CHECK(stopped.error().kind == ErrorKind::cancelled);
  CHECK(first.ends == 1);
  CHECK(first.findings == 0);
  CHECK_FALSE(std::filesystem::exists(settings.out / "results.json"));
  const Result<RunOutcome> not_asked = train_scene(settings, three, again);
  REQUIRE_FALSE(not_asked.ok());
  CHECK(not_asked.error().remedy.find("--resume") != std::string::npos);
  settings.resume = true;
  REQUIRE(train_scene(settings, three, second).ok());
  REQUIRE(second.beginnings.size() == 1);
  CHECK(second.beginnings[0].resumed);
  CHECK(second.beginnings[0].iteration == 13);
  CHECK(second.progress.size() == 17);
  CHECK(testing::same_file(settings.out / "model.safetensors", scene.folder.path / "whole/model.safetensors"));
  // Another seed is another model: what is compared above can differ.
  TrainSceneSettings other = scene.training("other");
  other.seed = 3;
  REQUIRE(train_scene(other, three, again).ok());
  CHECK_FALSE(testing::same_file(other.out / "model.safetensors", scene.folder.path / "whole/model.safetensors"));
}

TEST_CASE("app/run/train: a finished run is done once; with other settings it is another, and refused") {
  const testing::SmallCapture scene("compmark-run-finished");
  ThreadExecutor executor(2);
  KeepingObserver told, quiet;
  TrainSceneSettings settings = scene.training("run");
  REQUIRE(train_scene(settings, executor, told).ok());
  const Result<RunOutcome> unasked = train_scene(settings, executor, quiet);
  REQUIRE_FALSE(unasked.ok());
  CHECK(unasked.error().problem.find("finished run") != std::string::npos);
  settings.resume = true;
  const Result<RunOutcome> same = train_scene(settings, executor, quiet);
  REQUIRE(same.ok());
  CHECK(same->was_finished);
  CHECK(same->results.model_sha256 == *file_sha256(same->model));
  CHECK(quiet.progress.empty());
  settings.iterations = 40;
  const Result<RunOutcome> longer = train_scene(settings, executor, quiet);
  REQUIRE_FALSE(longer.ok());
  CHECK(longer.error().problem.find("--iterations was 30 and is 40") != std::string::npos);
  CHECK(quiet.progress.empty());
  settings.force = true;
  REQUIRE(train_scene(settings, executor, quiet).ok());
  CHECK(quiet.progress.size() == 40);
}

TEST_CASE("app/run/train: a page that fails leaves the run unfinished, and it can be continued") {
  const testing::SmallCapture scene("compmark-run-page");
  ThreadExecutor executor(2);
  KeepingObserver told;
  TrainSceneSettings settings = scene.training("run");
  settings.checkpoint_every = 20;
  told.refuse_page = true;
  const Result<RunOutcome> refused = train_scene(settings, executor, told);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().file == "page");
  CHECK_FALSE(std::filesystem::exists(settings.out / "results.json"));
  CHECK(std::filesystem::exists(settings.out / "checkpoint.safetensors"));
  told.refuse_page = false;
  settings.resume = true;
  REQUIRE(train_scene(settings, executor, told).ok());
  CHECK(told.beginnings.back().iteration == 30);  // to its end: nothing is trained twice
  CHECK(told.progress.size() == 30);
}

TEST_CASE("app/run/train: a run that is marked afterwards is resumed with the recipe of its unmarked model") {
  const testing::SmallCapture scene("compmark-run-exposed-mark");
  ThreadExecutor executor(2);
  KeepingObserver told;
  TrainSceneSettings unmarked = scene.training("run/unmarked");
  unmarked.recipe.clear();
  unmarked.effects = "exposure";
  REQUIRE(train_scene(unmarked, executor, told).ok());
  TrainSceneSettings mark = scene.training("mark");  // a mark's checkpoint is of a recipe without exposures
  told.stop_after = 3;
  REQUIRE_FALSE(train_scene(mark, executor, told).ok());
  std::filesystem::rename(mark.out / "checkpoint.safetensors", scene.folder.path / "run/checkpoint.safetensors");
  detail::TrainChoice chosen;
  static_cast<TrainSceneSettings&>(chosen) = scene.training("run");
  chosen.recipe.clear();
  chosen.resume = true;
  chosen.mark.key = scene.key;
  const Result<bool> begun = detail::continue_begun(chosen);
  REQUIRE(begun.ok());
  CHECK(*begun);
  CHECK(chosen.recipe == "scaffold+exposure");
}

TEST_CASE("app/run/train: a test photograph that cannot be read is named before the training") {
  const testing::SmallCapture scene("compmark-run-test-photograph");
  ThreadExecutor executor(1);
  KeepingObserver told;
  std::filesystem::path photograph;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(scene.data)) {
    const std::string path = entry.path().string();
    if (path.find("test") != std::string::npos && path.ends_with(".png")) photograph = entry.path();
  }
  REQUIRE_FALSE(photograph.empty());
  std::filesystem::resize_file(photograph, std::filesystem::file_size(photograph) / 2);  // the header is good
  const Result<RunOutcome> outcome = train_scene(scene.training("run"), executor, told);
  REQUIRE_FALSE(outcome.ok());
  CHECK(outcome.error().file.find(photograph.filename().string()) != std::string::npos);
  CHECK(told.progress.empty());
}

TEST_CASE("app/run/train: wrong settings are refused before anything is written") {
  const testing::SmallCapture scene("compmark-run-wrong");
  ThreadExecutor executor(1);
  KeepingObserver told;
  const auto refused = [&](const char* field, auto change) {
    TrainSceneSettings settings = scene.training("run");
    change(settings);
    const Result<RunOutcome> outcome = train_scene(settings, executor, told);
    REQUIRE_FALSE(outcome.ok());
    CHECK(outcome.error().field == std::string(field));
    CHECK_FALSE(std::filesystem::exists(scene.folder.path / "run/results.json"));
    CHECK_FALSE(std::filesystem::exists(scene.folder.path / "run/model.safetensors"));
  };
  refused("recipe", [](TrainSceneSettings& s) { s.recipe = "scafold"; });
  refused("--profile", [](TrainSceneSettings& s) { s.profile = "fast"; });
  refused("--codec", [](TrainSceneSettings& s) { s.codec = "hac"; });
  refused("--for-fit-codec", [](TrainSceneSettings& s) {
    s.codec = "hac";
    s.recipe.clear();
    s.for_fit_codec = true;
  });
  refused("--checkpoint-every", [](TrainSceneSettings& s) { s.checkpoint_every = 0; });
  refused("--key", [](TrainSceneSettings& s) { s.mark.weight = 1; });
  CHECK(told.progress.empty());
}

TEST_CASE("app/run/train: marks_afterwards says whether an unmarked model comes first") {
  TrainSceneSettings settings;
  CHECK_FALSE(marks_afterwards(settings));
  settings.mark.key = "owner.key";
  CHECK(marks_afterwards(settings));
  settings.mark.decoder = "decoder.safetensors";
  CHECK_FALSE(marks_afterwards(settings));
  settings.mark.fidelity = 100;
  CHECK(marks_afterwards(settings));
  settings.mark.for_compression = true;
  CHECK_FALSE(marks_afterwards(settings));
}

}  // namespace
