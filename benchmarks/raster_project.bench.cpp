// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Projection (without the sort), its backward, the depth sort and binning. `floor` is time over the larger of bytes /
// measured bandwidth and flops / measured multiply-add rate, so 1 is perfect; both are measured at start with as many
// threads (support/ceiling.hpp). Bytes a Gaussian, from the formulas in project.hpp: forward 56 + 56 read, 64 + 13 + 4
// written; backward 124 read, 56 read and written again.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/raster/bin.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/lens_view.hpp"
#include "compmark/splat/raster/project.hpp"
#include "compmark/splat/raster/project_backward.hpp"
#include "compmark/splat/raster/reference.hpp"
#include "support/ceiling.hpp"
#include "support/splat_scene.hpp"

namespace {

using namespace compmark;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

template <class T, class Effects = NoRasterEffects>
struct Problem {
  benchmarks::SplatScene<T> scene;
  ProjectionSettings<T, typename Effects::Lens> settings;
  ProjectedSplats<T> splats, scratch;
  ProjectWorkspace<T> workspace;
  TileLists lists;
  BinWorkspace bins;
  Buffer<SplatGradient<T>> sums;
  GaussianBatch<T> gradient;
  Buffer<T> norms;
  ThreadExecutor executor;

  Problem(std::size_t count, std::size_t threads)
      : scene(benchmarks::splat_scene<T>(count, 800, 5)),
        executor(threads) {
    if constexpr (!std::is_empty_v<typename Effects::Lens>) {
      settings.lens.k1 = T(-0.05);
      settings.lens.k2 = T(0.01);
    }
    for (ProjectedSplats<T>* target : {&splats, &scratch}) {
      project<accuracy::standard, T, native_width<T>, Effects>(gaussians(), scene.camera, settings, *target, workspace,
                                                               executor);
    }
    sums.resize(count, SplatGradient<T>{1, 1, 1, 1, 1, 1, 1, 1, 1, 1, {}});
    gradient.resize(count);
    gradient.set_zero();
    norms.resize(count);
  }
  [[nodiscard]] GaussianColumns<const T> gaussians() const { return scene.gaussians.columns(); }

  /// Steps 1 and 3 of project(): everything but the sort.
  template <int W>
  void forward() {
    const detail::LensView<T, typename Effects::Lens> view(scene.camera, settings.lens);
    executor.for_chunks(gaussians().count, detail::project_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      detail::find_visible<accuracy::standard, T, W, Effects>(gaussians(), view, settings, begin, end, scratch,
                                                              workspace);
    });
    executor.for_chunks(gaussians().count, detail::project_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      if (splats.count * sizeof(Splat<T>) > detail::streaming_bytes) {
        detail::write_splats<accuracy::standard, true, T, W, Effects>(gaussians(), view, settings, begin, end, splats);
      } else {
        detail::write_splats<accuracy::standard, false, T, W, Effects>(gaussians(), view, settings, begin, end, splats);
      }
    });
  }
  template <int W>
  void backward() {
    project_backward<accuracy::standard, T, W, GradientMode::add, Effects>(gaussians(), scene.camera, settings, splats,
                                                                           std::as_const(sums).span(),
                                                                           gradient.columns(), norms.span(), executor);
  }
};

/// Runs `step` and reports its best time; bytes and flops are per Gaussian.
template <class Effects = NoRasterEffects, class Step>
void run(benchmark::State& bench, double bytes, double flops, const Step& step) {
  const auto count = static_cast<std::size_t>(bench.range(0));
  Problem<float, Effects> problem(count, static_cast<std::size_t>(bench.range(1)));
  step(problem);
  double best = 1e9;
  for (auto _ : bench) {
    const auto start = Clock::now();
    step(problem);
    best = std::min(best, seconds_since(start));
  }
  const auto n = static_cast<double>(count);
  bench.counters["min_ms"] = best * 1e3;
  bench.counters["ns/Gaussian"] = best * 1e9 / n;
  bench.counters["GB/s"] = bytes * n / best * 1e-9;
  bench.counters["GFLOP/s"] = flops * n / best * 1e-9;
  if (bytes > 0) {
    bench.counters["floor"] =
        benchmarks::distance_from_floor(best, flops * n, bytes * n, static_cast<std::size_t>(bench.range(1)));
  }
  bench.SetItemsProcessed(static_cast<std::int64_t>(bench.iterations()) * static_cast<std::int64_t>(count));
}

constexpr int native = native_width<float>;

