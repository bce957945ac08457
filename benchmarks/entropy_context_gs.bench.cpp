// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ContextGS while training, D = 50, K = 10, z of 12: 100,000 anchors on a surface, of which 20,000 neighbours are
// visible and half of these have a gradient; `sample` in thousandths of all anchors. HAC on the same anchors stands
// beside. `looked_at` are entries: visible, sampled, and the parents of both. Operations are those of the networks: 2
// (7,400) an entry forward, twice that backward, 35,000 and 70,000 more where the rate counts, and 12 scalars of the
// prior of 1,500 each. Below: the levels, which an iteration pays only when something changed, and the prior in packs
// beside the same in scalars.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "compmark/codec/context_gs/context_gs_model.hpp"
#include "compmark/codec/hac/hac_model.hpp"
#include "compmark/core/thread_executor.hpp"
#include "support/ceiling.hpp"

namespace {

using namespace compmark;
using Clock = std::chrono::steady_clock;

constexpr std::size_t visible_anchors = 20000;
constexpr double voxel_size = 0.001;

/// Voxels of a bumpy sphere, in no order; the first coordinate of a direction tells who is visible.
std::vector<Voxel> surface(std::size_t n) {
  const Random random(3, 0, 0);
  std::vector<Voxel> voxels(n);
  for (std::size_t i = 0; i < n; ++i) {
    double d[3], norm = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      d[axis] = random.normal(3 * i + axis);
      norm += d[axis] * d[axis];
    }
    const double radius = 800 * (1 + 0.1 * std::sin(9 * d[0] / std::sqrt(norm))) / std::sqrt(norm);
    for (std::size_t axis = 0; axis < 3; ++axis)
      voxels[i][axis] = static_cast<std::int32_t>(std::lround(radius * d[axis]));
  }
  return voxels;
}

template <class Model>
struct Problem {
  ParameterArena<float> arena;
  BlockHandle position, offset, scaling, feature;
  typename Model::Handles handles;
  Model model;
  typename Model::Context context;
  std::vector<std::uint32_t> rows;
  Buffer<float> f, s, o, df, ds, d_o;
  ThreadExecutor executor;
  RatePhase phase{.context = true, .seed = 1, .iteration = 1};
  std::size_t anchors;
  RateReport report;

