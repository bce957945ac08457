// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The symbol coder: speed and bits against ideal bits in long double, by size of chunk; what its grids cost (precision
// of the frequencies, levels of the deviation, positions of the mean), as the mean Kullback-Leibler divergence over
// Gaussians whose deviation is spread evenly in its logarithm; an interval from the tables against the same from erfc;
// and the adaptive binary coder. One thread.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/coder/adaptive_binary.hpp"
#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;
using Clock = std::chrono::steady_clock;

template <class T>
T tail(T a) {
  return T(0.5) * std::erfc(a / std::numbers::sqrt2_v<T>);
}
/// Probability of the bin k, by the tail that does not cancel (EN1).
template <class T>
T bin_probability(T k, T mean, T sigma) {
  const T low = std::abs(k - mean) - T(0.5);
  return tail(low / sigma) - tail((low + 1) / sigma);
}

/// Deviations 0.3 to 8 bins, means anywhere.
struct Symbols {
  std::vector<SymbolModel> models;
  std::vector<std::int32_t> values;
  std::vector<float> mean, sigma;
  double ideal = 0;  ///< bits a symbol under the true Gaussians

  explicit Symbols(std::size_t count) {
    const Random random(1, 2, 3);
    long double bits = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double octaves = std::log2(0.3) + random.uniform(4 * i) * std::log2(8 / 0.3), s = std::exp2(octaves);
      const double m = 60 * (random.uniform(4 * i + 1) - 0.5);
      const long value = std::lround(m + s * random.normal(4 * i + 2));
      const long index = std::max(0l, std::lround(8 * octaves) - GaussianTables::least_level);
      models.push_back({static_cast<std::uint16_t>(index), static_cast<std::int32_t>(std::lround(32 * m))});
      values.push_back(static_cast<std::int32_t>(value));
      mean.push_back(static_cast<float>(m));
      sigma.push_back(static_cast<float>(s));
      bits -= std::log2(bin_probability<long double>(static_cast<long double>(value), m, s));
    }
    ideal = static_cast<double>(bits) / static_cast<double>(count);
  }
};
constexpr std::size_t symbol_count = std::size_t{1} << 20;
const Symbols& symbols() {
  static const Symbols instance(symbol_count);
  return instance;
}
const GaussianTables& tables() {
  static const GaussianTables instance;
  return instance;
}

void report(benchmark::State& bench, double best, double bytes) {
  const double count = static_cast<double>(symbol_count);
  bench.counters["Msymbols/s"] = count / best * 1e-6;
  bench.counters["bits"] = 8 * bytes / count;
  bench.counters["ideal"] = symbols().ideal;
  bench.counters["above_%"] = 100 * (8 * bytes / count / symbols().ideal - 1);
}

void encode(benchmark::State& bench) {
  const auto chunk = static_cast<std::size_t>(bench.range(0));
  const std::span<const SymbolModel> models = symbols().models;
  const std::span<const std::int32_t> values = symbols().values;
  std::vector<std::uint8_t> bytes;
  double best = 1e9;
  for (auto _ : bench) {
    bytes.clear();
    const auto start = Clock::now();
    for (std::size_t i = 0; i < symbol_count; i += chunk) {
      encode_symbols(tables(), models.subspan(i, chunk), values.subspan(i, chunk), bytes);
    }
    best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count());
  }
  report(bench, best, static_cast<double>(bytes.size()));
}

void decode(benchmark::State& bench) {
  const auto chunk = static_cast<std::size_t>(bench.range(0));
  const std::span<const SymbolModel> models = symbols().models;
  std::vector<std::uint8_t> bytes;
  std::vector<std::size_t> ends{0};
  for (std::size_t i = 0; i < symbol_count; i += chunk) {
    encode_symbols(tables(), models.subspan(i, chunk), std::span(symbols().values).subspan(i, chunk), bytes);
    ends.push_back(bytes.size());
  }
  std::vector<std::int32_t> out(symbol_count);
  double best = 1e9;
  for (auto _ : bench) {
    const auto start = Clock::now();
    for (std::size_t i = 0; i < symbol_count; i += chunk) {
      const std::size_t c = i / chunk;
      const auto one = std::span<const std::uint8_t>(bytes).subspan(ends[c], ends[c + 1] - ends[c]);
      if (!decode_symbols(tables(), models.subspan(i, chunk), one, std::span(out).subspan(i, chunk))) {
        bench.SkipWithError("a chunk does not decode");
        return;
      }
    }
    best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count());
  }
  if (out != symbols().values) bench.SkipWithError("symbols differ");
  report(bench, best, static_cast<double>(bytes.size()));
}
BENCHMARK(encode)->ArgName("chunk")->RangeMultiplier(8)->Range(1 << 9, 1 << 18)->Unit(benchmark::kMillisecond);
BENCHMARK(decode)->ArgName("chunk")->RangeMultiplier(8)->Range(1 << 9, 1 << 18)->Unit(benchmark::kMillisecond);

