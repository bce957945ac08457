// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What reading a message costs a training iteration: forward to the logits and backward to the image, frozen, 48 bits,
// random weights (time does not depend on them). Sides are those of the network's input (no Haar level), so 128 stands
// for a render of 256. `forward_ms` is the part without the gradient. GFLOP/s are effective: 2 operations a weight and
// position, forward and backward, whatever the convolution; `floor` is best time over those operations at the
// multiply-add rate measured at start, so Winograd may be below 1. `reference` is the definition in plain loops.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <span>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/watermark/decoder/decoder_winograd.hpp"
#include "compmark/watermark/decoder/hidden_decoder.hpp"
#include "compmark/watermark/decoder/lattice_decoder.hpp"
#include "compmark/watermark/decoder/reference_decoder.hpp"
#include "support/ceiling.hpp"
#include "support/decoder.hpp"
#include "support/lattices.hpp"

namespace {

using namespace compmark;

DecoderWeights make(int width, int depth, int stem) {
  DecoderWeights weights = testing::small_decoder(48, width, depth, stem);
  weights.input.haar_levels = 0;
  return weights;
}

double operations(const DecoderWeights& weights, int side) {
  const double places = static_cast<double>(stem_size(side, weights.stem)) * stem_size(side, weights.stem);
  double sum = 0;
  for (const DecoderLayer& layer : weights.layers) sum += 2.0 * static_cast<double>(layer.weight.size()) * places;
  return sum;
}

/// Arguments: width, depth, stem, side, threads.
template <template <class> class Kernel>
void decode(benchmark::State& bench) {
  const DecoderWeights weights =
      make(static_cast<int>(bench.range(0)), static_cast<int>(bench.range(1)), static_cast<int>(bench.range(2)));
  const int side = static_cast<int>(bench.range(3));
  const std::size_t threads = static_cast<std::size_t>(bench.range(4));
  ThreadExecutor executor(threads);
  const NetworkDecoder<float, Kernel> decoder(weights, hidden_head(weights));
  typename NetworkDecoder<float, Kernel>::Context context;
  const auto image = testing::random_image<float>(side, side);
  std::vector<float> logits(48), d_logits(48, 0.1f), d_image(image.size());
  const double rate = benchmarks::ceiling(threads).flops;
  const auto now = [] { return std::chrono::steady_clock::now(); };
  double best = 1e9, best_forward = 1e9;
  const auto run = [&] {
    const auto start = now();
    decoder.forward({image.data(), 3, side, side}, logits, context, executor);
    const auto middle = now();
    decoder.backward(d_logits, {d_image.data(), 3, side, side}, context, executor);
    const double seconds = std::chrono::duration<double>(now() - start).count();
    best = std::min(best, seconds);
    best_forward = std::min(best_forward, std::chrono::duration<double>(middle - start).count());
    return seconds;
  };
  static_cast<void>(run());  // warm up: scratch is allocated
  for (auto _ : bench) bench.SetIterationTime(run());
  const double flops = 2 * operations(weights, side);
  bench.counters["best_ms"] = best * 1e3;
  bench.counters["forward_ms"] = best_forward * 1e3;
  bench.counters["GFLOP/s"] = flops / best * 1e-9;
  bench.counters["floor"] = best / (flops / rate);
}
void arguments(benchmark::internal::Benchmark* bench) {
  for (const auto& [width, depth, stem] :
       {std::array{64, 8, 1}, {32, 8, 1}, {32, 5, 1}, {64, 5, 2}, {32, 5, 2}, {64, 5, 4}}) {
    for (const int side : {64, 128, 200, 400}) bench->Args({width, depth, stem, side, 2});
  }
  bench->Args({64, 8, 1, 128, 1})->MinTime(0.3)->UseManualTime()->Unit(benchmark::kMillisecond);
}
BENCHMARK_TEMPLATE(decode, DirectConvolution)->Name("decoder_direct/width/depth/stem/side/threads")->Apply(arguments);
BENCHMARK_TEMPLATE(decode, WinogradOrDirect)->Name("decoder_winograd/width/depth/stem/side/threads")->Apply(arguments);

/// Arguments: side of the image, threads.
void lattice(benchmark::State& bench) {
  const int side = static_cast<int>(bench.range(0));
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(1)));
  const LatticeDecoder<float> decoder = benchmarks::shipped_lattice();
  LatticeDecoder<float>::Context context;
  const auto image = testing::random_image<float>(side, side);
  std::vector<float> logits(48), d_logits(48, 0.1f), d_image(image.size());
  const auto pass = [&] {
    decoder.forward({image.data(), 3, side, side}, std::span<float>(logits), context, executor);
    decoder.backward(std::span<const float>(d_logits), {d_image.data(), 3, side, side}, context, executor);
  };
  pass();  // warm up: scratch is allocated
  for (auto _ : bench) pass();
  bench.counters["pixels/s"] =
      benchmark::Counter(static_cast<double>(side) * side, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(lattice)
    ->Name("decoder_lattice/side/threads")
    ->ArgsProduct({{128, 200, 400, 800}, {1, 2}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

/// Arguments: side of the image, percent of its rows that are not background, regions that are limited (1: none),
/// threads. Every other region of random colours is held back.
void lattice_of_colour(benchmark::State& bench) {
  const int side = static_cast<int>(bench.range(0));
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(3)));
  LatticeDecoder<float> decoder = benchmarks::fitted_lattice();
  if (bench.range(2) > 1) {
    LatticeSettings settings = decoder.settings();
    settings.regions = static_cast<int>(bench.range(2));
    settings.region_limit = 1e9;
    decoder = {settings, decoder.weights()};
    LatticeDecoder<float>::Context reading;
    const auto image = testing::random_image<float>(side, side);
    decoder.pool({image.data(), 3, side, side}, reading, executor);
    std::vector<float> norm = reading.region_norm;
    std::sort(norm.begin(), norm.end());
    settings.region_limit = static_cast<double>(norm[norm.size() / 2]);
    decoder = {settings, decoder.weights()};
  }
  LatticeDecoder<float>::Context context;
  auto image = testing::random_image<float>(side, side);
  const std::size_t plane = static_cast<std::size_t>(side) * static_cast<std::size_t>(side),
                    shown = plane * static_cast<std::size_t>(bench.range(1)) / 100;
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = i % plane < shown ? image[i] : 0.f;
  std::vector<float> logits(48), d_logits(48, 0.1f), d_image(image.size());
  const auto pass = [&] {
    decoder.forward({image.data(), 3, side, side}, std::span<float>(logits), context, executor);
    decoder.backward(std::span<const float>(d_logits), {d_image.data(), 3, side, side}, context, executor);
  };
  pass();  // warm up: scratch is allocated
  for (auto _ : bench) pass();
  bench.counters["pixels/s"] =
      benchmark::Counter(static_cast<double>(plane), benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(lattice_of_colour)
    ->Name("decoder_lattice_of_colour/side/percent_shown/regions/threads")
    ->ArgsProduct({{400}, {100, 30}, {1, 24}, {1, 2}})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

void reference(benchmark::State& bench) {
  const DecoderWeights weights = make(64, 8, 1);
  const auto image = testing::random_image<float>(16, 16);
  for (auto _ : bench) benchmark::DoNotOptimize(reference_logits<float>(weights, {image.data(), 3, 16, 16}).data());
  bench.counters["GFLOP/s"] =
      benchmark::Counter(operations(weights, 16) * 1e-9, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(reference)->Name("decoder_reference/64x8/side_16_forward")->Unit(benchmark::kMillisecond);

}  // namespace
