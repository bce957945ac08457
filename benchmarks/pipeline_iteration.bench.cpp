// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One whole training iteration, without reading an image: visibility, heads, projection, binning, pixels, losses, the way back and Adam.
//   (a) 30,000 anchors x 10, 400 x 400, 150,000 Gaussians;  (b) 100,000 anchors x 10, 800 x 800, 500,000 Gaussians
// as in the performance sheet, section 6, where the sum of the floors is 22 and 77 ms and the sum of the best peers 547 and 1977 ms (two
// cores at 236 GFLOP/s together). About 60 (Gaussian, pixel) pairs a pixel are blended; the counters say how many Gaussians there are.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <compmark/core/thread_executor.hpp>
#include <compmark/pipeline/trainer.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <vector>

#include "support/ceiling.hpp"

namespace {

using namespace compmark;
using R = recipes::Scaffold;

struct Workload {
  std::size_t anchors = 30000;
  int size = 400;
  double sigma_px = 2.2;     ///< median standard deviation of a Gaussian on screen
  double opacity_shift = 0;  ///< of the opacity head's bias, so that half of the offsets are positive
};

/// Anchors in a ball in front of the camera; the opacity head is biased so that half of the offsets are positive.
struct Scene {
  explicit Scene(const Workload& work) {
    camera.width = camera.height = work.size;
    camera.fx = camera.fy = 1.4 * work.size;
    camera.cx = camera.cy = 0.5 * work.size;
    camera.center_world = {0, 0, -4};
    model.create(work.anchors, 1);
    R::GaussianDecoder::initialise(model.arena, model.decoder, 1);
    const MatrixView<float> bias = model.arena.values(model.decoder.opacity.bias2);
    for (std::size_t k = 0; k < bias.columns; ++k) bias(0, k) -= static_cast<float>(work.opacity_shift);
    const AnchorColumns<float> columns = anchor_values(model.arena, model.anchors);
    const Random random(1234, 0, random_stage("benchmark scene"));
    const double base = work.sigma_px * 4.0 / (1.4 * work.size);
    for (std::size_t i = 0; i < work.anchors; ++i) {
      for (std::size_t a = 0; a < 3; ++a)
        columns.position(i, a) = static_cast<float>(2.4 * random.uniform(9 * i + a) - 1.2);
      for (std::size_t c = 0; c < columns.offset.columns; ++c)
        columns.offset(i, c) = static_cast<float>(random.normal(1000003 * (c + 1) + i));
      for (std::size_t c = 0; c < 6; ++c) {
        columns.scaling(i, c) = static_cast<float>(
            std::log(2 * base) + 0.6 * random.normal(77777777 + 6 * i + c));  // times a sigmoid of about 1/2
      }
      for (std::size_t c = 0; c < columns.feature.columns; ++c)
        columns.feature(i, c) = static_cast<float>(2 * random.normal(900000000 + 32 * i + c));
    }
    target_storage.resize(3 * static_cast<std::size_t>(work.size * work.size));
    for (std::size_t i = 0; i < target_storage.size(); ++i) target_storage[i] = static_cast<float>(random.uniform(i));
    target = {target_storage.data(), 3, work.size, work.size};
    optimizer.prepare(model.arena.layout(), adam);
    rates.assign(model.arena.layout().blocks().size(), 1e-9);  // steps of full cost that leave the scene as it is
  }

  Model<R> model;
  Camera<double> camera;
  Buffer<float> target_storage;
  ImageView<const float> target;
  R::Optimizer optimizer;
  R::Optimizer::State adam;
  std::vector<double> rates;
  Pipeline<R> pipeline;
  Pipeline<R>::Context context;
};

void iteration(benchmark::State& state, const Workload& work, std::size_t threads) {
  ThreadExecutor executor(threads);
  Scene scene(work);
  ForwardReport report;
  for (auto _ : state) {
    report = scene.pipeline.forward(scene.model, scene.camera, 0, scene.context, executor);
    benchmark::DoNotOptimize(scene.pipeline.loss(scene.target, {}, scene.context, executor));
    scene.pipeline.backward(scene.model, scene.camera, 0, scene.context, executor);
    scene.optimizer.step(scene.model.arena, scene.rates, scene.adam, executor, {.zero_gradients_after = true});
  }
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
  for (auto _ : state)
    benchmark::DoNotOptimize(scene.pipeline.forward(scene.model, scene.camera, 0, scene.context, executor));
  state.counters["frames/s"] = benchmark::Counter(1, benchmark::Counter::kIsIterationInvariantRate);
}

constexpr Workload workload_a{30000, 400, 1.27, 0.071};
constexpr Workload workload_b{100000, 800, 1.36, 0.071};

BENCHMARK_CAPTURE(iteration, a_30k_400_1_thread, workload_a, 1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(iteration, a_30k_400_2_threads, workload_a, 2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(iteration, b_100k_800_1_thread, workload_b, 1)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(iteration, b_100k_800_2_threads, workload_b, 2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(render, a_30k_400_2_threads, workload_a, 2)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK_CAPTURE(render, b_100k_800_2_threads, workload_b, 2)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
