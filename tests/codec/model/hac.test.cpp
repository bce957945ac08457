// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Training for compression as a whole: gradients through the noise of predicted steps and the rate, phases, the same bits at any thread count
// and after a stop, and the way from a trained model to a file and back to the same render.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/codec/hac/hac_decoder.hpp>
#include <compmark/codec/hac/hac_encoder.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/recipes/far_field.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/splat/export/bake.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/embed/residual.hpp>
#include <string>
#include <vector>

#include "support/coded_training.hpp"
#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using compmark::testing::BlobViews;
using compmark::testing::cloud;
using compmark::testing::ring_camera;
using compmark::testing::same_bits;
using compmark::testing::short_settings;
using compmark::testing::SmallGridHac;
using compmark::testing::Trained;

struct SmoothHac : recipes::Hac<compmark::testing::SmoothRecipe, compmark::testing::small_grid> {};
/// With a mark in its features: what is coded, and what its rate is of, is f + tanh f'.
struct SmoothMarkedHac : SmoothHac {
  using Embedder = ResidualFeature<double>;
};

const Trained<SmallGridHac>& trained_hac() {
  static const Trained<SmallGridHac> instance = compmark::testing::train_coded<SmallGridHac>(2, 300);
  return instance;
}

}  // namespace

TEST_CASE_TEMPLATE("model/hac: the directional derivative of the pass with noise and rate equals central differences",
                   R, SmoothHac, SmoothMarkedHac) {
  Model<R> model = compmark::testing::random_model<R>(24);
  model.initialise_stages(4);
  {
    const AnchorColumns<const double> c = std::as_const(model).columns();
    R::EntropyModel::begin_context(model.arena, model.template blocks<RateStage>(), c.position, c.feature, c.scaling,
                                   c.offset);
  }
  if constexpr (present<typename R::Embedder>) {
    const Random residual(12, 0, random_stage("test residual"));  // no opacity within 1e-4 of 0, where it has a kink
    for (double& value : model.arena.values(model.arena.layout().find("anchor.residual")).flat()) {
      value = 0.3 * residual.normal(static_cast<std::uint64_t>(
                        &value - model.arena.values(model.template blocks<EmbedderStage>().residual).data));
    }
  }
  const Camera<double> camera = ring_camera(1, 5, 37, 29);
  Buffer<double> target_storage(3 * 37 * 29);
  const Random random(5, 0, random_stage("test target"));
  for (std::size_t i = 0; i < target_storage.size(); ++i) target_storage[i] = 1.5 + random.uniform(i);
  const ImageView<const double> target{target_storage.data(), 3, 29, 37};
  for (const bool context_on : {false, true}) {
    CAPTURE(context_on);
    for (double& gradient : model.arena.all_gradients()) gradient = 0;
    Pipeline<R> pipeline;
    RateNumbers numbers;
    numbers.lambda = 0.05;  // much, so that an error of the rate's gradient would show
    numbers.sample = 0.5;
    numbers.step_share = 1;  // a share of the anchors has the gradient in the mean alone
    pipeline.template stage<RateStage>() = RateStage(entropy_model<R>(numbers));
    typename Pipeline<R>::Phases phases;
    phases.template of<RateStage>().noise = !context_on;
    phases.template of<RateStage>().context = context_on;
    phases.template of<RateStage>().iteration = 3;
    SerialExecutor executor;
    using Context = typename Pipeline<R>::Context;
    compmark::testing::check_directional_derivative(
        model,
        [&](Context& context) {
          static_cast<void>(pipeline.forward(model, camera, 1, context, executor, phases));
          return pipeline.loss(target, {0.2, 0.01}, context, executor).total;
        },
        [&](Context& context) { pipeline.backward(model, camera, 1, context, executor); },
        // Straight-through (a sign and a threshold have no slope), or constants of a training.
        {"anchor.mask", "hash_grid", "context.box", "context.statistics"});
  }
}

TEST_CASE("model/hac: noise, then context and rate, then rounding; windows scale with the run") {
  RateNumbers numbers;
  numbers.round_after = 29000;
  const RatePhases phases(numbers, 3000);
  const auto at = [&](std::int64_t t) { return phases.at<RatePhase>(t, 1); };
  CHECK_FALSE(at(300).active());
  CHECK((at(301).noise && !at(301).context));
  CHECK((at(1000).noise && !phases.begins(1000)));
  CHECK((at(1001).context && !at(1001).noise && phases.begins(1001) && !phases.begins(1002)));
  CHECK_FALSE(at(2900).round);
  CHECK((at(2901).round && at(2901).context));
  int begins = 0;
  for (std::int64_t t = 1; t <= 3000; ++t) begins += phases.begins(t);
  CHECK(begins == 1);
}

TEST_CASE("model/hac: the same bits at any thread count and after a stop, in every phase") {
  compmark::testing::check_reproducible<SmallGridHac>();
}

