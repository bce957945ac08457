// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What each effect of a capture costs: one whole training iteration of workload (a) of pipeline_iteration by recipe,
// with one thread and with two, and the bytes of what it needs. After Google Benchmark's lines comes one table of all
// effects, off and on, which docs/effects.md shows a copy of; with repetitions its times are medians. On a quiet
// machine, in about three minutes:
//   bench_pipeline_effects --benchmark_filter=effect --benchmark_repetitions=9
//     --benchmark_enable_random_interleaving=true
// Bytes: "parameters" are values, gradients and both moments; "memory" is all that a trained view lives on, counted by
// this program's own operator new: parameters, images, scratch; "file" is the model file, of 30,000 anchors and one
// view.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/far_field.hpp>
#include <compmark/splat/anchor/initialise.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "support/iteration_scene.hpp"
#include "support/live_bytes.hpp"
#include "support/median.hpp"

namespace {

using namespace compmark;

/// The appearance embedding is a shape of the decoder and in no recipe of the library.
struct ScaffoldAppearance : DefaultRecipe<float, DecoderShape{.appearance_dim = 32}> {};

/// Bytes of the model file: written once a recipe, and removed.
template <class R>
double file_bytes(const benchmarks::IterationScene<R>& scene) {
  static const double bytes = [&] {
    ModelInfo info{"recipe", "scaffold", 30000, 0, {}, {{"view", false, scene.camera}}};
    if constexpr (!std::is_same_v<RecipeLens<R>, PinholeLens>) {
      constexpr bool fisheye = std::is_same_v<RecipeLens<R>, FisheyeLens<float>>;
      info.views[0].lens = {fisheye ? LensModel::opencv_fisheye : LensModel::opencv, {0.1}};
    }
    const std::filesystem::path path = std::filesystem::temp_directory_path() / "compmark_bench_effects.safetensors";
    if (!write_model(path, scene.model, info).ok()) return 0.0;
    const double size = static_cast<double>(std::filesystem::file_size(path));
    std::filesystem::remove(path);
    return size;
  }();
  return bytes;
}

template <class R>
void iteration(benchmark::State& state) {
  ThreadExecutor executor(static_cast<std::size_t>(state.range(0)));
  const std::ptrdiff_t before = live_bytes;
  benchmarks::IterationScene<R> scene(benchmarks::workload_a);
  ForwardReport report = scene.step(executor);  // after it nothing allocates
  // The scene has one plane for alpha and weights, whatever the recipe reads; a trainer has one for each that it does.
  const double plane = 4.0 * static_cast<double>(scene.target.plane_size());
  const double planes = present<typename R::AlphaLoss> + present<typename R::PixelWeights>;
  const double memory = static_cast<double>(live_bytes - before) + plane * (planes - 1);
  for (auto _ : state) report = scene.step(executor);
  state.counters["gaussians"] = static_cast<double>(report.gaussians);
  state.counters["parameter_bytes"] = static_cast<double>(4 * sizeof(float) * scene.model.arena.layout().size());
  state.counters["memory_bytes"] = memory + static_cast<double>(sizeof(scene.context));
  state.counters["file_bytes"] = file_bytes(scene);
}

/// Names of the rows as they are registered, the plain recipe first.
std::vector<std::string> names;

template <class R>
void effect(const char* name) {
  names.emplace_back(name);
  benchmark::RegisterBenchmark(("effect/" + names.back()).c_str(), iteration<R>)
      ->Arg(1)
      ->Arg(2)
      ->ArgName("threads")
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

/// What a space does cost: cells of 30,000 points, once at the start (and as many at each adjustment), beside those of
/// the world.
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

/// Google Benchmark's lines, and in the end the table.
class Table : public benchmark::ConsoleReporter {
 public:
  Table() : ConsoleReporter(OO_None) {}
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || run.counters.count("file_bytes") == 0) continue;
      Row& row = rows_[run.run_name.function_name];
      if (run.run_name.args == "threads:1") {
        row.one_thread.push_back(run.GetAdjustedCPUTime());  // which a busy machine changes little
      } else {
        row.two_threads.push_back(run.GetAdjustedRealTime());
      }
      row.parameters = run.counters.at("parameter_bytes");
      row.memory = std::max(row.memory, run.counters.at("memory_bytes").value);
      row.file = run.counters.at("file_bytes");
    }
  }
  void Finalize() override {
    const auto found = rows_.find("effect/" + names[0]);
    if (found == rows_.end() || rows_.size() < 2) return;
    Row& off = found->second;
    std::printf(
        "\n| effect | processor ms, one thread: off | on | ms, two threads: off | on | bytes of parameters: off | on, "
        "more "
        "| of memory: off | on, more | of the file: off | on, more |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (std::size_t i = 1; i < names.size(); ++i) {
      const auto row = rows_.find("effect/" + names[i]);
      if (row == rows_.end()) continue;
      Row& on = row->second;
      std::printf("| %s | %.1f | %.1f | %.1f | %.1f | %.0f | %.0f | %.0f | %.0f | %.0f | %.0f |\n", names[i].c_str(),
                  benchmarks::median(off.one_thread), benchmarks::median(on.one_thread),
                  benchmarks::median(off.two_threads), benchmarks::median(on.two_threads), off.parameters,
                  on.parameters - off.parameters, off.memory, on.memory - off.memory, off.file, on.file - off.file);
    }
  }

 private:
  struct Row {
    std::vector<double> one_thread, two_threads;  ///< ms
    double parameters = 0, memory = 0, file = 0;  ///< bytes
  };
  std::map<std::string, Row> rows_;
};

}  // namespace

int main(int argc, char** argv) {
  effect<recipes::Scaffold>("none");
  effect<recipes::ScaffoldMasked>("masked pixels");
  effect<recipes::ScaffoldExposure>("exposure");
  effect<recipes::ScaffoldExposureMasked>("exposure + masked pixels");
  effect<recipes::ScaffoldAlpha>("random background + alpha loss");
  effect<recipes::ScaffoldAntiAliased>("mip filter");
  effect<recipes::ScaffoldAntiAliasedMasked>("mip filter + masked pixels");
  effect<recipes::ScaffoldAlphaAntiAliased>("random background + alpha loss + mip filter");
  effect<recipes::ScaffoldLens>("radial lens");
  effect<recipes::ScaffoldFisheye>("fisheye");
  effect<ScaffoldAppearance>("appearance embedding");
  effect<recipes::ScaffoldFarField>("far field");
  effect<recipes::ScaffoldFarFieldExposure>("exposure + far field");
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  Table table;
  benchmark::RunSpecifiedBenchmarks(&table);
  benchmark::Shutdown();
  return 0;
}
