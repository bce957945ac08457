// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What each effect of a capture costs: one whole training iteration of workload (a) of pipeline_iteration, by recipe, each beside the plain
// one. Counters: bytes of parameters with moments, bytes of scratch the context of a view holds in itself. docs/effects.md shows a copy.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <compmark/anchor/initialise.hpp>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/far_field.hpp>
#include <vector>

#include "support/ceiling.hpp"
#include "support/iteration_scene.hpp"

namespace {

using namespace compmark;

template <class R>
void iteration(benchmark::State& state) {
  ThreadExecutor executor(2);
  benchmarks::IterationScene<R> scene({30000, 400, 1.27, 0.071});
  ForwardReport report;
  for (auto _ : state) report = scene.step(executor);
  state.counters["gaussians"] = static_cast<double>(report.gaussians);
  state.counters["parameter_bytes"] = static_cast<double>(4 * sizeof(float) * scene.model.arena.layout().size());
  state.counters["context_bytes"] = static_cast<double>(sizeof(scene.context));
}

BENCHMARK_TEMPLATE(iteration, recipes::Scaffold)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldMasked)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldExposure)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldExposureMasked)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldAlpha)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldAntiAliased)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldLens)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldFisheye)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_TEMPLATE(iteration, recipes::ScaffoldFarField)->Unit(benchmark::kMillisecond)->UseRealTime();

/// What a space does cost: cells of 30,000 points, once at the start (and as many at each adjustment), beside those of the world.
template <class S>
void initial_cells(benchmark::State& state) {
  const Random random(1, 0, random_stage("benchmark points"));
  std::vector<std::array<float, 3>> points(30000);
  for (std::size_t i = 0; i < points.size(); ++i) {  // half of them outside the ball
    for (std::size_t c = 0; c < 3; ++c) points[i][c] = static_cast<float>(2.5 * random.uniform(3 * i + c) - 1.25);
  }
  for (auto _ : state) benchmark::DoNotOptimize(initial_anchors<float>(points, {0.01}, S{}));
}
BENCHMARK_TEMPLATE(initial_cells, EuclideanSpace)->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(initial_cells, ContractedSpace)->Unit(benchmark::kMillisecond);

}  // namespace
