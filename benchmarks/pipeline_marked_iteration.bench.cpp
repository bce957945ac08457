// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What an iteration with a message as a loss costs beside one of the same anchors without: workload (a) of pipeline_iteration, 400 x 400, 48
// bits, the residual embedded and every render read. `lattice`: the shape of the decoders in weights/; `colour`: that of a decoder that is
// fitted to its scene; `hidden`: HiDDeN 64 x 8 behind one Haar level, 200 x 200; `frequency`: no message, the frequency loss alone. Their weights
// mean nothing, time does not depend on them. Plain and marked iterations take turns, so that a machine that slows down slows both; `times_plain` is the
// ratio of their medians. The goals are 2.5 for the shipped decoder and 1.25 for the frequency loss.
#include <benchmark/benchmark.h>

#include <chrono>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/watermark/decoder/decoder_winograd.hpp>
#include <compmark/watermark/decoder/hidden_decoder.hpp>
#include <compmark/watermark/loss/frequency.hpp>
#include <utility>
#include <vector>

#include "support/decoder.hpp"
#include "support/iteration_scene.hpp"
#include "support/lattices.hpp"
#include "support/median.hpp"

namespace {

using namespace compmark;
using benchmarks::IterationScene;
using benchmarks::median;
using benchmarks::workload_a;

constexpr int bits = 48;
struct WithFrequencyLoss : recipes::Scaffold {
  using FrequencyLoss = compmark::FrequencyLoss<float>;
};

/// Iterations of `marked`, whose losses are ready, and of the same scene without a mark, in turns.
template <class R>
void in_turns(benchmark::State& state, IterationScene<R>& marked) {
  ThreadExecutor executor(2);
  IterationScene<recipes::Scaffold> plain(workload_a);
  const auto seconds = [&](auto& scene) {
    const auto begin = std::chrono::steady_clock::now();
    scene.step(executor);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  seconds(plain);  // after the first nothing allocates
  seconds(marked);
  std::vector<double> without, with;
  for (auto _ : state) {
    without.push_back(seconds(plain));
    with.push_back(seconds(marked));
    state.SetIterationTime(with.back());
  }
  state.counters["plain_ms"] = 1e3 * median(without);
  state.counters["marked_ms"] = 1e3 * median(with);
  state.counters["times_plain"] = median(with) / median(without);
}

/// Every render is read, as in a training that has no sampled novel views.
template <class Decoder>
void message(benchmark::State& state, Decoder decoder) {
  IterationScene<recipes::Marked<recipes::Scaffold, Decoder>> scene(workload_a);
  scene.pipeline.template stage<MessageStage>().decoder = std::move(decoder);
  scene.pipeline.template stage<MessageStage>().message.assign(bits, 1);
  scene.phases.template of<MessageStage>().weight = 0.002;
  scene.phases.template of<HsvStage>().weight = 0.02;
  in_turns(state, scene);
}
void lattice(benchmark::State& state) { message(state, benchmarks::shipped_lattice()); }
void colour(benchmark::State& state) { message(state, benchmarks::fitted_lattice()); }
void hidden(benchmark::State& state) {
  message(state, *HiddenDecoder<bits, 64, 8, float, WinogradOrDirect>::create(testing::small_decoder(bits, 64, 8)));
}
void frequency(benchmark::State& state) {
  IterationScene<WithFrequencyLoss> scene(workload_a);
  scene.phases.of<FrequencyStage>().weight = 0.01;
  in_turns(state, scene);
}

BENCHMARK(lattice)->Name("message/lattice")->Unit(benchmark::kMillisecond)->UseManualTime();
BENCHMARK(colour)->Name("message/colour")->Unit(benchmark::kMillisecond)->UseManualTime();
BENCHMARK(hidden)->Name("message/hidden")->Unit(benchmark::kMillisecond)->UseManualTime();
BENCHMARK(frequency)->Unit(benchmark::kMillisecond)->UseManualTime();

}  // namespace
