// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What an iteration with the rate as a loss costs beside one of the same anchors (D = 50, distance input) without: the workloads of
// pipeline_iteration, and what HAC and ContextGS do in each part of a training: the noise of fixed steps, the rate (a twentieth of all anchors
// counted), and rounding. Plain and coded iterations take turns, so that a machine that slows down slows both; `times_plain` is the ratio of their
// medians. The goals are 1.5 for HAC and 2 for ContextGS. `held`: what holding the steps of ContextGS costs, once in the iterations between two holds of
// a mark (codec/model/step_bias_calibration.hpp), beside a rounded iteration of the same model.
#include <benchmark/benchmark.h>

#include <chrono>
#include <compmark/codec/model/step_bias_calibration.hpp>
#include <compmark/codec/rate/rate_phases.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/context_gs.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/watermark/decoder/lattice_decoder.hpp>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "support/iteration_scene.hpp"
#include "support/median.hpp"

namespace {

using namespace compmark;
using benchmarks::IterationScene;
using benchmarks::median;
using benchmarks::Workload;
using benchmarks::workload_a;
using benchmarks::workload_b;

/// What a training does with the attributes; the rate counts in the latter two.
enum class Stage { noise, rate, rounded };

/// A scene whose entropy model is past its beginning.
template <class R>
struct CodedScene : IterationScene<R> {
  CodedScene(const Workload& work, Stage stage) : IterationScene<R>(work) {
    RateNumbers numbers;
    numbers.noise_after = 0;
    numbers.context_after = stage == Stage::noise ? numbers.context_after : 0;
    if (stage == Stage::rounded) numbers.round_after = 0;
    schedule = RatePhases(numbers, 30000);
    this->pipeline.template stage<RateStage>() = RateStage(entropy_model<R>(numbers));
    this->model.voxel_size = 0.01;
    prepare_context<typename R::EntropyModel>(this->model, this->model.template blocks<RateStage>(), schedule, 1);
  }
  template <class E>
  void next(E& executor) {
    this->phases.template of<RateStage>() = schedule.template at<typename R::EntropyModel::Phase>(++iteration, 1);
    this->step(executor);
  }

  RatePhases schedule;
  std::int64_t iteration = 0;
};

template <class R>
void iteration(benchmark::State& state, const Workload& work, Stage stage, std::size_t threads) {
  ThreadExecutor executor(threads);
  IterationScene<typename R::Base> plain(work);
  CodedScene<R> coded(work, stage);
  const auto seconds = [](const auto& body) {
    const auto begin = std::chrono::steady_clock::now();
    body();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  // After the first a plain iteration allocates nothing; a coded one may until its sample has once been larger: a buffer grows by half then.
  for (int i = 0; i < 4; ++i) {
    plain.step(executor);
    coded.next(executor);
  }
  std::vector<double> without, with;
  for (auto _ : state) {
    without.push_back(seconds([&] { plain.step(executor); }));
    with.push_back(seconds([&] { coded.next(executor); }));
    state.SetIterationTime(with.back());
  }
  state.counters["plain_ms"] = 1e3 * median(without);
  state.counters["coded_ms"] = 1e3 * median(with);
  state.counters["times_plain"] = median(with) / median(without);
  state.counters["anchors/s"] =
      benchmark::Counter(static_cast<double>(work.anchors), benchmark::Counter::kIsIterationInvariantRate);
}

struct Hac : recipes::Hac<recipes::WithShape<recipes::Scaffold, recipes::coded_shape>> {};
struct ContextGs : recipes::ContextGs<recipes::WithShape<recipes::Scaffold, recipes::coded_shape>> {};

void held(benchmark::State& state, const Workload& work, std::size_t threads) {
  using Marked = recipes::Marked<ContextGs, LatticeDecoder<float>>;
  ThreadExecutor executor(threads);
  CodedScene<Marked> coded(work, Stage::rounded);
  const RateNumbers numbers;
  Pipeline<Marked>::Context context;
  Pipeline<Marked>::Phases unmarked = coded.phases;
  unmarked.of<EmbedderStage>().embeds = false;
  StepBiasCalibration steps;
  const auto seconds = [](const auto& body) {
    const auto begin = std::chrono::steady_clock::now();
    body();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  const auto calibrate = [&] {
    steps.calibrate(coded.pipeline, coded.phases, unmarked, numbers, coded.model, context, executor);
  };
  for (int i = 0; i < 4; ++i) {
    coded.next(executor);
    calibrate();
  }
  std::vector<double> iterations, holds;
  for (auto _ : state) {
    iterations.push_back(seconds([&] { coded.next(executor); }));
    holds.push_back(seconds(calibrate));
    state.SetIterationTime(holds.back());
  }
  state.counters["hold_ms"] = 1e3 * median(holds);
  state.counters["iteration_ms"] = 1e3 * median(iterations);
  state.counters["percent_every_50"] = 100 * median(holds) / (50 * median(iterations));
  state.counters["anchors/s"] =
      benchmark::Counter(static_cast<double>(work.anchors), benchmark::Counter::kIsIterationInvariantRate);
}

template <class R>
void add(const std::string& name) {
  const auto one = [&](const char* part, const Workload& work, Stage stage) {
    benchmark::RegisterBenchmark((name + part).c_str(), iteration<R>, work, stage, std::size_t{2})
        ->Unit(benchmark::kMillisecond)
        ->UseManualTime();
  };
  one("/a_30k_400/noise", workload_a, Stage::noise);
  one("/a_30k_400/rate", workload_a, Stage::rate);
  one("/a_30k_400/rounded", workload_a, Stage::rounded);
  one("/b_100k_800/rate", workload_b, Stage::rate);
}

}  // namespace

int main(int argc, char** argv) {
  add<Hac>("hac");
  add<ContextGs>("context_gs");
  benchmark::RegisterBenchmark("context_gs/a_30k_400/held", held, workload_a, std::size_t{2})
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