  Problem(std::size_t n, std::size_t threads, double sample)
      : model([&] {
          typename Model::Settings settings;
          settings.sample = sample;
          return settings;
        }()),
        executor(threads),
        anchors(n) {
    position =
        arena.add("anchor.position", anchors, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    offset = arena.add("anchor.offset", anchors, 30, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    scaling = arena.add("anchor.scaling", anchors, 6, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    feature =
        arena.add("anchor.feature", anchors, 50, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    handles = Model::add_parameters(arena, anchors);
    Model::initialise(arena, handles, 1);
    const auto fill = [&](BlockHandle block, double mean, double deviation) {
      const Random random(2, 0, block.index);
      std::size_t i = 0;
      for (float& value : arena.values(block).flat()) value = static_cast<float>(mean + deviation * random.normal(i++));
    };
    fill(offset, 0, 0.5);
    fill(scaling, -4, 0.5);
    fill(feature, 0, 2);
    const std::vector<Voxel> voxels = surface(anchors);
    std::vector<std::int32_t> depth;
    for (std::size_t i = 0; i < anchors; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        arena.values(position)(i, axis) = static_cast<float>(voxel_size * voxels[i][axis]);
      }
      depth.push_back(voxels[i][0]);
    }
    std::nth_element(depth.begin(), depth.begin() + static_cast<std::ptrdiff_t>(visible_anchors), depth.end());
    for (std::uint32_t i = 0; i < anchors; ++i) {
      if (voxels[i][0] < depth[visible_anchors]) rows.push_back(i);
    }
    f.resize(anchors * 50, 0.1f);
    s.resize(anchors * 6, -4.0f);
    o.resize(anchors * 30, 0.1f);
    df.resize(anchors * 50, 0.0f);
    ds.resize(anchors * 6, 0.0f);
    d_o.resize(anchors * 30, 0.0f);
    const ParameterArena<float>& values = arena;
    if constexpr (requires {
                    Model::begin_context(arena, handles, values.values(position), values.values(feature),
                                         values.values(scaling), values.values(offset), voxel_size);
                  }) {
      Model::begin_context(arena, handles, values.values(position), values.values(feature), values.values(scaling),
                           values.values(offset), voxel_size);
    } else {
      Model::begin_context(arena, handles, values.values(position), values.values(feature), values.values(scaling),
                           values.values(offset));
    }
  }
  void forward() {
    ++phase.iteration;
    report = model.forward(arena, handles, rows, phase, std::as_const(arena).values(position), {f.data(), anchors, 50},
                           {s.data(), anchors, 6}, {o.data(), anchors, 30}, context, executor);
    benchmark::DoNotOptimize(report);
  }
  /// The gradients of listed rows, anew: backward turns them in place.
  void fill_gradients() {
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const std::size_t i = rows[k];
      const float value = k % 2 == 0 ? 1e-6f : 0.0f;
      std::fill_n(df.data() + 50 * i, 50, value);
      std::fill_n(ds.data() + 6 * i, 6, value);
      std::fill_n(d_o.data() + 30 * i, 30, value);
    }
  }
  void backward() {
    model.backward(arena, handles, rows, {df.data(), anchors, 50}, {ds.data(), anchors, 6}, {d_o.data(), anchors, 30},
                   context, executor);
  }
};

/// Time is the best iteration: a shared machine's mean says more about its other users.
template <class Before, class Body>
double measure(benchmark::State& state, const Before& before, const Body& body) {
  before();
  body();
  double best = 1e9;
  for (auto _ : state) {
    before();
    const auto start = Clock::now();
    body();
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    best = std::min(best, seconds);
    state.SetIterationTime(seconds);
  }
  state.counters["best_ms"] = best * 1e3;
  return best;
}
constexpr auto nothing = [] {};

template <class Model>
void counters(benchmark::State& state, const Problem<Model>& p, double best, double passes) {
  if constexpr (requires { p.context.plan; }) {
    const ContextGsPlan& plan = p.context.plan;
    double full = 0, entries = 0;
    for (std::size_t level = 0; level < 3; ++level) {
      full += static_cast<double>(plan.full[level].count);
      entries += static_cast<double>(plan.light[level].count + plan.full[level].count);
    }
    const double flops = passes * (entries * 2 * 7400 + full * 35000) + full * 12 * 1500;
    state.counters["looked_at"] = entries;
    state.counters["sampled"] = full;
    state.counters["GFLOP/s"] = flops / best * 1e-9;
    state.counters["floor"] =
        benchmarks::distance_from_floor(best, flops, 4 * entries * 500, static_cast<std::size_t>(state.range(0)));
  }
}

template <class Model>
void forward(benchmark::State& state) {
  Problem<Model> p(100000, static_cast<std::size_t>(state.range(0)), 1e-3 * static_cast<double>(state.range(1)));
  const double best = measure(state, nothing, [&] { p.forward(); });
  counters(state, p, best, 1);
}
template <class Model>
void backward(benchmark::State& state) {
  Problem<Model> p(100000, static_cast<std::size_t>(state.range(0)), 1e-3 * static_cast<double>(state.range(1)));
  p.forward();
  const double best = measure(
      state, [&] { p.fill_gradients(); }, [&] { p.backward(); });
  counters(state, p, best, 2);
}
using ContextGs = ContextGsModel<float>;
using Hac = HacModel<float>;
BENCHMARK_TEMPLATE(forward, ContextGs)
    ->ArgsProduct({{1, 2}, {50, 150}})
    ->ArgNames({"threads", "sample"})
    ->UseManualTime();
BENCHMARK_TEMPLATE(backward, ContextGs)
    ->ArgsProduct({{1, 2}, {50, 150}})
    ->ArgNames({"threads", "sample"})
    ->UseManualTime();
BENCHMARK_TEMPLATE(forward, Hac)->ArgsProduct({{1, 2}, {50}})->ArgNames({"threads", "sample"})->UseManualTime();
BENCHMARK_TEMPLATE(backward, Hac)->ArgsProduct({{1, 2}, {50}})->ArgNames({"threads", "sample"})->UseManualTime();

void levels_choose_cells(benchmark::State& state) {
  const std::vector<Voxel> voxels = surface(static_cast<std::size_t>(state.range(0)));
  measure(state, nothing, [&] { benchmark::DoNotOptimize(choose_anchor_cells(voxels)); });
}
void levels_sort(benchmark::State& state) {
  const std::vector<Voxel> voxels = surface(static_cast<std::size_t>(state.range(0)));
  const AnchorCells cells = choose_anchor_cells(voxels);
  AnchorLevels levels;
  measure(state, nothing, [&] { levels.sort(voxels, cells); });
  levels.assign();
  for (std::size_t level = 0; level < 3; ++level) {
    state.counters["level" + std::to_string(level)] = static_cast<double>(levels.counts()[level]);
  }
}
void levels_assign(benchmark::State& state) {
  const std::vector<Voxel> voxels = surface(static_cast<std::size_t>(state.range(0)));
  AnchorLevels levels;
  levels.sort(voxels, choose_anchor_cells(voxels));
  measure(state, nothing, [&] { levels.assign(); });
}
/// What an iteration pays in which nothing changed.
void levels_kept(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  std::vector<float> position, mask(10 * n, 0.0f);
  for (const Voxel& v : surface(n)) {
    for (const std::int32_t x : v) position.push_back(static_cast<float>(voxel_size * x));
  }
  SerialExecutor serial;
  ContextGsLevels<float> levels;
  measure(state, nothing, [&] {
    levels.update(MatrixView<const float>{position.data(), n, 3}, MatrixView<const float>{mask.data(), n, 10}, {20, 50},
                  voxel_size, serial);
  });
}
BENCHMARK(levels_choose_cells)->Arg(100000)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(levels_sort)->Arg(100000)->Arg(400000)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(levels_assign)->Arg(100000)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(levels_kept)->Arg(100000)->UseManualTime()->Unit(benchmark::kMillisecond);

/// Bits and derivatives of 12 channels of 64 anchors.
template <class T>
void prior(benchmark::State& state) {
  using Prior = FactorisedPrior<T, 12>;
  std::vector<T> values(Prior::count), ready(Prior::count), sums(Prior::count), z(768), d_z(768), weight(64, T(1)),
      bits(64);
  Prior::initialise({values.data(), 12, 58}, 1);
  Prior::prepare({values.data(), 12, 58}, ready.data());
  const Random random(1, 1, 1);
  for (std::size_t i = 0; i < z.size(); ++i) z[i] = static_cast<T>(random.normal(i));
  const double best = measure(state, nothing, [&] {
    Prior::bits(ready.data(), z.data(), 64, weight.data(), bits.data(), d_z.data(), sums.data());
    benchmark::DoNotOptimize(bits.data());
  });
  state.counters["scalars/s"] = 768 / best;
}
BENCHMARK_TEMPLATE(prior, float)->UseManualTime()->Unit(benchmark::kMicrosecond);
BENCHMARK_TEMPLATE(prior, double)->UseManualTime()->Unit(benchmark::kMicrosecond);

}  // namespace
