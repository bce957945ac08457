// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The way of a model through hac_plus: trained for HAC, marked, written by hac_plus, read and verified from the file.
#include <doctest/doctest.h>

#include <compmark/app/compress.hpp>
#include <compmark/app/run/embed.hpp>
#include <compmark/app/run/fit_decoder.hpp>
#include <compmark/app/run/train.hpp>
#include <compmark/app/spread.hpp>
#include <compmark/app/verify.hpp>
#include <compmark/codec/hac_plus/hac_plus_format.hpp>
#include <filesystem>

#include "app/run/small_run.hpp"

namespace {

using namespace compmark;
using testing::KeepingObserver;
namespace fs = std::filesystem;

TrainSceneSettings coded_training(const testing::SmallCapture& scene, const std::string& out,
                                  const std::string& codec) {
  TrainSceneSettings settings = scene.training(out);
  settings.recipe.clear();
  settings.effects = "none";
  settings.codec = codec;
  settings.iterations = 60;
  return settings;
}

TEST_CASE("app/run/hac_plus: trains as hac does, to the last bit, and writes fewer bytes of the same model") {
  const testing::SmallCapture scene("compmark-run-hac-plus");
  ThreadExecutor executor(2);
  KeepingObserver told;
  const Result<RunOutcome> hac = train_scene(coded_training(scene, "hac", "hac"), executor, told);
  const TrainSceneSettings settings = coded_training(scene, "plus", "hac_plus");
  const Result<RunOutcome> plus = train_scene(settings, executor, told);
  REQUIRE(hac.ok());
  REQUIRE(plus.ok());
  CHECK(testing::same_file(hac->model, plus->model));
  CHECK(plus->results.recipe == "hac");
  const fs::path file = settings.out / "model.cmk", plain = scene.folder.path / "hac/model.cmk";
  CHECK(plus->results.compressed->codec == "hac_plus");
  CHECK(plus->results.compressed->bytes == fs::file_size(file));
  CHECK(coded_file(file)->codec == "hac_plus");
  CHECK(coded_file(plain)->codec == "hac");
  CHECK(fs::file_size(file) < fs::file_size(plain));
  CHECK(plus->results.compressed->test.psnr == hac->results.compressed->test.psnr);
  const auto read = read_coded(file, {}, executor), other = read_coded(plain, {}, executor);
  REQUIRE(read.ok());
  REQUIRE(other.ok());
  CHECK(read->model.feature == other->model.feature);
  CHECK(read->model.offset == other->model.offset);

  TrainSceneSettings again = settings;  // a finished run of one codec is none of the other
  again.resume = true;
  CHECK(train_scene(again, executor, told).ok());
  again.codec = "hac";
  const Result<RunOutcome> refused = train_scene(again, executor, told);
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().problem.find("--codec") != std::string::npos);
  TrainSceneSettings wrong = coded_training(scene, "wrong", "hac_plus");
  wrong.recipe = "context_gs";
  wrong.effects = "auto";
  CHECK(train_scene(wrong, executor, told).error().problem.find("hac_plus") != std::string::npos);
}

TEST_CASE("app/run/hac_plus: a marked model is verified from its file, and an unmarked one is not") {
  const testing::SmallCapture scene("compmark-run-hac-plus-mark");
  ThreadExecutor executor(2);
  KeepingObserver told;
  const OwnerKey key = scene.make_key();
  const Result<RunOutcome> trained = train_scene(coded_training(scene, "first", "hac_plus"), executor, told);
  REQUIRE(trained.ok());
  DecoderFileSettings fit;
  fit.model = trained->model;
  fit.data = scene.data;
  fit.out = scene.folder.path / "decoder.safetensors";
  fit.fit.bits = 8;
  fit.fit.features = 24;
  fit.fit.statistics_views = 96;
  fit.fit.gradient_views = 2;
  REQUIRE(fit_decoder_file(fit, executor, told).ok());

  TrainSceneSettings settings = coded_training(scene, "marked", "hac_plus");
  settings.mark.key = scene.key;
  settings.mark.decoder = fit.out;
  settings.mark.fidelity = 300;  // the training as above, and then the mark
  settings.mark_iterations = 200;
  const Result<RunOutcome> marked = train_scene(settings, executor, told);
  REQUIRE_MESSAGE(marked.ok(), (marked.ok() ? "" : marked.error().line()));
  CHECK(testing::same_file(settings.out / "unmarked/model.safetensors", trained->model));
  for (const char* name : {"model.cmk", "unmarked.cmk", "unmarked/model.cmk"}) {
    CAPTURE(name);
    CHECK(coded_file(settings.out / name)->codec == "hac_plus");
  }
  const auto evidence = [&](const char* name) {
    ReadingSettings reading;
    reading.decoder = fit.out;
    reading.model = settings.out / name;
    const auto found = verify_files(key, reading, {}, executor);
    REQUIRE(found.ok());
    return found->verification;
  };
  const Verification with = evidence("model.cmk"), without = evidence("unmarked.cmk");
  const Message message = message_of(key);
  const auto signal = [&](const Verification& verification) {
    double sum = 0;
    for (std::size_t b = 0; b < 8; ++b) sum += (message[b] ? 1 : -1) * verification.fused[b] / 8;
    return sum;
  };
  CHECK(with.evidence.matches >= 6);  // so brief a mark need not turn every bit
  CHECK(signal(with) > signal(without) + 0.5);
  const double bytes = static_cast<double>(fs::file_size(settings.out / "model.cmk")),
               unmarked = static_cast<double>(fs::file_size(settings.out / "unmarked.cmk"));
  MESSAGE("marked ", bytes, " bytes, unmarked ", unmarked, ", signal ", signal(with), " and ", signal(without));
  CHECK(bytes < 1.1 * unmarked);

  EmbedSettings alone;  // by embed alone: the files are those of the model's own codec unless it is told
  alone.data = scene.data;
  alone.model = trained->model;
  alone.mark = settings.mark;
  alone.iterations = 3;
  for (const char* codec : {"trained", "hac_plus"}) {
    CAPTURE(codec);
    alone.codec = codec;
    alone.out = scene.folder.path / codec;
    REQUIRE(embed_message(alone, executor, told).ok());
    for (const char* name : {"model.cmk", "unmarked.cmk"})
      CHECK((coded_file(alone.out / name)->codec == "hac_plus") == (alone.codec == "hac_plus"));
  }
  // Pictures with a spread mark are read by the unmarked file too, which stores fewer cameras and anchors than the model
  // that was marked, in its cubes. Without a spread mark the file says nothing of them.
  alone.codec = "trained";
  alone.mark.spread = 40;
  alone.out = scene.folder.path / "spread";
  REQUIRE(embed_message(alone, executor, told).ok());
  Result<AnyModel> model = AnyModel::open(trained->model, executor),
                   file = AnyModel::open(alone.out / "unmarked.cmk", executor),
                   before = AnyModel::open(scene.folder.path / "trained/unmarked.cmk", executor);
  REQUIRE((model.ok() && file.ok() && before.ok()));
  const Result<double> side = spread_cell_side(*model), stored = spread_cell_side(*file);
  REQUIRE((side.ok() && stored.ok()));
  CHECK(*stored == *side);
  CHECK(before->info().spread_side == 0);
  MESSAGE("side ", *side, ", from the file's own cameras ", *spread_cell_side(*before));
  CHECK(*spread_cell_side(*before) != *side);
}

}  // namespace