TEST_CASE("model/hac: the rate is a loss: more weight, fewer bits") {
  const auto bits = [](double lambda) {
    TrainSettings settings = short_settings(300);
    settings.rate.lambda = lambda;
    BlobViews views;
    ThreadExecutor executor(2);
    Trainer<SmallGridHac, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
    REQUIRE(trainer.initialise(cloud(300, 7)));
    REQUIRE(trainer.run(views));
    ModelInfo info;
    info.base_step = {1, 0.01, 0.2};
    const Result<CodecModel> coded = coded_model(trainer.model(), info);
    REQUIRE(coded.ok());
    const Result<CodecEncoded> file = encode_hac(*coded, CodecEncodeSettings{}, executor);
    REQUIRE(file.ok());
    return file->report.ideal_bits[0] + file->report.ideal_bits[1] + file->report.ideal_bits[2];
  };
  const double free = bits(0), cheap = bits(0.02);
  MESSAGE("bits of the attributes: ", free, " at lambda 0, ", cheap, " at 0.02");
  CHECK(cheap < 0.7 * free);
}

TEST_CASE("model/hac: a trained model goes through a file and renders the same bits as the encoder's own") {
  const Model<SmallGridHac>& model = trained_hac().model;
  ModelInfo info;
  info.recipe = "hac";
  info.profile = "hac";
  info.iterations = 300;
  info.seed = 3;
  info.effects = {"alpha", "masks"};
  info.origin = {1e5, -2, 0.25};
  info.unit = 1024;
  info.up = {0, 0.6, -0.8};
  info.around_splats = true;
  info.base_step = {1, 0.01, 0.2};
  for (std::size_t i = 0; i < 5; ++i) {
    StoredView view;
    view.name = "view " + std::to_string(i);
    view.test = i % 2 == 1;
    view.camera = ring_camera(i, 5, 48, 40);
    info.views.push_back(view);
  }
  info.views[1].lens.model = LensModel::simple_radial;
  info.views[1].lens.parameters[0] = 0.125;
  ThreadExecutor executor(2);
  const Result<CodecModel> coded = coded_model(model, info);
  REQUIRE(coded.ok());
  const Result<CodecEncoded> file = encode_hac(*coded, CodecEncodeSettings{}, executor);
  REQUIRE(file.ok());
  const Result<CodecDecoded> decoded = decode_hac(file->bytes, "a.cmk", CodecDecodeSettings{}, executor);
  REQUIRE(decoded.ok());
  const Result<LoadedModel<SmallGridHac>> ours = model_from<SmallGridHac>(file->model),
                                          theirs = model_from<SmallGridHac>(decoded->model);
  REQUIRE(ours.ok());
  REQUIRE(theirs.ok());
  CHECK(same_bits(ours->model, theirs->model));
  // Its context stays in the file: coding the decoded model again would be another, worse model.
  const Result<CodecModel> twice = coded_model(theirs->model, theirs->info);
  REQUIRE_FALSE(twice.ok());
  CHECK(twice.error().problem.find("decompressed") != std::string::npos);

  const ModelInfo& read = theirs->info;
  CHECK(read.recipe == "hac");
  CHECK(read.seed == 3);
  CHECK(read.effects == info.effects);
  CHECK(read.origin == info.origin);
  CHECK(read.unit == 1024);
  CHECK(read.up == info.up);
  CHECK(read.around_splats);
  CHECK(read.base_step == info.base_step);
  REQUIRE(read.views.size() == 2);  // the test views
  CHECK(read.views[0].name == "view 1");
  CHECK(read.views[0].camera.center_world == info.views[1].camera.center_world);
  CHECK(read.views[0].lens == info.views[1].lens);

  // Steps near their base: the render moves, a little.
  Pipeline<SmallGridHac> pipeline;
  Pipeline<SmallGridHac>::Context before, after;
  const Camera<double> camera = ring_camera(2, 6, 48, 40);
  static_cast<void>(pipeline.forward(model, camera, unseen_view, before, executor));
  static_cast<void>(pipeline.forward(theirs->model, camera, unseen_view, after, executor));
  double square = 0;
  for (std::size_t i = 0; i < before.image.size(); ++i) {
    const double d = static_cast<double>(before.image.data[i] - after.image.data[i]);
    square += d * d;
  }
  const double rms = std::sqrt(square / static_cast<double>(before.image.size()));
  MESSAGE("rms difference of the render ", rms, ", file ", file->bytes.size(), " bytes, estimated ",
          file->report.estimated_bytes());
  CHECK(rms > 0);
  CHECK(rms < 0.05);
}

