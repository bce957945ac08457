// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ContextGS in a training as a whole: levels, parents and hyperprior give the same bits at any thread count and after a stop, the rate is a
// loss, and a trained model goes through a file to the same render, in the bytes that training said. Its gradients are proven in tests/entropy.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/recipes/context_gs.hpp>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "support/coded_training.hpp"

namespace {

using namespace compmark;
using compmark::testing::SmallContextGs;

ModelInfo info_of() {
  ModelInfo info;
  info.recipe = "context_gs";
  info.profile = "hac";
  info.iterations = 300;
  info.base_step = {1, 0.01, 0.2};
  return info;
}
/// Trained a little, with far more anchors than it takes, so that levels have many.
const Model<SmallContextGs>& trained_context_gs() {
  static const Model<SmallContextGs> instance = [] {
    TrainSettings settings = compmark::testing::short_settings(300);
    settings.voxel_size = 0.01;
    settings.rate.sample = 1;
    compmark::testing::BlobViews views;
    ThreadExecutor executor(2);
    Trainer<SmallContextGs, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    REQUIRE(trainer.initialise(compmark::testing::cloud(3000, 7)));
    REQUIRE(trainer.run(views));
    return trainer.model();
  }();
  return instance;
}

}  // namespace

TEST_CASE("model/context_gs: the same bits at any thread count and after a stop, in every phase") {
  compmark::testing::check_reproducible<SmallContextGs>();
}

TEST_CASE("model/context_gs: the rate is a loss: more weight, fewer bits") {
  const auto bits = [](double lambda) {
    TrainSettings settings = compmark::testing::short_settings(300);
    settings.rate.lambda = lambda;
    settings.rate.sample = 1;
    compmark::testing::BlobViews views;
    ThreadExecutor executor(2);
    Trainer<SmallContextGs, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    REQUIRE(trainer.initialise(compmark::testing::cloud(300, 7)));
    REQUIRE(trainer.run(views));
    return trainer.context().template of<RateStage>().report.bits_per_scalar;
  };
  const double free = bits(0), cheap = bits(0.02);
  MESSAGE("bits a scalar: ", free, " at lambda 0, ", cheap, " at 0.02");
  CHECK(cheap < 0.7 * free);
}

TEST_CASE("model/context_gs: a trained model goes through a file and renders the same bits as the encoder's own") {
  const Model<SmallContextGs>& model = trained_context_gs();
  ThreadExecutor executor(2);
  const Result<CodecModel> coded = coded_model(model, info_of());
  REQUIRE_MESSAGE(coded.ok(), (coded.ok() ? "" : coded.error().line()));
  CHECK(coded->profile() == ContainerProfile::context_gs);
  const Result<CodecEncoded> file = encode_cmk(*coded, {}, executor);
  REQUIRE_MESSAGE(file.ok(), (file.ok() ? "" : file.error().line()));
  const Result<CodecDecoded> decoded = decode_cmk(file->bytes, "a.cmk", {}, executor);
  REQUIRE(decoded.ok());
  CHECK(decoded->verified);
  const Result<LoadedModel<SmallContextGs>> ours = model_from<SmallContextGs>(file->model),
                                            theirs = model_from<SmallContextGs>(decoded->model);
  REQUIRE(ours.ok());
  REQUIRE(theirs.ok());
  CHECK(compmark::testing::same_bits(ours->model, theirs->model));
  CHECK(theirs->info.recipe == "context_gs");
  const Result<CodecModel> twice = coded_model(theirs->model, theirs->info);
  REQUIRE_FALSE(twice.ok());
  CHECK(twice.error().problem.find("decompressed") != std::string::npos);

  Pipeline<SmallContextGs> pipeline;
  Pipeline<SmallContextGs>::Context before, after, again;
  const Camera<double> camera = compmark::testing::ring_camera(2, 6, 48, 40);
  static_cast<void>(pipeline.forward(model, camera, unseen_view, before, executor));
  static_cast<void>(pipeline.forward(ours->model, camera, unseen_view, after, executor));
  static_cast<void>(pipeline.forward(theirs->model, camera, unseen_view, again, executor));
  double square = 0;
  bool same = true;
  for (std::size_t i = 0; i < before.image.size(); ++i) {
    const double d = static_cast<double>(before.image.data[i] - after.image.data[i]);
    square += d * d;
    same = same && after.image.data[i] == again.image.data[i];
  }
  CHECK(same);
  const double rms = std::sqrt(square / static_cast<double>(before.image.size()));
  const auto& levels = file->report.level_anchors;
  MESSAGE("rms difference of the render ", rms, ", file ", file->bytes.size(), " bytes, levels ", levels[2], " ",
          levels[1], " ", levels[0]);
  CHECK(rms > 0);
  CHECK(rms < 0.05);
}

TEST_CASE("model/context_gs: the bits that training counts are the bytes of the file, to 0.5 % and 12 bytes a chunk") {
  Model<SmallContextGs> model = trained_context_gs();
  ThreadExecutor executor(2);
  const Result<CodecModel> coded = coded_model(model, info_of());
  REQUIRE(coded.ok());
  // The levels of training are those of the file: nothing is drawn for the rate but everything.
  RateNumbers numbers;
  numbers.scaling_step = 0.01;
  numbers.sample = 1;
  const SmallContextGs::EntropyModel rate = entropy_model<SmallContextGs>(numbers);
  RatePhase phase;
  phase.context = phase.round = true;
  SmallContextGs::EntropyModel::Context context;
  const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
  std::vector<std::uint32_t> rows(model.anchor_count());
  std::iota(rows.begin(), rows.end(), 0u);
  const std::vector<float> position(columns.position.data, columns.position.data + 3 * rows.size());
  const RateReport report = rate.forward(model.arena, model.template blocks<RateStage>(), rows, phase,
                                         MatrixView<const float>{position.data(), rows.size(), 3}, columns.feature,
                                         columns.scaling, columns.offset, context, executor);
  const double scalars = 8 + 6 + 9, n = static_cast<double>(rows.size());
  const double bytes = (report.bits_per_scalar * scalars * n + report.hash_bits) / 8;
  std::size_t whole = 0;
  for (const bool chosen : {false, true}) {
    CodecEncodeSettings settings;
    if (!chosen) settings.weight_bits = WeightBits::all(16);
    const Result<CodecEncoded> file = encode_cmk(*coded, settings, executor);
    REQUIRE(file.ok());
    const CodecReport& r = file->report;
    const double stored =
        static_cast<double>(r.bytes_of(CodecFormat::stream) + r.bytes_of(ContextGsFormat::hyperprior));
    const double z = report.hash_bits / 8, z_stored = static_cast<double>(r.bytes_of(ContextGsFormat::hyperprior));
    MESSAGE(std::string(chosen ? "chosen weights" : "16 bits a weight"), ": training counts ", bytes, " bytes (", z,
            " of z), the file has ", stored, " (", z_stored, " of z), the tables say ",
            (r.ideal_bits[0] + r.ideal_bits[1] + r.ideal_bits[2] + r.hyperprior_bits) / 8);
    // Weights of fewer bits predict a little worse, which the file has less network for.
    if (!chosen) CHECK(std::abs(stored - bytes) < 0.005 * bytes + 6 * 25);
    if (chosen) CHECK(file->bytes.size() < whole);
    whole = file->bytes.size();
  }
}
