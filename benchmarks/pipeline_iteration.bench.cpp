// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One whole training iteration, without reading an image: visibility, heads, projection, binning, pixels, losses, the
// backward pass and Adam.
//   (a) 30,000 anchors x 10, 400 x 400, 150,000 Gaussians;  (b) 100,000 anchors x 10, 800 x 800, 500,000 Gaussians
// where the sum of the floors is 22 and 77 ms and the sum of the best peers 547 and 1977 ms (two cores at 236 GFLOP/s
// together). About 60 (Gaussian, pixel) pairs a pixel are blended; the counters say how many Gaussians there are.
#include <benchmark/benchmark.h>

#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/scaffold.hpp>

#include "support/ceiling.hpp"
#include "support/iteration_scene.hpp"

namespace {

using namespace compmark;
using compmark::benchmarks::Workload;
using compmark::benchmarks::workload_a;
using compmark::benchmarks::workload_b;
using Scene = compmark::benchmarks::IterationScene<recipes::Scaffold>;

void iteration(benchmark::State& state, const Workload& work, std::size_t threads) {
  ThreadExecutor executor(threads);
  Scene scene(work);
  ForwardReport report;
  // The first allocates, and touches every page for the first time: it takes two to three times as long.
  for (int i = 0; i < 2; ++i) report = scene.step(executor);
  for (auto _ : state) report = scene.step(executor);
  state.counters["gaussians"] = static_cast<double>(report.gaussians);
  state.counters["tile_pairs"] = static_cast<double>(report.raster.pairs);
  state.counters["gaussians/s"] =
      benchmark::Counter(static_cast<double>(report.gaussians), benchmark::Counter::kIsIterationInvariantRate);
  state.counters["pixels/s"] =
      benchmark::Counter(static_cast<double>(work.size * work.size), benchmark::Counter::kIsIterationInvariantRate);
}

void render(benchmark::State& state, const Workload& work, std::size_t threads) {
  ThreadExecutor executor(threads);
  Scene scene(work);
  benchmark::DoNotOptimize(scene.pipeline.forward(scene.model, scene.camera, 0, scene.context, executor));
  for (auto _ : state)
    benchmark::DoNotOptimize(scene.pipeline.forward(scene.model, scene.camera, 0, scene.context, executor));
  state.counters["frames/s"] = benchmark::Counter(1, benchmark::Counter::kIsIterationInvariantRate);
}

BENCHMARK_CAPTURE(iteration, a_30k_400_1_thread, workload_a, 1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(iteration, a_30k_400_2_threads, workload_a, 2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(iteration, b_100k_800_1_thread, workload_b, 1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(iteration, b_100k_800_2_threads, workload_b, 2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(render, a_30k_400_2_threads, workload_a, 2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(render, b_100k_800_2_threads, workload_b, 2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
