// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/app/files.hpp>
#include <compmark/app/reading.hpp>
#include <compmark/app/run/detail/fit_record.hpp>
#include <compmark/app/run/fit_decoder.hpp>
#include <compmark/app/run/train.hpp>
#include <compmark/io/safetensors.hpp>
#include <filesystem>
#include <string>

#include "app/run/small_run.hpp"

namespace {

using namespace compmark;
using testing::KeepingObserver;

TEST_CASE("app/run/fit_decoder: a decoder for a scene, and what its file says of the fit") {
  const testing::SmallCapture scene("compmark-run-fit");
  ThreadExecutor executor(2), one(1);
  KeepingObserver told;
  REQUIRE(train_scene(scene.training("unmarked"), executor, told).ok());
  DecoderFileSettings settings;
  settings.model = scene.folder.path / "unmarked/model.safetensors";
  settings.data = scene.data;
  settings.out = scene.folder.path / "decoder.safetensors";
  settings.fit.bits = 8;
  settings.fit.features = 24;
  settings.fit.statistics_views = 96;
  settings.fit.gradient_views = 2;
  settings.fit.tone = 0.05;
  const Result<FittedDecoder> made = fit_decoder_file(settings, executor, told);
  REQUIRE(made.ok());
  CHECK(told.fits > 0);
  CHECK(open_decoder(settings.out, nullptr).ok());
  CHECK(std::filesystem::exists(scene.folder.path / "decoder.json"));

  const Result<SafetensorsFile> file = read_safetensors(settings.out);
  REQUIRE(file.ok());
  const auto record = detail::read_fit_record(file->metadata.at("note"));
  REQUIRE(record.has_value());
  CHECK(record->model_sha256 == *file_sha256(settings.model));
  CHECK(record->features == 24);
  CHECK(record->statistics_views == 96);
  CHECK(record->tone == 0.05);
  CHECK(detail::fit_note(*record) == file->metadata.at("note"));

  // A decoder that is there is kept; it can be moved aside, and the same one is made on one thread.
  const Result<FittedDecoder> kept = fit_decoder_file(settings, executor, told);
  REQUIRE_FALSE(kept.ok());
  CHECK(kept.error().field == "--out");
  settings.force = true;
  const Result<FittedDecoder> again = fit_decoder_file(settings, one, told);
  REQUIRE(again.ok());
  CHECK(again->sha256 == made->sha256);
  CHECK(std::filesystem::exists(settings.out.string() + "." + made->sha256.substr(0, 16) + ".old"));

  settings.out = scene.folder.path / "stopped.safetensors";
  told.stop_fit = true;
  CHECK(fit_decoder_file(settings, executor, told).error().kind == ErrorKind::cancelled);
  CHECK_FALSE(std::filesystem::exists(settings.out));
  told.stop_fit = false;
  settings.fit.features = 4;
  CHECK(fit_decoder_file(settings, executor, told).error().field == "--features");
  settings.fit.features = 24;
  settings.fit.coordinates = 20;
  CHECK(fit_decoder_file(settings, executor, told).error().field == "--coordinates");
}

TEST_CASE("app/run/fit_decoder: a fit is recognised by its numbers, not by how they are written") {
  detail::FitRecord fit;
  fit.model_sha256 = std::string(64, 'a');
  fit.seed = 7;
  fit.period = 0.35;
  fit.edit_weight = 0.5;
  fit.region_limit = 1.5;
  const std::string note = detail::fit_note(fit);
  REQUIRE(detail::read_fit_record(note).has_value());
  CHECK(*detail::read_fit_record(note) == fit);
  for (detail::FitRecord other : {fit, fit, fit, fit, fit}) {
    static int number = 0;
    (number == 0   ? other.period
     : number == 1 ? other.tone
     : number == 2 ? other.edit_weight
                   : other.region_limit) += 0.001 * (1 + number);
    ++number;
    CHECK_FALSE(*detail::read_fit_record(detail::fit_note(other)) == fit);
  }
  // The same number in other words: a search for ", period 0.35," would miss it.
  std::string longer = note;
  longer.replace(longer.find("0.35"), 4, "3.5e-1");
  CHECK(*detail::read_fit_record(longer) == fit);
  // A number that another name ends with is not that of the name.
  CHECK(detail::read_fit_record(note + ", other period 0.9")->period == 0.35);
  for (const std::string& bad : {std::string(), std::string("trained on photographs"), note.substr(0, 60),
                                 note + ", tone", note + ", tone loud", "re" + note})
    CHECK_FALSE(detail::read_fit_record(bad).has_value());
}

}  // namespace