/// Start and frequency of a symbol: what an encoder needs of its model, from the tables.
void interval_table(benchmark::State& bench) {
  const Symbols& s = symbols();
  for (auto _ : bench) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < symbol_count; ++i) {
      const GaussianTables::Place at = tables().place(s.models[i]);
      const auto interval = tables().interval(*at.table, GaussianTables::slot_at(at, s.values[i]));
      sum += interval.start ^ interval.frequency;
    }
    benchmark::DoNotOptimize(sum);
  }
  bench.SetItemsProcessed(bench.iterations() * static_cast<std::int64_t>(symbol_count));
}
/// The same from two evaluations of erfc, as the published coders do; not the same numbers on another machine (EN6).
template <class T>
void interval_erfc(benchmark::State& bench) {
  const Symbols& s = symbols();
  for (auto _ : bench) {
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < symbol_count; ++i) {
      const T low = (static_cast<T>(s.values[i]) - T(0.5) - T(s.mean[i])) / T(s.sigma[i]),
              high = low + 1 / T(s.sigma[i]);
      const auto a = static_cast<std::uint32_t>(std::lrint(tail(-low) * 65000));
      const auto b = static_cast<std::uint32_t>(std::lrint(tail(-high) * 65000));
      sum += a ^ b;
    }
    benchmark::DoNotOptimize(sum);
  }
  bench.SetItemsProcessed(bench.iterations() * static_cast<std::int64_t>(symbol_count));
}
BENCHMARK(interval_table)->Unit(benchmark::kMillisecond);
BENCHMARK(interval_erfc<float>)->Unit(benchmark::kMillisecond);
BENCHMARK(interval_erfc<double>)->Unit(benchmark::kMillisecond);

/// Tables of any grid, made when they are asked for.
class AnyGrid {
 public:
  AnyGrid(int bits, int per_octave, int phases) : bits_(bits), per_octave_(per_octave), phases_(phases) {}

  /// Bits a symbol above the entropy of the true Gaussian, escapes with a byte or two.
  [[nodiscard]] double excess(double mean, double sigma) {
    const int level = static_cast<int>(std::lround(std::log2(sigma) * per_octave_)),
              sixteenths = level * (16 / per_octave_);
    const int step = 32 / phases_, phase = step * static_cast<int>(std::lround(std::abs(mean) * phases_));
    const std::vector<std::uint32_t>& bounds = table(std::max(sixteenths, -50), phase);
    const int window = static_cast<int>(bounds.size()) / 2 - 1;
    long double bits = 0;
    const int reach = std::max(window + 2, static_cast<int>(8 * sigma) + 2);
    for (int k = -reach; k <= reach; ++k) {
      const auto p = bin_probability<long double>(k, std::abs(mean), sigma);
      if (p < 1e-30L) continue;
      const bool escaped = std::abs(k) > window;
      const std::size_t slot = escaped ? bounds.size() - 1 : static_cast<std::size_t>(k + window);
      const std::uint32_t frequency = bounds[slot] - (slot == 0 ? ~std::uint32_t{0} : bounds[slot - 1]);
      bits += p * (std::log2(p) + bits_ - std::log2(static_cast<long double>(frequency)) + (escaped ? 8 : 0));
    }
    return static_cast<double>(bits);
  }

 private:
  const std::vector<std::uint32_t>& table(int sixteenths, int phase) {
    std::vector<std::uint32_t>& bounds = made_[{sixteenths, phase}];
    if (bounds.empty()) {
      const int window = detail::window_of(sixteenths);
      bounds.resize(static_cast<std::size_t>(2 * window + 2));
      detail::gaussian_bounds(phi_, sixteenths, phase, window, bits_, bounds);
    }
    return bounds;
  }
  NormalIntegral phi_;
  int bits_, per_octave_, phases_;
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> made_;
};

/// Excess over deviations [least, most], 2000 Gaussians.
double mean_excess(AnyGrid& grid, double least, double most) {
  const Random random(5, 6, 7);
  double sum = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double sigma = least * std::exp2(random.uniform(2 * i) * std::log2(most / least));
    sum += grid.excess(random.uniform(2 * i + 1) - 0.5, sigma);
  }
  return sum / 2000;
}