TEST_CASE("model/hac: masked offsets are not rendered and not stored; a model off the grid is refused") {
  Model<SmallGridHac> model = trained_hac().model;
  const MatrixView<float> mask = model.arena.values(model.template blocks<RateStage>().mask);
  Pipeline<SmallGridHac> pipeline;
  SerialExecutor executor;
  const Camera<double> camera = ring_camera(2, 6, 48, 40);
  const auto drawn = [&] {
    Pipeline<SmallGridHac>::Context context;
    const ForwardReport report = pipeline.forward(model, camera, unseen_view, context, executor);
    std::size_t count = 0;
    const GaussianColumns<const float> gaussians = std::as_const(context.gaussians).columns();
    for (std::size_t g = 0; g < gaussians.count; ++g) count += gaussians.opacity[g] > 0 ? 1 : 0;
    CHECK(report.gaussians == count);
    // Splats that are exact for a camera are those that are drawn.
    const SplatTable table = bake_at_camera(model, camera, unseen_view, executor);
    CHECK(table.count == count);
    SplatRenderer<SmallGridHac> renderer(model.render);
    const ImageView<const float> image = renderer.render(table, camera, executor);
    CHECK(psnr(ImageView<const float>(context.image), image) > 60);
    return count;
  };
  const std::size_t all = drawn();
  CAPTURE(all);
  for (std::size_t i = 0; i < mask.rows; i += 2) mask(i, 0) = mask(i, 1) = mask(i, 2) = -20;  // every other anchor
  const std::size_t fewer = drawn();
  CHECK(fewer < all);
  CHECK(fewer > 0);
  for (std::size_t i = 0; i < mask.rows; ++i) mask(i, 1) = -20;  // and one of three
  const Result<CodecModel> coded = coded_model(model, ModelInfo{});
  REQUIRE(coded.ok());
  const Result<CodecEncoded> file = encode_hac(*coded, CodecEncodeSettings{}, executor);
  REQUIRE(file.ok());
  CHECK(file->report.dropped == (mask.rows + 1) / 2);
  CHECK(file->report.unmasked_offsets == 2 * (mask.rows / 2));

  model.arena.values(model.anchors.position)(3, 1) += 0.013f;
  const Result<CodecModel> refused = coded_model(model, ModelInfo{});
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.error().field == "anchor.position[3]");
}

TEST_CASE("model/hac: what a file says of its model is checked before it is believed") {
  ThreadExecutor executor(1);
  ModelInfo info;
  info.recipe = "hac";
  const Result<CodecModel> coded = coded_model(trained_hac().model, info);
  REQUIRE(coded.ok());
  REQUIRE(model_from<SmallGridHac>(*coded).ok());
  const auto refused = [&](auto change, const std::string& field) {
    CodecModel wrong = *coded;
    change(wrong);
    const Result<LoadedModel<SmallGridHac>> loaded = model_from<SmallGridHac>(wrong);
    INFO(field);
    REQUIRE_FALSE(loaded.ok());
    CHECK(loaded.error().field.find(field) != std::string::npos);
  };
  refused([](CodecModel& m) { m.metadata.erase("recipe"); }, "META.recipe");
  refused([](CodecModel& m) { m.metadata["iterations"] = "many"; }, "META.iterations");
  refused([](CodecModel& m) { m.metadata["train_views"] = std::int64_t{-1}; }, "META");
  refused([](CodecModel& m) { m.metadata["near_plane"] = std::nan(""); }, "META");
  // Of an embedder's making: longer than its anchors are.
  refused([](CodecModel& m) { m.feature.push_back(0); }, "anchors");
  refused([](CodecModel& m) { m.scale.push_back(1); }, "anchors");
  refused([](CodecModel& m) { m.mask.pop_back(); }, "anchors");
  refused([](CodecModel& m) { m.metadata["background"] = "short"; }, "META");
  refused([](CodecModel& m) { m.metadata["effects"] = "{"; }, "META.effects");
  refused([](CodecModel& m) { m.metadata["views"] = "[[\"a\",1]]"; }, "META.views");
  refused([](CodecModel& m) { m.metadata["origin"] = "12345678"; }, "META.origin");
  CHECK(!coded->metadata.contains("unit"));  // as in files from before there was one: it is 1
  CHECK(model_info(*coded)->unit == 1);
  CHECK(!coded->metadata.contains("up"));
  CHECK(!model_info(*coded)->up);
  CHECK(!model_info(*coded)->around_splats);
  refused([](CodecModel& m) { m.metadata["up"] = detail::packed_doubles(std::array<double, 3>{1, 1, 0}); }, "META.up");
  refused([](CodecModel& m) { m.metadata["up"] = "z"; }, "META.up");
  refused([](CodecModel& m) { m.metadata["up"] = 1.0; }, "META.up");
  refused([](CodecModel& m) { m.metadata["unit"] = 0.0; }, "META.unit");
  refused([](CodecModel& m) { m.metadata["unit"] = -2.0; }, "META.unit");
  refused([](CodecModel& m) { m.metadata["unit"] = std::nan(""); }, "META.unit");
  refused([](CodecModel& m) { m.metadata["unit"] = HUGE_VAL; }, "META.unit");
  refused([](CodecModel& m) { m.metadata["unit"] = std::int64_t{2}; }, "META.unit");
  refused([](CodecModel& m) { m.networks.pop_back(); }, "NETR");
  refused([](CodecModel& m) { m.feature_dim = 9; }, "META.shape");
}
