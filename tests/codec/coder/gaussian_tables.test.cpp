// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/coder/gaussian_tables.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "codec/coder/shared_tables.hpp"
#include "compmark/io/sha256.hpp"

namespace {

using namespace compmark;
using testing::shared_tables;

long double deviation(int index) {
  return std::exp2(static_cast<long double>(index + GaussianTables::least_level) / GaussianTables::levels_per_octave);
}
template <class T>
T normal(T z) {
  return T(0.5) * std::erfc(-z / std::numbers::sqrt2_v<T>);
}

/// All tables with their deviation and phase, in order.
template <class Visit>
void each_table(const Visit& visit) {
  for (int index = 0; index < GaussianTables::levels; ++index) {
    const int step = static_cast<int>(shared_tables().phase_step(index));
    for (int phase = 0; phase <= GaussianTables::phases / 2; phase += step) {
      const SymbolModel model{static_cast<std::uint16_t>(index), phase};
      visit(*shared_tables().place(model).table, deviation(index),
            static_cast<long double>(phase) / GaussianTables::phases);
    }
  }
}

/// Bits of a bin k under a Gaussian, in long double, by the tail that does not cancel (EN1).
long double exact_probability(long double k, long double mean, long double sigma) {
  const long double low = std::abs(k - mean) - 0.5L, high = low + 1;
  return normal(-low / sigma) - normal(-high / sigma);
}

}  // namespace

TEST_CASE(
    "coder/gaussian_tables: every frequency is at least one, their sum is 2^16, and every number finds its slot "
    "(EN7)") {
  std::size_t tables = 0;
  each_table([&](const GaussianTables::Table& table, long double, long double) {
    ++tables;
    std::uint32_t next = 0;
    const auto slots = static_cast<std::uint32_t>(2 * table.window + 2);
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
      const GaussianTables::Interval interval = shared_tables().interval(table, slot);
      REQUIRE(interval.start == next);
      REQUIRE(interval.frequency >= 1);
      REQUIRE(interval.frequency < 65536);
      next += interval.frequency;
    }
    REQUIRE(next == 65536);
    REQUIRE(shared_tables().interval(table, slots - 1).frequency == 1);
    const std::uint32_t stride = tables % 40 == 1 ? 1 : 61;
    for (std::uint32_t number = 0; number < 65536; number += stride) {
      const std::uint32_t slot = shared_tables().slot_of(table, number);
      const GaussianTables::Interval interval = shared_tables().interval(table, slot);
      REQUIRE(slot < slots);
      REQUIRE(number >= interval.start);
      REQUIRE(number < interval.start + interval.frequency);
    }
    REQUIRE(shared_tables().slot_of(table, 65535) == slots - 1);
  });
  CHECK(tables == shared_tables().tables().size());
}

TEST_CASE("coder/gaussian_tables: every entry is that of long double; entries by float are not (EN6)") {
  std::size_t entries = 0, at_a_tie = 0, float_differs = 0;
  each_table([&](const GaussianTables::Table& table, long double sigma, long double phase) {
    REQUIRE(table.window == static_cast<int>(std::ceil(5 * sigma)) + 1);
    const long double spread = 65536 - (2 * table.window + 2);
    for (int i = 0; i < 2 * table.window; ++i) {
      const long double edge = i - table.window + 0.5L - phase, exact = normal(edge / sigma) * spread;
      const long double fraction = exact - std::floor(exact);
      const auto expected = static_cast<std::uint32_t>(i + std::lround(exact));
      const GaussianTables::Interval slot = shared_tables().interval(table, static_cast<std::uint32_t>(i));
      const std::uint32_t bound = slot.start + slot.frequency - 1;
      ++entries;
      if (std::abs(fraction - 0.5L) < 0x1p-20L) {
        ++at_a_tie;
        continue;
      }
      REQUIRE(bound == expected);
      const float naive = normal(static_cast<float>(edge) / static_cast<float>(sigma)) * static_cast<float>(spread);
      float_differs += static_cast<std::uint32_t>(i + std::lround(naive)) != bound;
    }
  });
  MESSAGE(entries, " entries, ", at_a_tie, " at a tie, ", float_differs, " differ in float");
  CHECK(at_a_tie <
        100);  // 2^-19 of the entries by chance, and the mean of a table without a phase, half of an even number
  CHECK(float_differs > 20);  // one is enough to lose a chunk
}

TEST_CASE("coder/gaussian_tables: the numbers are these for ever") {
  Sha256 hash;
  each_table([&](const GaussianTables::Table& table, long double, long double) {
    for (std::uint32_t slot = 0; slot < static_cast<std::uint32_t>(2 * table.window + 2); ++slot) {
      const std::uint32_t frequency = shared_tables().interval(table, slot).frequency;
      const std::array<std::byte, 2> bytes{static_cast<std::byte>(frequency & 0xff),
                                           static_cast<std::byte>(frequency >> 8)};
      hash.update(bytes);
    }
  });
  CHECK(hash.hex() == "d08525e30c3ccd2232a90de36c3275419ab47b3cad6b92feb6361116ac987a1e");
  CHECK(shared_tables().fingerprint() == 5572591476609805153u);
}

