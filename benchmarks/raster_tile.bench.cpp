// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Binning and the pixel loop on random splats (50,000 at 800 x 800 are 33 million blended pairs), each part and bin +
// forward + backward together; beside them the reference rasterizer on a scene that it can bear. Arguments: Gaussians,
// image size, threads.
//
// Operations are counted by lane, a multiply-add as two, on the lanes that are evaluated (16 a block and splat that
// reaches it):
//   forward 36:  w 4, b 2, sigma 3, exp 13, opacity 1, clamp 1, two comparisons 2, weight 1, transmittance 2, colour 6,
//     block test 1
//   backward 56: the same without colour 29, dot 5, difference 1, behind 2, gate 1, g 1, six sums 11, colour 6
// `from_floor` is the median against operations / multiply-add ceiling: many of them are not multiply-adds, so that 1
// is out of reach; about 2 is what the instruction mix allows. Blended are (Gaussian, pixel) pairs whose weight is not
// zero: about four fifths of the evaluated lanes here.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cstddef>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/raster/reference.hpp"
#include "compmark/splat/raster/tile.hpp"
#include "support/ceiling.hpp"
#include "support/splat_scene.hpp"

namespace {

using namespace compmark;

constexpr double forward_flops = 36;
constexpr double backward_flops = 56;
constexpr std::array<float, 3> background{0.2f, 0.3f, 0.4f};

template <Accuracy accuracy>
struct Problem {
  using R = TileRasterizer<float, accuracy>;
  int size;
  benchmarks::SplatScene<float> scene;
  ThreadExecutor executor;
  typename R::Context context;
  std::vector<float> image, d_image;
  GaussianBatch<float> gradient;