void grid(benchmark::State& bench) {
  AnyGrid grid(static_cast<int>(bench.range(0)), static_cast<int>(bench.range(1)), static_cast<int>(bench.range(2)));
  double narrow = 0, middle = 0, wide = 0;
  for (auto _ : bench) {
    narrow = mean_excess(grid, 0.115, 0.3);
    middle = mean_excess(grid, 0.3, 2);
    wide = mean_excess(grid, 2, 32);
  }
  bench.counters["sigma.115-.3"] = narrow;
  bench.counters["sigma.3-2"] = middle;
  bench.counters["sigma2-32"] = wide;
}
BENCHMARK(grid)
    ->ArgNames({"bits", "levels", "phases"})
    ->ArgsProduct({{12, 14, 16, 20}, {8}, {32}})
    ->ArgsProduct({{20}, {2, 4, 8, 16}, {32}})
    ->ArgsProduct({{20}, {16}, {1, 4, 8, 16, 32}})
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

/// What the shipped tables cost above the Gaussian, grids and frequencies together.
void shipped(benchmark::State& bench) {
  double sums[3] = {};
  const double edges[4] = {0.115, 0.3, 2, 32};
  for (auto _ : bench) {
    for (int part = 0; part < 3; ++part) {
      const Random random(5, 6, 7);
      sums[part] = 0;
      for (std::uint64_t i = 0; i < 2000; ++i) {
        const double octaves =
            std::log2(edges[part]) + random.uniform(2 * i) * std::log2(edges[part + 1] / edges[part]);
        const double mean = random.uniform(2 * i + 1) - 0.5, sigma = std::exp2(octaves);
        const SymbolModel model{static_cast<std::uint16_t>(std::lround(8 * octaves) - GaussianTables::least_level),
                                static_cast<std::int32_t>(std::lround(32 * mean))};
        const int reach = static_cast<int>(8 * sigma) + 3;
        for (int k = -reach; k <= reach; ++k) {
          const auto p = static_cast<double>(bin_probability<long double>(k, mean, sigma));
          if (p > 1e-30) sums[part] += p * (std::log2(p) + ideal_bits(tables(), model, k));
        }
      }
    }
  }
  bench.counters["sigma.115-.3"] = sums[0] / 2000;
  bench.counters["sigma.3-2"] = sums[1] / 2000;
  bench.counters["sigma2-32"] = sums[2] / 2000;
}
BENCHMARK(shipped)->Iterations(1)->Unit(benchmark::kMillisecond);

void build_tables(benchmark::State& bench) {
  for (auto _ : bench) {
    const GaussianTables made;
    benchmark::DoNotOptimize(made.tables().data());
  }
}
BENCHMARK(build_tables)->Unit(benchmark::kMillisecond);

/// Bits of 64 contexts whose probabilities are spread evenly over (0, per mille / 1000).
void binary(benchmark::State& bench) {
  const Random random(8, 9, 10);
  std::vector<std::uint8_t> bits(1u << 20);
  const double most = static_cast<double>(bench.range(0)) / 1000;
  for (std::size_t i = 0; i < bits.size(); ++i) {
    bits[i] = random.uniform(i) < most * (static_cast<double>(i % 64) + 0.5) / 64 ? 1 : 0;
  }
  std::vector<std::uint8_t> bytes;
  double written = 1e9, read = 1e9;
  for (auto _ : bench) {
    std::vector<BinaryContext> contexts(64), again(64);
    const auto start = Clock::now();
    BinaryEncoder encoder;
    for (std::size_t i = 0; i < bits.size(); ++i) encoder.encode(contexts[i % 64], bits[i] != 0);
    bytes = encoder.finish();
    const auto middle = Clock::now();
    BinaryDecoder decoder(bytes);
    bool equal = true;
    for (std::size_t i = 0; i < bits.size(); ++i) equal &= decoder.decode(again[i % 64]) == (bits[i] != 0);
    read = std::min(read, std::chrono::duration<double>(Clock::now() - middle).count());
    written = std::min(written, std::chrono::duration<double>(middle - start).count());
    if (!equal || !decoder.valid()) bench.SkipWithError("bits differ");
  }
  const double count = static_cast<double>(bits.size());
  bench.counters["encode_Mbits/s"] = count / written * 1e-6;
  bench.counters["decode_Mbits/s"] = count / read * 1e-6;
  bench.counters["bits"] = 8 * static_cast<double>(bytes.size()) / count;
}
BENCHMARK(binary)->ArgName("permille")->Arg(1000)->Arg(200)->Arg(20)->Unit(benchmark::kMillisecond);

}  // namespace
