// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the machine can do at best, measured once a program: the rate of fused multiply-adds in registers and the
// bandwidth of a triad c = a + s b over 192 MB (12 bytes an element; stores that first read their line are not counted,
// as is the custom). A kernel's floor is the larger of operations / rate and bytes / bandwidth; its distance from it is
// time / floor, so 1 is perfect.
#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/math/pack.hpp"

namespace compmark::benchmarks {

struct CeilingRate {
  double flops = 0;      ///< fused multiply-adds in float, counted as two, per second, all threads together
  double bandwidth = 0;  ///< bytes of the triad per second
};

namespace detail {

[[nodiscard]] inline double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Best of twelve trials of about 5 ms each.
[[nodiscard]] inline CeilingRate measure_ceiling(std::size_t threads) {
  using P = Pack<float>;
  ThreadExecutor executor(threads);
  constexpr std::size_t rounds = 300000;
  constexpr std::size_t chains = 12;  // enough to hide the latency, few enough for 16 registers
  constexpr std::size_t elements = std::size_t{1} << 24;
  std::vector<float> sink(threads * 16);
  Buffer<float> a(elements), b(elements), c(elements);
  executor.for_chunks(elements, elements / 64, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t i = begin; i < end; ++i) a[i] = b[i] = c[i] = 1.0f;
  });
  CeilingRate best;
  for (int trial = 0; trial < 12; ++trial) {
    auto start = std::chrono::steady_clock::now();
    executor.for_chunks(threads, 1, [&](std::size_t chunk, std::size_t, std::size_t) {
      const P factor(0.999f), term(0.001f);
      P x[chains];
      for (std::size_t k = 0; k < chains; ++k) x[k] = P(static_cast<float>(k));
      for (std::size_t i = 0; i < rounds; ++i) {
        for (P& value : x) value = fma(value, factor, term);
      }
      P sum(0.0f);
      for (const P& value : x) sum += value;
      sink[chunk * 16] = reduce_add(sum);
    });
    const double work = 2.0 * static_cast<double>(chains * rounds * threads) * P::width;
    best.flops = std::max(best.flops, work / seconds_since(start));
    benchmark::DoNotOptimize(sink.data());
    if (trial % 3 != 0) continue;
    start = std::chrono::steady_clock::now();
    executor.for_chunks(elements, elements / 64, [&](std::size_t begin, std::size_t end, std::size_t) {
      const float* x = a.data();
      const float* y = b.data();
      float* z = c.data();
      for (std::size_t i = begin; i < end; ++i) z[i] = x[i] + 0.5f * y[i];
    });
    best.bandwidth = std::max(best.bandwidth, 12.0 * static_cast<double>(elements) / seconds_since(start));
    benchmark::DoNotOptimize(c.data());
  }
  return best;
}

}  // namespace detail

/// Measured on the first call for each number of threads, and shown in the context of the report.
[[nodiscard]] inline const CeilingRate& ceiling(std::size_t threads) {
  static std::vector<std::pair<std::size_t, CeilingRate>> known;
  for (const auto& [count, rate] : known) {
    if (count == threads) return rate;
  }
  known.reserve(64);
  known.emplace_back(threads, detail::measure_ceiling(threads));
  const CeilingRate& rate = known.back().second;
  benchmark::AddCustomContext("ceiling_" + std::to_string(threads) + "_threads",
                              std::to_string(static_cast<int>(rate.flops * 1e-9)) + " GFLOP/s, " +
                                  std::to_string(static_cast<int>(rate.bandwidth * 1e-9)) + " GB/s");
  return rate;
}

/// seconds / max(flops / rate, bytes / bandwidth).
[[nodiscard]] inline double distance_from_floor(double seconds, double flops, double bytes, std::size_t threads) {
  const CeilingRate& rate = ceiling(threads);
  return seconds / std::max(flops / rate.flops, bytes / rate.bandwidth);
}

}  // namespace compmark::benchmarks