void projection_forward(benchmark::State& bench) {
  run(bench, 193, 2 * 190, [](Problem<float>& p) { p.forward<native>(); });
}
void projection_backward(benchmark::State& bench) {
  run(bench, 236, 450, [](Problem<float>& p) { p.backward<native>(); });
}
void projection_both(benchmark::State& bench) {
  run(bench, 429, 830, [](Problem<float>& p) {
    p.forward<native>();
    p.backward<native>();
  });
}
/// The same passes with each effect; projection_forward and projection_backward are "off". The image hardly changes: the
/// lens bends it by a few pixels.
template <class Effects>
void effect_forward(benchmark::State& bench) {
  run<Effects>(bench, 193, 0, [](Problem<float, Effects>& p) { p.template forward<native>(); });
}
template <class Effects>
void effect_backward(benchmark::State& bench) {
  run<Effects>(bench, 236, 0, [](Problem<float, Effects>& p) { p.template backward<native>(); });
}
using Radial = RasterEffects<RadialTangentialLens<float>>;
using Fisheye = RasterEffects<FisheyeLens<float>>;
using Mip = RasterEffects<PinholeLens, MipFilter>;
using RadialMip = RasterEffects<RadialTangentialLens<float>, MipFilter>;

void projection_both_one_lane(benchmark::State& bench) {  // the same kernels without SIMD
  run(bench, 429, 830, [](Problem<float>& p) {
    p.forward<1>();
    p.backward<1>();
  });
}
void reference_projection(
    benchmark::State& bench) {  // ReferenceRasterizer's projection: a 1 x 1 image leaves it nothing else to do
  ReferenceRasterizer<float>::Context context;
  SerialExecutor serial;
  run(bench, 0, 0, [&](Problem<float>& p) {
    std::array<float, 3> pixel{};
    ReferenceRasterizer<float>{}.forward(p.gaussians(), p.scene.camera.cropped(0, 0, 1, 1), {},
                                         ImageView<float>{pixel.data(), 3, 1, 1}, context, serial);
  });
}
void project_with_sort(benchmark::State& bench) {
  run(bench, 0, 0, [](Problem<float>& p) {
    project<accuracy::standard>(p.gaussians(), p.scene.camera, p.settings, p.splats, p.workspace, p.executor);
  });
}
/// Entries are put back (a copy of 8 bytes) before each sort.
void sort_only(benchmark::State& bench) {
  Buffer<DepthEntry<float>> entries;
  run(bench, 0, 0, [&](Problem<float>& p) {
    const std::size_t n = p.gaussians().count;
    if (entries.size() != n) {
      const detail::PinholeView<float> view(p.scene.camera);
      p.workspace.sort.entries.resize(n);
      SerialExecutor{}.for_chunks(n, detail::project_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        detail::find_visible<accuracy::standard, float, native>(p.gaussians(), view, p.settings, begin, end, p.scratch,
                                                                p.workspace);
      });
      entries = p.workspace.sort.entries;
    }
    std::copy(entries.begin(), entries.end(), p.workspace.sort.entries.begin());
    depth_sort(p.workspace.sort, chunk_count(n, detail::project_grain), detail::project_grain, detail::depth_key(1.9f),
               detail::depth_key(8.1f), p.executor);
  });
}
template <Accuracy accuracy>
void binning(benchmark::State& bench) {
  double pairs = 0;
  run(bench, 0, 0, [&](Problem<float>& p) {
    (void)bin<accuracy>(p.splats, 800, 800, BinSettings{}, p.lists, p.bins, p.executor);
    pairs = static_cast<double>(p.lists.pairs);
  });
  bench.counters["pairs"] = pairs;
}
void bin_exact_tiles(benchmark::State& bench) { binning<accuracy::standard>(bench); }
void bin_boxes(benchmark::State& bench) { binning<Accuracy{.footprint = FootprintRule::opacity_box}>(bench); }

void sizes(benchmark::internal::Benchmark* bench) {
  bench->Args({50000, 1})
      ->Args({50000, 2})
      ->Args({300000, 1})
      ->Args({300000, 2})
      ->UseRealTime()
      ->Unit(benchmark::kMillisecond);
}

}  // namespace

BENCHMARK(projection_both)->Apply(sizes);
BENCHMARK(projection_forward)->Apply(sizes);
BENCHMARK(projection_backward)->Apply(sizes);
BENCHMARK(projection_both_one_lane)->Args({300000, 2})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(reference_projection)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK(project_with_sort)->Apply(sizes);
BENCHMARK(sort_only)->Apply(sizes);
BENCHMARK(bin_exact_tiles)->Apply(sizes);
BENCHMARK(bin_boxes)->Args({50000, 2})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_forward, Radial)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_backward, Radial)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_forward, Fisheye)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_backward, Fisheye)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_forward, Mip)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_backward, Mip)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_forward, RadialMip)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_TEMPLATE(effect_backward, RadialMip)->Args({300000, 1})->UseRealTime()->Unit(benchmark::kMillisecond);
