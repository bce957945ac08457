// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which anchors of two models are the same, by features and by places: 26,535 anchors of 32 features (a chair), and
// 80,000 (a fern), against a copy whose features a mark moved by .54 in the mean, of which half was thrown away, and
// against one with noise of .5 on every feature. Features are normal numbers whose variances fall off as those of the
// chair's principal axes do (axis k has (k + 1)^-.7 of the first's), turned by a fixed rotation; the mean length is the
// chair's, 5.1. `reference` measures all pairs. `pairs/s` counts N M pairs, looked at or not; the column CPU is of all
// threads.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/nearest_rows.hpp"
#include "compmark/splat/anchor/reference_same_features.hpp"
#include "compmark/splat/anchor/same_features.hpp"

namespace {

using namespace compmark;

constexpr std::size_t features = 32;
using Same = std::vector<std::optional<std::uint32_t>>;

struct Rows {
  std::size_t rows = 0, columns = 0;
  std::vector<float> numbers;
  [[nodiscard]] MatrixView<const float> view() const { return {numbers.data(), rows, columns}; }
};

/// What is left of rows of which each is kept with probability `share`, with noise of length `moved` in the mean.
Rows attacked(const Rows& of, double share, double moved) {
  const Random random(5, 0, random_stage("bench/attacked features"));
  Rows left{0, of.columns, {}};
  const double sigma = moved / std::sqrt(static_cast<double>(of.columns));
  for (std::size_t row = 0; row < of.rows; ++row) {
    if (random.uniform(row) >= share) continue;
    for (std::size_t k = 0; k < of.columns; ++k) {
      const std::size_t at = row * of.columns + k;
      left.numbers.push_back(of.numbers[at] + static_cast<float>(sigma * random.normal(10'000'000 + at)));
    }
    ++left.rows;
  }
  return left;
}

Rows trained_features(std::size_t rows) {
  const Random random(3, 0, random_stage("bench/features"));
  std::vector<double> deviation(features);
  double sum = 0;
  for (std::size_t k = 0; k < features; ++k) {
    deviation[k] = std::pow(static_cast<double>(k + 1), -0.35);
    sum += deviation[k] * deviation[k];
  }
  for (double& one : deviation) one *= 5.1 / std::sqrt(sum);
  // A rotation: reflections along drawn directions.
  std::vector<std::vector<double>> mirrors(features, std::vector<double>(features));
  for (std::size_t m = 0; m < features; ++m) {
    double length = 0;
    for (std::size_t k = 0; k < features; ++k) {
      mirrors[m][k] = random.normal(features * m + k);
      length += mirrors[m][k] * mirrors[m][k];
    }
    for (double& one : mirrors[m]) one /= std::sqrt(length);
  }
  Rows made{rows, features, std::vector<float>(rows * features)};
  std::vector<double> row(features);
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t k = 0; k < features; ++k) row[k] = deviation[k] * random.normal(100'000 + i * features + k);
    for (const std::vector<double>& mirror : mirrors) {
      double along = 0;
      for (std::size_t k = 0; k < features; ++k) along += mirror[k] * row[k];
      for (std::size_t k = 0; k < features; ++k) row[k] -= 2 * along * mirror[k];
    }
    for (std::size_t k = 0; k < features; ++k) made.numbers[i * features + k] = static_cast<float>(row[k]);
  }
  return made;
}

/// Of anchors on surfaces: three quarters in a ball's shell, the others far around it.
Rows anchor_places(std::size_t rows) {
  const Random random(4, 0, random_stage("bench/places"));
  Rows made{rows, 3, std::vector<float>(rows * 3)};
  for (std::size_t i = 0; i < rows; ++i) {
    double place[3], length = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      place[axis] = random.normal(4 * i + axis);
      length += place[axis] * place[axis];
    }
    const double radius = i % 4 == 0 ? 1 + 20 * std::abs(random.normal(4 * i + 3)) : 1;
    for (std::size_t axis = 0; axis < 3; ++axis)
      made.numbers[3 * i + axis] = static_cast<float>(place[axis] * radius / std::sqrt(length));
  }
  return made;
}

template <class Find>
void run(benchmark::State& bench, const Rows& one, const Rows& among, const Find& find) {
  using Clock = std::chrono::steady_clock;
  double best = 1e9;
  Same same;
  for (auto _ : bench) {
    const auto start = Clock::now();
    same = find(one.view(), among.view());
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    best = std::min(best, seconds);
    bench.SetIterationTime(seconds);
  }
  bench.counters["min_ms"] = best * 1e3;
  bench.counters["pairs/s"] = static_cast<double>(one.rows) * static_cast<double>(among.rows) / best;
  bench.counters["rows/s"] = static_cast<double>(one.rows) / best;
  bench.counters["found"] =
      static_cast<double>(std::count_if(same.begin(), same.end(), [](const auto& row) { return row.has_value(); }));
}

/// Arguments: anchors, threads.
void half_left(benchmark::State& bench) {
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(1)));
  const Rows one = trained_features(static_cast<std::size_t>(bench.range(0)));
  run(bench, one, attacked(one, 0.5, 0.54), [&](auto a, auto b) { return same_features(a, b, executor); });
}
void noise(benchmark::State& bench) {
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(1)));
  const Rows one = trained_features(static_cast<std::size_t>(bench.range(0)));
  run(bench, one, attacked(one, 1, 0.5 * std::sqrt(32.0)),
      [&](auto a, auto b) { return same_features(a, b, executor); });
}
void half_left_reference(benchmark::State& bench) {
  const Rows one = trained_features(static_cast<std::size_t>(bench.range(0)));
  run(bench, one, attacked(one, 0.5, 0.54), [](auto a, auto b) { return reference_same_features(a, b); });
}
void places_half_left(benchmark::State& bench) {
  ThreadExecutor executor(static_cast<std::size_t>(bench.range(1)));
  const Rows one = anchor_places(static_cast<std::size_t>(bench.range(0)));
  run(bench, one, attacked(one, 0.5, 0), [&](auto a, auto b) { return same_places(a, b, executor); });
}

}  // namespace

BENCHMARK(half_left)
    ->ArgsProduct({{26535, 80000}, {1, 2}})
    ->UseManualTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(noise)
    ->ArgsProduct({{26535, 80000}, {1, 2}})
    ->UseManualTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(half_left_reference)
    ->Arg(26535)
    ->Arg(80000)
    ->UseManualTime()
    ->MeasureProcessCPUTime()
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);
BENCHMARK(places_half_left)
    ->ArgsProduct({{26535, 80000}, {1, 2}})
    ->UseManualTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);
