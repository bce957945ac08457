// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/compress.hpp>
#include <compmark/app/run/fit_codec.hpp>
#include <compmark/app/run/train.hpp>
#include <filesystem>

#include "app/run/small_run.hpp"

namespace {

using namespace compmark;
using testing::KeepingObserver;

TEST_CASE("app/run/fit_codec: a finished model becomes a file that reads back, and one for a codec is refused") {
  const testing::SmallCapture scene("compmark-run-codec");
  ThreadExecutor executor(2);
  KeepingObserver told, fitted;
  REQUIRE(train_scene(scene.training("plain"), executor, told).ok());
  FitCodecSettings settings;
  settings.data = scene.data;
  settings.out = scene.folder.path / "fitted";
  settings.model = scene.folder.path / "plain/model.safetensors";
  settings.iterations = 12;
  const Result<RunOutcome> outcome = fit_codec(settings, executor, fitted);
  REQUIRE(outcome.ok());
  REQUIRE(outcome->results.compressed.has_value());
  CHECK(outcome->results.compressed->bytes == std::filesystem::file_size(settings.out / "model.cmk"));
  CHECK(outcome->results.compressed->bytes < std::filesystem::file_size(settings.model));
  CHECK(outcome->results.recipe == "hac+fitted");
  CHECK(coded_file(settings.out / "model.cmk")->codec == "hac");
  CHECK(fitted.seen == 2);
  CHECK(fitted.progress.back().bits_per_scalar.has_value());

  FitCodecSettings again = settings;
  again.model = settings.out / "model.safetensors";
  again.out = scene.folder.path / "again";
  const Result<RunOutcome> twice = fit_codec(again, executor, fitted);
  REQUIRE_FALSE(twice.ok());
  CHECK(twice.error().field == "recipe");
  again.model = settings.out / "model.cmk";
  CHECK(fit_codec(again, executor, fitted).error().problem == "is compressed already");
  again.model = settings.model;
  again.mark.decoder = "decoder.safetensors";
  CHECK(fit_codec(again, executor, fitted).error().field == "--key");
  CHECK_FALSE(std::filesystem::exists(again.out / "results.json"));
}

}  // namespace
