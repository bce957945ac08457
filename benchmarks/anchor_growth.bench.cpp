// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Growing: adding the statistics of one view (each iteration) and one adjustment (each 100 iterations), for 100,000
// anchors of 10 Gaussians, half of them decoded. `observe` reads a slot, a flag and a norm (9 bytes) and updates two
// floats (16 bytes) a Gaussian.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/growth.hpp"

namespace {

using namespace compmark;

constexpr std::size_t anchors = 100000;
constexpr std::size_t offsets = 10;

void observe(benchmark::State& bench) {
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(0)));
  const GradientGrowth<float> growth;
  GradientGrowth<float>::State state;
  growth.prepare(anchors, state);
  const Random random(1, 2, 3);
  std::vector<std::uint32_t> visible, slots;
  std::vector<float> opacity, norm;
  std::vector<std::uint8_t> on_screen;
  for (std::uint32_t a = 0; a < anchors; ++a) visible.push_back(a);
  opacity.assign(anchors, 0.5f);
  for (std::size_t block = 0; block < anchors;
       block += 16) {  // the decoder's order: 16 anchors, offset, anchor; half are opaque
    for (std::size_t k = 0; k < offsets; ++k) {
      for (std::size_t a = block; a < std::min(block + 16, anchors); ++a) {
        if (random.below(a * offsets + k, 2) == 0) slots.push_back(static_cast<std::uint32_t>(a * offsets + k));
      }
    }
  }
  for (std::size_t i = 0; i < slots.size(); ++i) {
    on_screen.push_back(random.below(i + (1u << 30), 5) != 0 ? 1 : 0);
    norm.push_back(1e-4f);
  }
  double best = 1e9;
  for (auto _ : bench) {
    const auto start = std::chrono::steady_clock::now();
    growth.observe(DecodedStatistics<float>{visible, opacity, slots}, on_screen, norm, state, executor);
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  bench.counters["min_ms"] = best * 1e3;
  bench.counters["Gaussians"] = static_cast<double>(slots.size());
  bench.counters["GB/s"] = 25e-9 * static_cast<double>(slots.size()) / best;
}

/// A scene in mid-training: a fifth of the Gaussians above the threshold, a tenth of the anchors transparent.
void adapt(benchmark::State& bench) {
  ParameterArena<float> initial;
  AnchorHandles handles;
  handles.position =
      initial.add("anchor.position", anchors, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  handles.offset = initial.add("anchor.offset", anchors, 3 * offsets, RowKind::anchor, BlockRole::rendering,
                               LearningSchedule::fixed());
  handles.scaling =
      initial.add("anchor.scaling", anchors, 6, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  handles.feature =
      initial.add("anchor.feature", anchors, 32, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  const GradientGrowth<float> growth;
  GradientGrowth<float>::State state;
  growth.prepare(anchors, state);
  const Random random(1, 2, 3);
  const AnchorColumns<float> columns = anchor_values(initial, handles);
  for (std::size_t i = 0; i < 3 * anchors; ++i) columns.position.data[i] = 4 * random.centered(i);
  for (std::size_t i = 0; i < 30 * anchors; ++i) columns.offset.data[i] = 4 * random.centered(i);
  std::fill_n(columns.scaling.data, 6 * anchors, -4.0f);
  GrowthStatistics<float>& s = state.statistics;
  for (std::size_t a = 0; a < anchors; ++a) {
    s.visits[a] = 90;
    s.opacity_sum[a] = random.below(a, 10) == 0 ? 0 : 90;
  }
  for (std::size_t slot = 0; slot < anchors * offsets; ++slot) {
    s.gradient_count[slot] = 45;
    s.gradient_sum[slot] = 45 * 0.00025f * static_cast<float>(random.uniform(slot));
  }
  GrowthReport report;
  for (auto _ : bench) {
    bench.PauseTiming();
    ParameterArena<float> arena = initial;
    GradientGrowth<float>::State now = state;
    bench.ResumeTiming();
    report = growth.adapt(arena, handles, now, {1, 1600, 0.001, {}}, [](const RowEdit&, const ArenaLayout&) {});
  }
  bench.counters["grown"] = static_cast<double>(report.grown);
  bench.counters["pruned"] = static_cast<double>(report.pruned);
  bench.counters["candidates"] = static_cast<double>(report.candidates);
}

}  // namespace

BENCHMARK(observe)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(adapt)->Unit(benchmark::kMillisecond);
