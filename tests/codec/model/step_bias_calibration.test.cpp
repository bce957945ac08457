// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A mark in the ancestors of ContextGS moves the steps of their descendants. Held, they are in the mean what they were, in the file too.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/codec/container/cmk.hpp>
#include <compmark/codec/model/adopt_networks.hpp>
#include <compmark/codec/model/step_bias_calibration.hpp>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <compmark/watermark/embed/base_model.hpp>
#include <compmark/watermark/embed/posthoc_embedding.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/coded_training.hpp"
#include "support/colour_decoder.hpp"

namespace {

using namespace compmark;
using compmark::testing::SmallContextGs;
using compmark::testing::SmallGridHac;
using Decoder = LatticeDecoder<float>;
using MarkedSteps = recipes::Marked<SmallContextGs, Decoder>;

static_assert(reads_marked_ancestors<MarkedSteps>);
static_assert(!reads_marked_ancestors<SmallContextGs>, "without a mark there is nothing to hold");
static_assert(!reads_marked_ancestors<recipes::Marked<SmallGridHac, Decoder>>, "nobody's steps hang on HAC's features");
// What a recipe does not read costs its state nothing.
static_assert(sizeof(PosthocEmbedding<recipes::Marked<SmallGridHac, Decoder>, ThreadExecutor>::State) <
              sizeof(PosthocEmbedding<MarkedSteps, ThreadExecutor>::State));

/// Means of log2 q of a file by level and group, as a reader of it has them.
std::array<double, 9> steps_of(CodecModel file) {
  const IntegerContextGs& context = *file.context_gs;
  const detail::ContextGsOrder order = detail::context_gs_order(file.voxels, context.cells);
  const auto packed = detail::pack_networks(context);
  std::vector<std::int16_t> seen(static_cast<std::size_t>(order.counts[2] + order.counts[1]) * context.geometry());
  const ContextGsRows rows = detail::context_gs_rows(file, order, seen);
  std::array<double, 9> sums{};
  std::size_t begin = 0;
  for (const detail::LevelRange& range : order.ranges()) {
    const detail::ChunkRows chunk = detail::chunk_rows(file, begin, begin + range.count);
    ContextGsEvaluator evaluator(context, packed, rows, range.part, begin);
    detail::for_predicted(evaluator, range.count, [&](std::size_t anchor, std::size_t lane) {
      for (int group = 0; group < 3; ++group)
        sums[3 * range.part + static_cast<std::size_t>(group)] +=
            evaluator.step(group, lane) / (16.0 * static_cast<double>(range.count));
      detail::visit_scalars(chunk, anchor, file.offset_count, evaluator, lane,
                            [&](int group, std::size_t channel, int index, float value) {
                              const double base_step = file.base_step[static_cast<std::size_t>(group)];
                              if (group < 2)
                                evaluator.tell(anchor, channel, detail::symbol_of(value, index, base_step).first,
                                               index);
                            });
    });
    begin += range.count;
  }
  return sums;
}
double largest(const std::array<double, 9>& a, const std::array<double, 9>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

}  // namespace

TEST_CASE(
    "model/step_bias_calibration: a mark moves the steps of a file, and calibrated they stay, to the file's own bits") {
  ThreadExecutor executor(2);
  Model<SmallContextGs> trained = compmark::testing::train_coded<SmallContextGs>(2, 300).model;
  ModelInfo info;
  info.recipe = "context_gs";
  info.base_step = {1, 0.01, 0.2};
  const auto encoded = [&](const CodecModel& coded) {
    Result<CodecEncoded> file = encode_cmk(coded, CodecEncodeSettings{}, executor);
    REQUIRE_MESSAGE(file.ok(), (file.ok() ? "" : file.error().line()));
    return std::move(file->model);
  };
  CodecModel file = [&] {
    const Result<CodecModel> coded = coded_model(trained, info);
    REQUIRE(coded.ok());
    return encoded(*coded);
  }();
  const std::array<double, 9> of_file = steps_of(file);
  leave_room_for_steps(file);
  CHECK(largest(steps_of(file), of_file) < 0.02);  // a weight has lost its last bit at most
  for (const IntegerNetwork& network : file.context_gs->network) {
    const std::vector<std::int64_t> most = network.most_hidden(IntegerContextGs::most_input);
    for (int group = 0; group < 3; ++group) {
      const std::int64_t sum = IntegerNetwork::most_sum(network.output, file.context_gs->heads.r_row(group), most);
      CHECK(sum > 0);
      CHECK(sum <= (std::int64_t{1} << 30) + 200);  // and what rounding a hundred halves adds
    }
  }
  REQUIRE(adopt_networks(file, trained).ok());
  const auto file_of = [&](const Model<MarkedSteps>& model) {
    Result<CodecModel> coded = coded_model(baked_model(model), info);
    REQUIRE(coded.ok());
    keep_context(file, *coded);
    return encoded(*coded);
  };

  Model<MarkedSteps> model = with_room_for_stages<MarkedSteps>(trained, 1);
  Pipeline<MarkedSteps> pipeline;
  pipeline.stage<RateStage>() = RateStage(entropy_model<MarkedSteps>(compmark::testing::short_settings(300).rate));
  Pipeline<MarkedSteps>::Context context;
  Pipeline<MarkedSteps>::Phases phases;
  phases.of<RateStage>() = {.context = true, .round = true};
  Pipeline<MarkedSteps>::Phases unmarked = phases;
  unmarked.of<EmbedderStage>().embeds = false;
  RateNumbers numbers;
  numbers.feature_step = info.base_step[0];
  numbers.scaling_step = info.base_step[1];
  numbers.offset_step = info.base_step[2];
  StepBiasCalibration steps;
  steps.calibrate(pipeline, phases, unmarked, numbers, model, context, executor);
  REQUIRE(steps.wanted.size() == 9);
  const CodecModel before = file_of(model);
  CHECK(before.context_gs == file.context_gs);  // nothing has moved
  const std::array<double, 9> wanted = steps_of(before);
  // What training sees of the steps is what the file has.
  double apart = 0;
  for (std::size_t i = 0; i < 9; ++i) apart = std::max(apart, std::abs(steps.wanted[i] / std::log(2.0) - wanted[i]));
  MESSAGE("means of training and file differ by ", apart, " octaves");
  CHECK(apart < 0.01);  // measured .006

  // A loud mark: what a network makes of ancestors it has not seen the like of.
  const Random random(9, 0, random_stage("test held steps"));
  const MatrixView<float> residual = model.arena.values(model.template blocks<EmbedderStage>().residual);
  for (std::size_t i = 0; i < residual.size(); ++i) residual.data[i] = static_cast<float>(random.normal(i));
  const double moved = largest(steps_of(file_of(model)), wanted);
  std::vector<double> left;
  for (int i = 0; i < 20; ++i) {
    steps.calibrate(pipeline, phases, unmarked, numbers, model, context, executor);
    left.push_back(largest(steps_of(file_of(model)), wanted));
  }
  MESSAGE("octaves from the unmarked file's steps: ", moved, ", calibrated once ", left[0], ", ten times ", left[9],
          ", twenty times ", left[19]);
  CHECK(moved > 0.2);      // negative control; measured 1.9
  CHECK(left[19] < 0.02);  // measured .005
}

TEST_CASE("model/step_bias_calibration: a run that calibrates them is the same at any thread count and after a stop") {
  Model<SmallContextGs> trained = compmark::testing::train_coded<SmallContextGs>(2, 120).model;
  TrainSettings settings = compmark::testing::short_settings(24);
  settings.grow_until = 0;
  settings.mark = posthoc_mark();
  settings.mark.message.after = settings.mark.residual.after = 0;
  settings.mark.residual.learning_rate = 0.3;  // loud at once
  settings.mark.posthoc.fidelity = 1;
  settings.mark.posthoc.calibrate_steps_every = 5;
  settings.rate.mask = settings.rate.grid = settings.rate.context = {0, 0};
  settings.rate.hyperprior = 0;
  settings.rate.noise_after = settings.rate.context_after = settings.rate.round_after = -60000;
  for (LearningRate* rate : {&settings.offset, &settings.feature, &settings.scaling, &settings.mlp_opacity,
                             &settings.mlp_covariance, &settings.mlp_color})
    *rate = {0, 0};
  compmark::testing::BlobViews views;
  const std::vector<std::uint8_t> message{1, 0, 0, 1, 1, 0, 1, 0};
  const auto begun = [&](ThreadExecutor& executor, const TrainSettings& with) {
    PosthocEmbedding<MarkedSteps, ThreadExecutor> trainer(with, executor);
    set_watermark(trainer, compmark::testing::colours(), message);
    trainer.start_from(with_room_for_stages<MarkedSteps>(trained, 1));
    return trainer;
  };
  const auto straight = [&](std::size_t threads, const TrainSettings& with) {
    ThreadExecutor executor(threads);
    auto trainer = begun(executor, with);
    REQUIRE(trainer.run(views));
    return trainer.model();
  };
  const Model<MarkedSteps> once = straight(1, settings);
  CHECK(compmark::testing::same_bits(once, straight(3, settings)));
  const auto biases = [](const Model<MarkedSteps>& model) {
    std::vector<float> all;
    for (const auto& network : model.template blocks<RateStage>().network) {
      const MatrixView<const float> bias = model.arena.values(network.bias2);
      all.insert(all.end(), bias.data, bias.data + bias.size());
    }
    return all;
  };
  TrainSettings loose = settings;
  loose.mark.posthoc.calibrate_steps_every = 0;
  const Model<SmallContextGs>& unmarked = trained;
  const Model<MarkedSteps> roomy = with_room_for_stages<MarkedSteps>(unmarked, 1);
  CHECK(biases(straight(2, loose)) == biases(roomy));  // negative control: nothing else moves them
  CHECK(biases(once) != biases(roomy));
  std::size_t others = 0;  // … and nothing but the steps' three of each level
  const std::vector<float> now = biases(once), then = biases(roomy);
  for (std::size_t i = 0; i < now.size(); ++i) {
    const std::size_t outputs = now.size() / 3;
    others += now[i] != then[i] && i % outputs < outputs - 3 ? 1 : 0;
  }
  CHECK(others == 0);

  // Whatever the cadence of reading: the first reading looks, and later ones hold.
  for (const std::int64_t every : {2, 3, 5}) {
    TrainSettings seldom = settings;
    seldom.mark.message.novel_view_every = every;
    CAPTURE(every);
    CHECK(biases(straight(2, seldom)) != biases(roomy));
  }
  // Without rounding or noise there are no steps: nothing is calibrated, and what is stopped goes on.
  TrainSettings none = settings;
  none.rate.noise_after = none.rate.context_after = none.rate.round_after = 60000;
  CHECK(biases(straight(2, none)) == biases(roomy));

  ThreadExecutor executor(2);
  auto stopped = begun(executor, settings);
  while (stopped.state().iteration < 13) REQUIRE(stopped.step(views).ok());
  ModelInfo info;
  info.recipe = "small";
  for (std::size_t i = 0; i < views.size(); ++i) info.views.push_back({std::to_string(i), false, views.camera(i), {}});
  const compmark::testing::ScratchFolder folder("compmark-step-bias-test");
  const std::filesystem::path path = folder.path / "checkpoint.safetensors";
  const auto read_back = [&](std::vector<double> wanted) {
    auto state = stopped.state();
    state.steps.wanted = std::move(wanted);
    REQUIRE(write_checkpoint(path, state, settings, info, 0).ok());
    return read_checkpoint<PosthocEmbedding<MarkedSteps, ThreadExecutor>>(path, settings, info);
  };
  auto loaded = read_back(stopped.state().steps.wanted);
  REQUIRE(loaded.ok());
  auto resumed = begun(executor, settings);
  resumed.restore(std::move(loaded->state));
  REQUIRE(resumed.run(views));
  CHECK(compmark::testing::same_bits(once, resumed.model()));
  const auto refused = [&](std::vector<double> wanted) {
    const auto found = read_back(std::move(wanted));
    return !found.ok() && found.error().field == "mark.held_steps";
  };
  CHECK_FALSE(refused({}));  // not looked yet
  CHECK(read_back({})->state.steps.wanted.empty());
  CHECK(refused({1, 2, 3}));
  CHECK(refused(std::vector<double>(9, std::numeric_limits<double>::quiet_NaN())));
}
