// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The quantizers on the features of a million anchors (32 columns, 128 MB: beyond the caches), one thread. Bytes are
// those of the formula: rounding reads 4 and writes 4 a value, finding the scales reads 4, to and from 8-bit integers
// move 5. `floor` is time over these bytes at the measured bandwidth; divisions have no part in it. Beside them the
// plain reference, one value at a time, and the naive formula that compilers make vectors of, which overflows at both
// ends.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "compmark/core/random.hpp"
#include "compmark/splat/quantizer/int8_quantizer.hpp"
#include "compmark/splat/quantizer/uniform_quantizer.hpp"
#include "support/ceiling.hpp"

namespace {

using namespace compmark;
using Clock = std::chrono::steady_clock;
using Uniform = UniformQuantizer<float>;
using Int8 = Int8Quantizer<float>;

constexpr std::size_t rows = 1'000'000, columns = 32, values = rows * columns;

struct Problem {
  Buffer<float> x, out;
  Buffer<std::int8_t> symbols;
  Int8::Context context;
  Problem() : x(values), out(values), symbols(values) {
    const Random random(1, 2, 3);
    for (std::size_t i = 0; i < values; ++i) x[i] = static_cast<float>(8 * random.centered(i));
    for (std::size_t i = 0; i < values; ++i) out[i] = 0, symbols[i] = 0;
  }
  [[nodiscard]] MatrixView<const float> in() const { return {x.data(), rows, columns}; }
  [[nodiscard]] MatrixView<float> result() { return {out.data(), rows, columns}; }
};
Problem& problem() {
  static Problem instance;
  return instance;
}

template <class Body>
void measure(benchmark::State& bench, double bytes_a_value, const Body& body) {
  body();
  double best = 1e9;
  for (auto _ : bench) {
    const auto start = Clock::now();
    body();
    benchmark::ClobberMemory();
    best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count());
  }
  const double bytes = bytes_a_value * static_cast<double>(values);
  bench.counters["Mvalues/s"] = static_cast<double>(values) / best * 1e-6;
  bench.counters["GB/s"] = bytes / best * 1e-9;
  bench.counters["floor"] = benchmarks::distance_from_floor(best, 0, bytes, 1);
}

void uniform(benchmark::State& bench) {
  const auto quantizer = Uniform::create({0.3});
  Problem& p = problem();
  measure(bench, 8, [&] {
    if (!quantizer->forward(p.x.span(), p.out.span())) std::abort();
  });
}
void uniform_reference(benchmark::State& bench) {
  Problem& p = problem();
  measure(bench, 8, [&] {
    for (std::size_t i = 0; i < values; ++i) p.out[i] = Uniform::value(p.x[i], 0.3f);
  });
}
void uniform_naive(benchmark::State& bench) {
  Problem& p = problem();
  measure(bench, 8, [&] {
    for (std::size_t i = 0; i < values; ++i) p.out[i] = 0.3f * std::nearbyint(p.x[i] / 0.3f);
  });
}
BENCHMARK(uniform)->Unit(benchmark::kMillisecond);
BENCHMARK(uniform_reference)->Unit(benchmark::kMillisecond);
BENCHMARK(uniform_naive)->Unit(benchmark::kMillisecond);

Int8 quantizer_of(const benchmark::State& bench) {
  return *Int8::create({Int8Scheme::affine, static_cast<Int8Channels>(bench.range(0))});
}
void int8_fit(benchmark::State& bench) {
  const Int8 quantizer = quantizer_of(bench);
  Problem& p = problem();
  measure(bench, 4, [&] {
    if (!quantizer.fit(p.in(), p.context)) std::abort();
  });
}
void int8_forward(benchmark::State& bench) {
  const Int8 quantizer = quantizer_of(bench);
  Problem& p = problem();
  measure(bench, 12, [&] {
    if (!quantizer.forward(p.in(), p.result(), p.context)) std::abort();
  });
}
void int8_encode(benchmark::State& bench) {
  const Int8 quantizer = quantizer_of(bench);
  Problem& p = problem();
  if (!quantizer.fit(p.in(), p.context)) std::abort();
  measure(bench, 5, [&] { quantizer.encode(p.in(), p.context, p.symbols.span()); });
}
void int8_decode(benchmark::State& bench) {
  const Int8 quantizer = quantizer_of(bench);
  Problem& p = problem();
  if (!quantizer.fit(p.in(), p.context)) std::abort();
  quantizer.encode(p.in(), p.context, p.symbols.span());
  measure(bench, 5, [&] { quantizer.decode(p.symbols.span(), p.context, p.result()); });
}
void int8_reference(benchmark::State& bench) {
  const Int8 quantizer = *Int8::create({});
  Problem& p = problem();
  measure(bench, 12, [&] {
    float low = 0, high = 0;
    for (std::size_t i = 0; i < values; ++i) low = std::min(low, p.x[i]), high = std::max(high, p.x[i]);
    const Int8::Scale scale = quantizer.scale_of(low, high);
    for (std::size_t i = 0; i < values; ++i) p.out[i] = Int8::value(p.x[i], scale);
  });
}
// 0: a scale a tensor, 1: a row, 2: a column
BENCHMARK(int8_fit)->ArgName("channels")->DenseRange(0, 2)->Unit(benchmark::kMillisecond);
BENCHMARK(int8_forward)->ArgName("channels")->DenseRange(0, 2)->Unit(benchmark::kMillisecond);
BENCHMARK(int8_encode)->ArgName("channels")->DenseRange(0, 2)->Unit(benchmark::kMillisecond);
BENCHMARK(int8_decode)->ArgName("channels")->DenseRange(0, 2)->Unit(benchmark::kMillisecond);
BENCHMARK(int8_reference)->Unit(benchmark::kMillisecond);

}  // namespace