TEST_CASE("coder/gaussian_tables: means and mirrors: bin and slot agree with the distance from the mean") {
  for (const int index : {0, 9, 17, 25, 40, 60, 81}) {
    const long double sigma = deviation(index);
    const long double coarse = static_cast<long double>(shared_tables().phase_step(index)) / 64 + 1e-6L;
    for (std::int32_t mean = -100; mean <= 100; ++mean) {
      const SymbolModel model{static_cast<std::uint16_t>(index), mean};
      const auto at = shared_tables().place(model);
      const auto centre = static_cast<std::int32_t>(std::floor((mean + 16) / 32.0));
      REQUIRE(at.centre == centre);
      long double total = 0;
      for (std::int32_t symbol = centre - at.table->window; symbol <= centre + at.table->window; ++symbol) {
        const auto slot = shared_tables().slot_at(at, symbol);
        REQUIRE(slot <= static_cast<std::uint32_t>(2 * at.table->window));
        const std::int64_t bin = static_cast<std::int64_t>(slot) - at.table->window;
        REQUIRE(at.centre + (bin ^ at.mirror) - at.mirror == symbol);
        const long double p = shared_tables().interval(*at.table, slot).frequency / 65536.0L;
        total += p;
        // The exact probability for some mean within half a phase step.
        const long double m = mean / 32.0L;
        const long double a = exact_probability(symbol, m - coarse, sigma),
                          b = exact_probability(symbol, m + coarse, sigma);
        const long double most = std::abs(symbol - m) <= coarse ? exact_probability(0, 0, sigma) : std::max(a, b);
        REQUIRE(p <= most + (2 * at.table->window + 3) / 65536.0L);
        REQUIRE(p >= std::min(a, b) * (1 - (2 * at.table->window + 3) / 65536.0L) - 1.5L / 65536);
      }
      REQUIRE(std::abs(total + 1 / 65536.0L - 1) < 1e-12L);
      REQUIRE(shared_tables().slot_at(at, centre - at.table->window - 1) ==
              static_cast<std::uint32_t>(2 * at.table->window + 1));
      REQUIRE(shared_tables().slot_at(at, centre + at.table->window + 1) ==
              static_cast<std::uint32_t>(2 * at.table->window + 1));
    }
  }
  const SymbolModel beyond{65535, 0};  // an index out of the range is the widest
  CHECK(shared_tables().place(beyond).table->window == 641);
}

TEST_CASE(
    "coder/gaussian_tables: one-hot: a bin that holds all but 1e-5 costs 1e-4 bits, and its neighbours can be coded "
    "(EN7)") {
  const SymbolModel narrow{0, 0};
  CHECK(shared_tables().slot_bits(narrow, 0) < 2e-4);
  CHECK(shared_tables().slot_bits(narrow, 1) <= 16);
  CHECK(shared_tables().slot_bits(narrow, 2) <= 16);
  // The naive table, round(p 2^16): the neighbours' frequency is 0.
  CHECK(std::lround(65536 * exact_probability(1, 0, deviation(0))) == 0);
  CHECK(static_cast<std::uint16_t>(std::lround(65536 * exact_probability(0, 0, 0.05L))) ==
        0);  // and its own does not fit
}

TEST_CASE("coder/gaussian_tables: what a table costs above its Gaussian stays below its share of slots") {
  long double worst = 0, worst_with_tails = 0;
  each_table([&](const GaussianTables::Table& table, long double sigma, long double phase) {
    long double cost = 0;
    for (int bin = -table.window; bin <= table.window; ++bin) {
      const long double p = exact_probability(bin, phase, sigma);
      const auto slot = static_cast<std::uint32_t>(bin + table.window);
      cost += p * std::log2(p * 65536 / shared_tables().interval(table, slot).frequency);
    }
    // KL divergence: slots / 2^16 is given to all alike, which costs slots / (2^16 ln 2) at most.
    const long double share = (2 * table.window + 2) / (65536 * std::numbers::ln2_v<long double>);
    worst = std::max(worst, cost / share);
    worst_with_tails = std::max(worst_with_tails, cost);
    REQUIRE(cost > -1e-6L);
  });
  MESSAGE("at most ", static_cast<double>(worst), " of the share of slots, ", static_cast<double>(worst_with_tails),
          " bits");
  CHECK(worst < 1.1L);
  CHECK(worst_with_tails < 0.03L);
}
