// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Adam on the 7.6 million parameters of 100,000 anchors (32 + 3 + 6 + 30 + 4 + 1 columns), the size that performance
// tables of this field use. Bytes are counted from the formula: 28 a parameter (read p, g, m, v; write p, m, v), 4 more
// for the guard's read of the gradient, 4 more to zero it. `stream` moves the same seven streams without arithmetic:
// what this machine's memory allows. `floor` is time over that of 28 bytes at the measured bandwidth, so 1 is perfect.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/optim/adam.hpp"
#include "compmark/splat/optim/reference_adam.hpp"

namespace {

using namespace compmark;

struct Problem {
  ParameterArena<float> arena;
  AdamState<float> state;
  std::vector<double> rates;
  std::size_t parameters = 0;

  explicit Problem(std::size_t anchors) {
    const std::size_t columns[] = {32, 3, 6, 30, 4, 1};
    const char* const names[] = {"feature", "position", "scaling", "offset", "rotation", "opacity"};
    for (std::size_t b = 0; b < 6; ++b)
      arena.add(names[b], anchors, columns[b], RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    parameters = 76 * anchors;
    rates.assign(6, 0.001);
    Adam<float>().prepare(arena.layout(), state);
    fill_gradients();
  }
  void fill_gradients() {
    const Random random(1, 2, 3);
    for (std::size_t i = 0; i < arena.layout().size(); ++i) arena.all_gradients()[i] = random.centered(i) * 1e-3f;
  }
};

/// The seven streams of Adam, in the same chunks, with one addition each.
void stream(Problem& problem, ThreadExecutor& executor) {
  using P = Pack<float>;
  float* const p = problem.arena.all_values().data();
  const float* const g = problem.arena.all_gradients().data();
  float* const m = problem.state.first_moment.data();
  float* const v = problem.state.second_moment.data();
  executor.for_chunks(problem.arena.layout().size() / P::width, Adam<float>::grain / P::width,
                      [&](std::size_t begin, std::size_t end, std::size_t) {
                        for (std::size_t i = begin * P::width; i < end * P::width; i += P::width) {
                          const P x = P::load(g + i);
                          (P::load(p + i) + x).store(p + i);
                          (P::load(m + i) + x).store(m + i);
                          (P::load(v + i) + x).store(v + i);
                        }
                      });
}

/// Times step, and between any two steps the bare streams, so that both see the same machine.
template <class Step>
void run(benchmark::State& bench, const Step& step, double bytes) {
  using Clock = std::chrono::steady_clock;
  const auto seconds_of = [](const auto& work) {
    const auto start = Clock::now();
    work();
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  const auto threads = static_cast<std::size_t>(bench.range(0));
  Problem problem(100000), other(100000);
  ThreadExecutor executor(threads);
  step(problem, executor);  // warm up: scratch is allocated
  double best = 1e9, best_stream = 1e9;
  for (auto _ : bench) {
    const double seconds = seconds_of([&] { step(problem, executor); });
    best = std::min(best, seconds);
    best_stream = std::min(best_stream, seconds_of([&] { stream(other, executor); }));
    bench.SetIterationTime(seconds);
  }
  const double parameters = static_cast<double>(problem.parameters);
  bench.counters["min_ms"] = best * 1e3;
  bench.counters["GB/s"] = bytes * parameters / best * 1e-9;
  bench.counters["stream_GB/s"] = 28 * parameters / best_stream * 1e-9;
  bench.counters["floor"] = best / best_stream;
  bench.SetItemsProcessed(static_cast<std::int64_t>(bench.iterations()) *
                          static_cast<std::int64_t>(problem.parameters));
}

void stream_only(benchmark::State& bench) { run(bench, stream, 28); }
void adam(benchmark::State& bench) {
  run(
      bench, [](Problem& p, ThreadExecutor& e) { Adam<float>().step(p.arena, p.rates, p.state, e); }, 32);
}
void adam_zeroing_gradients(benchmark::State& bench) {
  run(
      bench,
      [](Problem& p, ThreadExecutor& e) {
        Adam<float>().step(p.arena, p.rates, p.state, e, {false, true});
      },
      36);
}
void adam_then_fill(benchmark::State& bench) {  // what zero_gradients_after saves
  run(
      bench,
      [](Problem& p, ThreadExecutor& e) {
        Adam<float>().step(p.arena, p.rates, p.state, e);
        float* const g = p.arena.all_gradients().data();
        e.for_chunks(p.arena.layout().size(), std::size_t{1} << 16,
                     [g](std::size_t begin, std::size_t end, std::size_t) { std::fill(g + begin, g + end, 0.0f); });
      },
      36);
}
void reference(benchmark::State& bench) {
  run(
      bench, [](Problem& p, ThreadExecutor& e) { ReferenceAdam<float>().step(p.arena, p.rates, p.state, e); }, 32);
}
/// Growing: moments follow a row edit that drops every tenth anchor and adds as many.
void edit_rows(benchmark::State& bench) {
  Problem problem(100000);
  std::vector<std::uint32_t> kept;
  for (std::uint32_t a = 0; a < 100000; ++a) {
    if (a % 10 != 0) kept.push_back(a);
  }
  const ArenaLayout layout = problem.arena.layout();
  for (auto _ : bench) Adam<float>().edit_rows({kept, 10000}, layout, layout, problem.state);
}

}  // namespace

BENCHMARK(stream_only)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(adam)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(adam_zeroing_gradients)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(adam_then_fill)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(reference)->Arg(1)->UseManualTime()->Unit(benchmark::kMillisecond);
BENCHMARK(edit_rows)->Unit(benchmark::kMillisecond);