  Problem(std::size_t count, int side, std::size_t threads)
      : size(side),
        scene(benchmarks::splat_scene<float>(count, side, side / 160.0)),
        executor(threads) {
    image.resize(3 * static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
    d_image.resize(image.size());
    const Random random(1, 2, random_stage("benchmarks/raster_tile"));
    for (std::size_t i = 0; i < d_image.size(); ++i) d_image[i] = random.centered(i);
    gradient.resize(count);
    gradient.set_zero();
  }
  [[nodiscard]] GaussianColumns<const float> gaussians() { return std::as_const(scene.gaussians).columns(); }
  [[nodiscard]] ImageView<float> view() { return {image.data(), 3, size, size}; }
  [[nodiscard]] ImageView<const float> d_view() const { return {d_image.data(), 3, size, size}; }

  void project_all() {
    project<accuracy>(gaussians(), scene.camera, ProjectionSettings<float>{}, context.projected,
                      context.project_workspace, executor);
  }
  void bin_all() {
    benchmark::DoNotOptimize(
        bin<accuracy>(context.projected, size, size, BinSettings{}, context.lists, context.bin_workspace, executor)
            .ok());
  }
  void forward() { R{}.blend_forward(size, size, background, view(), context, executor); }
  void backward() { R{}.blend_backward(size, size, background, d_view(), {}, context, executor); }
  void whole() {
    R{}.forward(gaussians(), scene.camera, background, view(), context, executor);
    R{}.backward(gaussians(), scene.camera, background, d_view(), gradient.columns(), context, executor);
  }

  /// Lanes that are evaluated: 16 for every block that a splat reaches before the block is finished.
  [[nodiscard]] double lanes() const {
    std::size_t blocks = 0;
    for (std::size_t tile = 0; tile + 1 < context.first_chunk.size(); ++tile) {
      const std::size_t length = context.lists.begin[tile + 1] - context.lists.begin[tile];
      for (std::size_t chunk = 0; chunk < context.opened[tile]; ++chunk) {
        const std::size_t here = std::min<std::size_t>(length - chunk * 256, 256);
        for (const auto& words : context.chunks[context.first_chunk[tile] + chunk].blended) {
          for (std::size_t i = 0; i < (here + 63) / 64; ++i)
            blocks += static_cast<std::size_t>(std::popcount(words[i]));
        }
      }
    }
    return 16.0 * static_cast<double>(blocks);
  }
};

enum class Part { bin, forward, backward, pixels, whole };

template <Part part, Accuracy accuracy = accuracy::standard>
void raster(benchmark::State& bench) {
  const auto threads = static_cast<std::size_t>(bench.range(2));
  Problem<accuracy> problem(static_cast<std::size_t>(bench.range(0)), static_cast<int>(bench.range(1)), threads);
  problem.project_all();
  problem.bin_all();
  problem.forward();
  problem.backward();
  std::vector<double> seconds;
  for (auto _ : bench) {
    const auto start = std::chrono::steady_clock::now();
    if constexpr (part == Part::bin || part == Part::pixels) problem.bin_all();
    if constexpr (part == Part::forward || part == Part::pixels) problem.forward();
    if constexpr (part == Part::backward || part == Part::pixels) problem.backward();
    if constexpr (part == Part::whole) problem.whole();
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::sort(seconds.begin(), seconds.end());
  const double median = seconds[seconds.size() / 2];
  const double lanes = problem.lanes();
  const double flops = lanes * ((part == Part::bin || part == Part::backward ? 0 : forward_flops) +
                                (part == Part::bin || part == Part::forward ? 0 : backward_flops));
  bench.counters["median_ms"] = median * 1e3;
  bench.counters["min_ms"] = seconds.front() * 1e3;
  bench.counters["pairs/s"] = static_cast<double>(problem.context.lists.pairs) / median;
  bench.counters["pixels/s"] = static_cast<double>(bench.range(1) * bench.range(1)) / median;
  bench.counters["lanes/pixel"] = lanes / static_cast<double>(bench.range(1) * bench.range(1));
  if (flops > 0) {
    bench.counters["GFLOP/s"] = flops / median * 1e-9;
    bench.counters["from_floor"] = benchmarks::distance_from_floor(median, flops, 0, threads);
  }
}

void sizes(benchmark::internal::Benchmark* bench) {
  for (const std::int64_t side : {400, 800}) {
    for (const std::int64_t count : {10000, 50000, 200000}) bench->Args({count, side, 2});
  }
  bench->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(15);
}
void one_size(benchmark::internal::Benchmark* bench) {
  bench->Args({50000, 800, 1})->Args({50000, 800, 2})->Unit(benchmark::kMillisecond)->UseRealTime()->Iterations(15);
}

BENCHMARK(raster<Part::pixels>)->Name("bin_forward_backward")->Apply(sizes);
BENCHMARK(raster<Part::bin>)->Name("bin")->Apply(one_size);
BENCHMARK(raster<Part::forward>)->Name("forward")->Apply(one_size);
BENCHMARK(raster<Part::backward>)->Name("backward")->Apply(one_size);
BENCHMARK(raster<Part::whole>)->Name("project_to_gradient")->Apply(one_size);
BENCHMARK(raster<Part::pixels, accuracy::quality>)->Name("bin_forward_backward/quality")->Apply(one_size);
BENCHMARK(raster<Part::pixels, accuracy::draft>)->Name("bin_forward_backward/draft")->Apply(one_size);

/// The reference and the fast path on 300 Gaussians at 96 x 96, one thread: what the fast path is checked against, and
/// what it gains.
template <class R>
void small(benchmark::State& bench) {
  constexpr int side = 96;
  const auto scene = benchmarks::splat_scene<float>(300, side, 3);
  SerialExecutor serial;
  typename R::Context context;
  std::vector<float> image(3 * side * side), d_image(image.size(), 1.0f);
  GaussianBatch<float> gradient;
  gradient.resize(300);
  gradient.set_zero();
  for (auto _ : bench) {
    R{}.forward(scene.gaussians.columns(), scene.camera, background, {image.data(), 3, side, side}, context, serial);
    R{}.backward(scene.gaussians.columns(), scene.camera, background, {d_image.data(), 3, side, side},
                 gradient.columns(), context, serial);
    benchmark::DoNotOptimize(image.data());
  }
}
BENCHMARK(small<ReferenceRasterizer<float>>)->Name("small/reference")->Unit(benchmark::kMillisecond);
BENCHMARK(small<TileRasterizer<float>>)->Name("small/tile")->Unit(benchmark::kMillisecond);

}  // namespace

int main(int argc, char** argv) {
  (void)benchmarks::ceiling(1);  // before the context is printed
  (void)benchmarks::ceiling(2);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
