// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// L1 + SSIM of 3 x 800 x 800, value and gradient, against its floor and its reference. Operations are counted from the
// formulas, a fused multiply-add as two, without the halo rows a band recomputes:
//   forward 225 a sample: 4 blurs of 11 + 11 taps (172), products and differences (18), the point formula (35);
//   backward 144: 3 blurs (129), the combination with x, d and sign (15). The loss's own arithmetic is 369 a sample,
//     its bytes are 16.
// `floor` is best time / (operations / multiply-add rate measured at start), so 1 is perfect; `reference` is the plain
// two-dimensional window on 3 x 96 x 96, in double, on one thread. Also the figures of merit of one view: PSNR, SSIM.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/metric/psnr.hpp"
#include "compmark/metric/ssim.hpp"
#include "compmark/splat/loss/photometric.hpp"
#include "compmark/splat/loss/reference_ssim.hpp"
#include "support/ceiling.hpp"

namespace {

using namespace compmark;

constexpr double forward_flops = 225;
constexpr double backward_flops = 144;
constexpr double sample_bytes = 16;

template <class T>
struct Problem {
  int height, width;
  std::vector<T> rendered, target, gradient;
  explicit Problem(int h, int w) : height(h), width(w) {
    const std::size_t n = 3 * static_cast<std::size_t>(h) * static_cast<std::size_t>(w);
    const Random random(1, 2, 3);
    for (std::size_t i = 0; i < n; ++i) {
      target.push_back(static_cast<T>(random.uniform(i)));
      rendered.push_back(target.back() + static_cast<T>(0.1f * random.centered(i + n)));
    }
    gradient.resize(n);
  }
  [[nodiscard]] ImageView<const T> x() const { return {rendered.data(), 3, height, width}; }
  [[nodiscard]] ImageView<const T> y() const { return {target.data(), 3, height, width}; }
  [[nodiscard]] ImageView<T> d() { return {gradient.data(), 3, height, width}; }
};

template <class Work>
double seconds_of(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

template <bool Backward>
void photometric(benchmark::State& bench) {
  Problem<float> problem(800, 800);
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(0)));
  const PhotometricLoss<float> loss;
  PhotometricLoss<float>::Context context;
  const auto run = [&] {
    if constexpr (Backward) {
      benchmark::DoNotOptimize(loss.forward_backward(problem.x(), problem.y(), 1.0f, problem.d(), context, executor));
    } else {
      benchmark::DoNotOptimize(loss.forward(problem.x(), problem.y(), context, executor));
    }
  };
  const double rate = benchmarks::ceiling(executor.concurrency()).flops;
  run();  // warm up: scratch is allocated
  double best = 1e9;
  for (auto _ : bench) {
    const double seconds = seconds_of(run);
    bench.SetIterationTime(seconds);
    best = std::min(best, seconds);
  }
  const double samples = static_cast<double>(problem.rendered.size());
  const double flops = samples * (forward_flops + (Backward ? backward_flops : 0));
  bench.SetItemsProcessed(static_cast<std::int64_t>(samples) * static_cast<std::int64_t>(bench.iterations()));
  bench.counters["best_ms"] = best * 1e3;
  bench.counters["GFLOP/s"] = flops / best * 1e-9;
  bench.counters["GB/s"] = samples * (Backward ? sample_bytes : 8) / best * 1e-9;
  bench.counters["ceiling_GFLOP/s"] = rate * 1e-9;
  bench.counters["floor"] = best / (flops / rate);
}
BENCHMARK(photometric<true>)
    ->Name("photometric/forward_backward/threads")
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(photometric<false>)
    ->Name("photometric/forward/threads")
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

void reference(benchmark::State& bench) {
  Problem<double> problem(96, 96);
  for (auto _ : bench)
    benchmark::DoNotOptimize(reference_ssim<double>(problem.x(), problem.y(), 1.0, problem.d()).mean);
  bench.SetItemsProcessed(static_cast<std::int64_t>(problem.rendered.size()) *
                          static_cast<std::int64_t>(bench.iterations()));
}
BENCHMARK(reference)->Name("photometric/reference_96x96")->Unit(benchmark::kMillisecond);

void psnr_metric(benchmark::State& bench) {
  const Problem<float> problem(800, 800);
  for (auto _ : bench) benchmark::DoNotOptimize(psnr(problem.x(), problem.y()));
}
BENCHMARK(psnr_metric)->Name("metric/psnr")->Unit(benchmark::kMillisecond);

void ssim_metric(benchmark::State& bench) {
  const Problem<float> problem(800, 800);
  for (auto _ : bench) benchmark::DoNotOptimize(ssim(problem.x(), problem.y()));
}
BENCHMARK(ssim_metric)->Name("metric/ssim")->Unit(benchmark::kMillisecond);

}  // namespace
