// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/any_model.hpp>
#include <compmark/app/files.hpp>
#include <compmark/app/run/detail/finished_run.hpp>
#include <compmark/app/run/detail/train_effects.hpp>
#include <compmark/app/run/train.hpp>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "app/run/small_run.hpp"
#include "app/small_decoder.hpp"

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
  // What a mark alone has use for names the key that is not there, not the mark.
  refused("--spread", [](TrainSceneSettings& s) { s.mark.spread = 50; });
  refused("--sample-by-loss", [](TrainSceneSettings& s) { s.mark.by_cost = 1; });
  refused("--orbit", [](TrainSceneSettings& s) { s.mark.orbit = 0.5; });
  refused("--photographs", [](TrainSceneSettings& s) { s.mark.photographs = 0.3; });
  refused("--calibrate-steps", [](TrainSceneSettings& s) { s.mark.calibrate_steps = 50; });
  refused("--fidelity", [](TrainSceneSettings& s) { s.mark.fidelity = 100; });
  TrainSceneSettings keyless = scene.training("run");
  keyless.mark.spread = 50;
  const Result<RunOutcome> told_why = train_scene(keyless, executor, told);
  REQUIRE_FALSE(told_why.ok());
  CHECK(told_why.error().line() == "--spread: needs a message to hide; give --key");
  CHECK(told.progress.empty());
}

TEST_CASE("app/run/train: a key that does not fit the decoder is refused before the unmarked model is trained") {
  const testing::SmallCapture scene("compmark-run-unfit-key");
  ThreadExecutor executor(1);
  KeepingObserver told;
  const std::filesystem::path decoder = scene.folder.path / "decoder.safetensors";
  testing::write_decoder(decoder, 8);
  Digest256 secret{};
  secret[3] = std::byte{5};
  const auto refused = [&](const std::string& bound_to, std::size_t bits, bool universal) {
    const Result<OwnerKey> key =
        make_bound_key(secret, bound_to, "2026-01-31T23:59:59Z", bits, "", OwnerKey::least_hardness);
    REQUIRE(key.ok());
    REQUIRE(write_key(scene.key, *key).ok());
    TrainSceneSettings settings = scene.training("run");
    settings.mark.key = scene.key;
    if (universal) {
      settings.mark.universal = decoder;
    } else {
      settings.mark.decoder = decoder;
      settings.mark.fidelity = 100;
    }
    REQUIRE(marks_afterwards(settings));
    settings.iterations = 3;
    settings.mark_iterations = 1;
    const Result<RunOutcome> outcome = train_scene(settings, executor, told);
    std::filesystem::remove(scene.key);
    return outcome.ok() ? std::string() : outcome.error().line();
  };
  for (const bool universal : {true, false}) {
    CAPTURE(universal);
    CHECK(refused(std::string(64, 'a'), 8, universal).find("not the decoder that this key is bound to") !=
          std::string::npos);
    CHECK_FALSE(refused(*file_sha256(decoder), 16, universal).empty());  // other bits than the decoder reads
    CHECK_FALSE(std::filesystem::exists(scene.folder.path / "run"));
    CHECK(told.progress.empty());
  }
  // Negative control: with the key of this decoder the work begins.
  told.stop_after = 1;
  static_cast<void>(refused(*file_sha256(decoder), 8, true));
  CHECK(told.progress.size() == 1);
}

