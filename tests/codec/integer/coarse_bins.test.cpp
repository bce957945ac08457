// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/codec/coder/bits.hpp>
#include <compmark/codec/coder/gaussian_tables.hpp>
#include <compmark/codec/coder/symbol_coder.hpp>
#include <compmark/codec/integer/coarse_bins.hpp>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

using namespace compmark;

TEST_CASE("integer/coarse_bins: a coarse bin and a bin of it cost what the symbol costs, and give it back") {
  const GaussianTables tables;
  double worst = 0, excess = 0;
  int count = 0;
  for (const std::uint8_t thirds : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3}}) {
    const std::int32_t width = CoarseSteps::width_of(thirds);
    for (std::int32_t level = -5000; level <= 12000; level += 1700) {
      for (std::int32_t mean = -3000; mean <= 3000; mean += 333) {
        const SymbolModel fine{static_cast<std::uint16_t>(HashPrediction::table(level)), mean};
        for (const std::int32_t away : {-2, 0, 1}) {
          const double sigma = std::exp2(level / 2048.0);
          const auto symbol = static_cast<std::int32_t>(std::lround(mean / 32.0 + away * sigma));
          const std::int32_t coarse = detail::coarse_symbol(symbol, width);
          REQUIRE(std::abs(symbol - coarse * width) <= width / 2);
          const detail::CoarseBin bin(tables, fine, coarse, width, -greatest_symbol);
          double sum = 0;
          for (std::int32_t k = coarse * width - width / 2; k <= coarse * width + width / 2; ++k)
            sum += bin.probability(k);
          REQUIRE(sum == doctest::Approx(1));
          detail::BitsOut out;
          REQUIRE(bin.code(out, symbol) == symbol);
          const std::vector<std::byte> bytes = out.finish();
          detail::BitsIn in(bytes);
          REQUIRE(bin.code(in, 0) == symbol);
          REQUIRE(in.complete());
          REQUIRE(std::abs(bin.middle() - 32 * std::int64_t{coarse} * width) <= 16 * width);
          const double parts = ideal_bits(tables, detail::coarse_model(mean, level, thirds), coarse) -
                               std::log2(bin.probability(symbol));
          const double more = parts - ideal_bits(tables, fine, symbol);
          worst = std::max(worst, more);
          excess += more;
          ++count;
        }
      }
    }
  }
  CAPTURE(worst);
  CHECK(std::abs(excess / count) < 0.03);
}

TEST_CASE("integer/coarse_bins: bins below the least symbol have no share, and ask for no bit") {
  const GaussianTables tables;
  const SymbolModel model{static_cast<std::uint16_t>(HashPrediction::table(0)), 0};
  const detail::CoarseBin bin(tables, model, 0, 3, 0);
  CHECK(bin.probability(-1) == 0);
  CHECK(bin.probability(0) > bin.probability(1));
  CHECK(bin.middle() > 0);
  const detail::CoarseBin one(tables, model, 0, 3, 1);
  detail::BitsOut out;
  CHECK(one.code(out, 1) == 1);
  CHECK(out.finish().empty());
  CHECK(one.middle() == 32);
}
