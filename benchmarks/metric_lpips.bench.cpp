// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The convolution that LPIPS runs on, and LPIPS of two images of 800 x 800 with random weights (time does not depend on
// their values). Operations are 2 in out kernel^2 a pixel of output; `floor` is best time / (operations / multiply-add
// rate measured at start), so 1 is perfect. `reference` is the definition in plain loops.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/metric/lpips.hpp"
#include "support/ceiling.hpp"

namespace {

using namespace compmark;

template <class Work>
double seconds_of(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<float> noise(std::size_t n) {
  const Random random(1, 2, 3);
  std::vector<float> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = random.centered(i);
  return values;
}

template <class Run>
void measure(benchmark::State& bench, ThreadExecutor& executor, double flops, const Run& run) {
  const double rate = benchmarks::ceiling(executor.concurrency()).flops;
  run();  // warm up: scratch is allocated
  double best = 1e9;
  for (auto _ : bench) {
    const double seconds = seconds_of(run);
    bench.SetIterationTime(seconds);
    best = std::min(best, seconds);
  }
  bench.counters["best_ms"] = best * 1e3;
  bench.counters["GFLOP/s"] = flops / best * 1e-9;
  bench.counters["ceiling_GFLOP/s"] = rate * 1e-9;
  bench.counters["floor"] = best / (flops / rate);
}

/// Arguments: input channels, output channels, kernel, image side, threads.
void convolution(benchmark::State& bench) {
  const ConvShape shape{static_cast<int>(bench.range(0)), static_cast<int>(bench.range(1)),
                        static_cast<int>(bench.range(2)), 1, static_cast<int>(bench.range(2)) / 2};
  const int side = static_cast<int>(bench.range(3));
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(4)));
  const std::size_t pixels = static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
  const auto input = noise(static_cast<std::size_t>(shape.in) * pixels);
  const Convolution<float> layer(shape, noise(static_cast<std::size_t>(shape.out) * shape.taps()),
                                 noise(static_cast<std::size_t>(shape.out)));
  ConvInput<float> packed;
  FeatureMaps<float> maps;
  ConvScratch<float> scratch;
  const FeatureView<const float> view{input.data(), shape.in, side, side, static_cast<std::size_t>(side), pixels};
  measure(bench, executor, 2.0 * static_cast<double>(shape.taps() * static_cast<std::size_t>(shape.out) * pixels), [&] {
    packed.pack(view, shape.stride, shape.padding, executor);
    layer.resize_output(packed, maps);
    layer.forward(packed, maps.view(), scratch, executor, ReluFinish{});
  });
}
BENCHMARK(convolution)
    ->Name("conv/in/out/kernel/side/threads")
    ->Args({64, 64, 3, 200, 1})
    ->Args({64, 64, 3, 200, 2})
    ->Args({3, 64, 3, 400, 1})
    ->Args({192, 384, 3, 49, 1})
    ->Args({384, 256, 3, 49, 1})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

void reference(benchmark::State& bench) {
  constexpr std::size_t side = 64, in = 64, out = 64;
  const auto input = noise(in * (side + 2) * (side + 2)), weight = noise(out * in * 9);
  std::vector<float> output(out * side * side);
  for (auto _ : bench) {
    for (std::size_t o = 0; o < out; ++o) {
      for (std::size_t y = 0; y < side; ++y) {
        for (std::size_t x = 0; x < side; ++x) {
          float sum = 0;
          for (std::size_t c = 0; c < in; ++c) {
            for (std::size_t k = 0; k < 9; ++k) {
              sum += weight[(o * in + c) * 9 + k] * input[(c * (side + 2) + y + k / 3) * (side + 2) + x + k % 3];
            }
          }
          output[(o * side + y) * side + x] = sum;
        }
      }
    }
    benchmark::DoNotOptimize(output.data());
  }
  bench.counters["GFLOP"] =
      benchmark::Counter(2e-9 * 9 * in * out * side * side, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(reference)->Name("conv/reference_64x64x3x3_side_64")->Unit(benchmark::kMillisecond);

struct RandomWeights {
  bool squeeze = false;
  [[nodiscard]] bool has(const std::string& /*name*/) const { return squeeze; }
  [[nodiscard]] Result<std::vector<float>> floats(const std::string& /*name*/,
                                                  std::initializer_list<std::int64_t> shape) const {
    std::size_t count = 1;
    for (const std::int64_t extent : shape) count *= static_cast<std::size_t>(extent);
    auto values = noise(count);
    for (float& value : values) value *= 0.1f;
    return values;
  }
};

void lpips(benchmark::State& bench) {
  const bool squeeze = bench.range(0) != 0;
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(1)));
  const auto net = Lpips::load(RandomWeights{squeeze});
  auto a = noise(3 * 800 * 800), b = a;
  for (float& value : b) value += 0.1f;
  Lpips::Context context;
  const double flops = 2 * 2 * (squeeze ? 3.57e9 : 9.06e9);  // two images
  measure(bench, executor, flops, [&] {
    benchmark::DoNotOptimize(net->distance({a.data(), 3, 800, 800}, {b.data(), 3, 800, 800}, context, executor)->value);
  });
}
BENCHMARK(lpips)
    ->Name("lpips_800x800/squeeze/threads")
    ->Args({0, 1})
    ->Args({0, 2})
    ->Args({1, 2})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