TEST_CASE("app/run/train: a finished run with another key or codec is told by these alone") {
  using Json = nlohmann::json;
  detail::RunPlan plan;
  plan.out = "run";
  const Json none = Json::object(), marked = {{"--key", "a"}, {"--model", "b"}, {"--decoder", "c"}};
  const auto told = [&](const std::string& recipe_before, const std::string& recipe, const Json& before,
                        const Json& now) {
    const Result<Done> same = detail::check_same_kind(plan, recipe_before, recipe, before, now);
    return same ? std::string() : same.error().line();
  };
  const std::string key_lost = told("scaffold", "scaffold", marked, none);
  CHECK(key_lost ==
        "run: --resume: the run in this folder is finished (results.json), and was marked with --key; give --key KEY "
        "again, or choose another --out");
  CHECK(told("scaffold", "scaffold", none, {{"--key", "a"}}).find("was made without --key") != std::string::npos);
  CHECK(told("hac", "scaffold", none, none).find("--codec was hac and is none; give --codec hac again") !=
        std::string::npos);
  CHECK(told("hac", "hac", {{"--codec", "hac_plus"}}, none).find("--codec was hac_plus and is hac") !=
        std::string::npos);
  // Negative controls: the same, an effect more, and another model say nothing here.
  CHECK(told("scaffold", "scaffold", none, none).empty());
  CHECK(told("scaffold", "scaffold+exposure", none, none).empty());
  plan.model = "model.safetensors";
  CHECK(told("scaffold", "scaffold", marked, marked).empty());
  CHECK(told("hac", "context_gs", marked, {{"--key", "a"}, {"--model", "z"}}).empty());
}

TEST_CASE("app/run/train: a run without a key is not resumed with one, which is said before anything is trained") {
  const testing::SmallCapture scene("compmark-run-key-later");
  static_cast<void>(scene.make_key());
  ThreadExecutor executor(2);
  KeepingObserver told, quiet;
  TrainSceneSettings settings = scene.training("run");
  told.stop_after = 3;
  REQUIRE_FALSE(train_scene(settings, executor, told).ok());
  settings.resume = true;
  const auto refused = [&](const std::string& why) {
    TrainSceneSettings keyed = settings;
    keyed.mark.key = scene.key;
    quiet.stop_after = 1;
    const Result<RunOutcome> outcome = train_scene(keyed, executor, quiet);
    REQUIRE_FALSE(outcome.ok());
    CAPTURE(outcome.error().line());
    CHECK(outcome.error().line().find(why) != std::string::npos);
    CHECK(quiet.progress.empty());
    CHECK_FALSE(std::filesystem::exists(settings.out / "unmarked/checkpoint.safetensors"));
  };
  refused("is of a run without --key");
  told.stop_after = 0;
  const Result<RunOutcome> finished = train_scene(settings, executor, told);
  REQUIRE(finished.ok());
  refused("compmark embed --model " + finished->model.string());
  // Negative control: with --force it is replaced, and its training begins.
  settings.force = true;
  settings.mark.key = scene.key;
  CHECK_FALSE(train_scene(settings, executor, quiet).ok());
  CHECK(quiet.progress.size() == 1);
}

TEST_CASE("app/run/train: a finished run of another key is told before anything is trained") {
  const testing::SmallCapture scene("compmark-run-other-key");
  const OwnerKey key = scene.make_key();
  Digest256 secret{};
  secret[5] = std::byte{10};
  const Result<OwnerKey> other = make_key(secret, "2026-01-31T23:59:59Z", 8);
  REQUIRE(other.ok());
  const std::filesystem::path model = scene.folder.path / "model.safetensors";
  detail::RunPlan plan;
  plan.out = scene.folder.path;
  plan.resume = true;
  std::ofstream(model) << "a model";
  RunResults results;
  results.model_sha256 = *file_sha256(model);
  results.identity = nlohmann::json{{"files", {{"--key", key.commitment()}}}}.dump();
  REQUIRE(write_results(plan.out / "results.json", results).ok());
  REQUIRE(detail::holds_finished_run(plan.out));
  CHECK(detail::check_resumes_mark(plan, key, plan.out / "unmarked").ok());
  const Result<Done> refused = detail::check_resumes_mark(plan, *other, plan.out / "unmarked");
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().problem.find("--key differs") != std::string::npos);
  plan.force = true;
  CHECK(detail::check_resumes_mark(plan, *other, plan.out / "unmarked").ok());
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
