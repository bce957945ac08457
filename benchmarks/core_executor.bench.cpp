// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Loops of one and of two threads, alone and beside busy programs, on chunks of three sizes: those of a small kernel,
// of a training step at 128 x 128 and of one at 400 x 400. Each repetition runs the loop with one thread, then with
// two; the counter ratio is the time of the two over that of the one, both medians, and worst_ratio the slowest run of
// two over the median of one. Beside two busy programs on two processors a ratio above 1 says that the second thread
// hinders: a loop that waits for every worker had 31 there in its smallest loops (docs/notebook/measured.md).
#include <benchmark/benchmark.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <thread>
#include <vector>

namespace {

using namespace compmark;

/// A chain of dependent multiply-adds, four cycles each.
__attribute__((noinline)) double work(std::size_t steps) {
  double y = 1;
  for (std::size_t i = 0; i < steps; ++i) y = y * 1.0000001 + 1e-9;
  return y;
}

/// Threads that do nothing else, for as long as it lives.
class BusyPrograms {
 public:
  explicit BusyPrograms(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      threads_.emplace_back([this] {
        while (!stop_.load(std::memory_order_relaxed)) benchmark::DoNotOptimize(work(1000));
      });
    }
  }
  BusyPrograms(const BusyPrograms&) = delete;
  BusyPrograms& operator=(const BusyPrograms&) = delete;
  ~BusyPrograms() {
    stop_.store(true);
    for (std::thread& thread : threads_) thread.join();
  }

 private:
  std::atomic<bool> stop_{false};
  std::vector<std::thread> threads_;
};

struct Loop {
  std::size_t chunks, steps;  // steps of a chunk, and of what lies between two loops
};

void beside_busy_programs(benchmark::State& state, Loop loop) {
  const BusyPrograms busy(static_cast<std::size_t>(state.range(0)));
  ThreadExecutor one(1), two(2);
  std::vector<double> sums(loop.chunks * 8);
  const auto seconds_of = [&](ThreadExecutor& executor) {
    const std::size_t loops = std::max<std::size_t>(1, 20'000'000 / (loop.chunks * loop.steps));
    const auto begin = std::chrono::steady_clock::now();
    for (std::size_t i = 0; i < loops; ++i) {
      executor.for_chunks(loop.chunks, 1,
                          [&](std::size_t chunk, std::size_t, std::size_t) { sums[8 * chunk] += work(loop.steps); });
      benchmark::DoNotOptimize(work(loop.steps));
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / static_cast<double>(loops);
  };
  seconds_of(two);  // the first loops wake threads and touch memory
  std::vector<double> of_one, of_two;
  for (auto _ : state) {
    of_one.push_back(seconds_of(one));
    of_two.push_back(seconds_of(two));
    state.SetIterationTime(of_two.back());
  }
  const auto median = [](std::vector<double>& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  state.counters["worst_ratio"] = *std::max_element(of_two.begin(), of_two.end()) / median(of_one);
  state.counters["ratio"] = median(of_two) / median(of_one);
}

constexpr Loop small{8, 3000}, middle{16, 30'000}, large{80, 100'000};
BENCHMARK_CAPTURE(beside_busy_programs, small, small)
    ->DenseRange(0, 2)
    ->Arg(4)
    ->UseManualTime()
    ->Iterations(12)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(beside_busy_programs, middle, middle)
    ->DenseRange(0, 2)
    ->Arg(4)
    ->UseManualTime()
    ->Iterations(12)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(beside_busy_programs, large, large)
    ->DenseRange(0, 2)
    ->Arg(4)
    ->UseManualTime()
    ->Iterations(12)
    ->Unit(benchmark::kMicrosecond);

}  // namespace
