// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/context_gs/context_gs_prior.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "compmark/codec/coder/symbol_coder.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

/// Probabilities of a rounded Gaussian.
std::vector<double> gaussian(double width) {
  std::vector<double> p;
  const auto below = [&](double x) { return 0.5 * std::erfc(-x / width / std::sqrt(2.0)); };
  for (int k = -HyperpriorFormat::window; k <= HyperpriorFormat::window; ++k)
    p.push_back(below(k + 0.5) - below(k - 0.5));
  return p;
}

TEST_CASE(
    "context_gs/context_gs_prior: every symbol has a frequency, the escape too, and they are the probabilities to "
    "2^-10") {
  for (const double width : {1e-9, 0.2, 1.0, 5.0, 50.0}) {
    const std::vector<double> p = gaussian(width);
    const auto frequency = hyperprior_frequencies(p);
    REQUIRE(frequency.ok());
    std::uint32_t sum = 0;
    for (std::size_t i = 0; i < p.size(); ++i) {
      CHECK((*frequency)[i] >= 1);
      CHECK(std::abs((*frequency)[i] / 65536.0 - p[i]) < 0x1p-10 * p[i] + 0x1p-15);
      sum += (*frequency)[i];
    }
    CHECK(sum < 65536);
  }
  CHECK(hyperprior_frequencies(std::vector<double>(31, 1.0 / 31)).ok());
  CHECK(!hyperprior_frequencies(std::vector<double>(30, 0.01)).ok());
  CHECK(!hyperprior_frequencies(std::vector<double>(31, 0.05)).ok());
  CHECK(!hyperprior_frequencies(std::vector<double>(31, std::nan(""))).ok());
  std::vector<double> negative = gaussian(1);
  negative[4] = -1e-9;
  CHECK(!hyperprior_frequencies(negative).ok());
}

TEST_CASE("context_gs/context_gs_prior: symbols come back, escapes too, at the entropy of their channels") {
  std::vector<std::uint16_t> frequencies;
  const std::vector<double> widths{0.3, 1.0, 4.0};
  for (const double width : widths) {
    const auto frequency = hyperprior_frequencies(gaussian(width));
    REQUIRE(frequency.ok());
    frequencies.insert(frequencies.end(), frequency->begin(), frequency->end());
  }
  const HyperpriorTables tables(frequencies);
  REQUIRE(tables.channels() == 3);
  const Random random(2, 0, random_stage("prior"));
  std::vector<SymbolModel> models(30'000);
  std::vector<std::int32_t> symbols(models.size());
  double entropy = 0, ideal = 0;
  for (std::size_t i = 0; i < symbols.size(); ++i) {
    models[i].sigma_index = static_cast<std::uint16_t>(i % 3);
    const double width = widths[i % 3];
    symbols[i] = static_cast<std::int32_t>(std::lround(width * random.normal(i)));
    entropy -=
        std::log2(std::max(gaussian(width)[static_cast<std::size_t>(std::clamp(symbols[i], -15, 15) + 15)], 1e-6));
    ideal += ideal_bits(tables, models[i], symbols[i]);
  }
  std::vector<std::uint8_t> bytes;
  encode_symbols(tables, models, symbols, bytes);
  CHECK(std::abs(8.0 * static_cast<double>(bytes.size()) - ideal) < 8 * 26);
  CHECK(std::abs(ideal / entropy - 1) < 0.002);
  std::vector<std::int32_t> back(symbols.size());
  REQUIRE(decode_symbols(tables, models, bytes, back).ok());
  CHECK(back == symbols);
  for (const std::int32_t far : {16, -16, 17, -500, 1'000'000, -1'000'000}) {
    symbols[7] = far;
    bytes.clear();
    encode_symbols(tables, models, symbols, bytes);
    REQUIRE(decode_symbols(tables, models, bytes, back).ok());
    CHECK(back == symbols);
  }
  // Another prior is another stream: the end of it says so.
  frequencies[15] = static_cast<std::uint16_t>(frequencies[15] - 50);
  CHECK(!decode_symbols(HyperpriorTables(frequencies), models, bytes, back).ok());
}

}  // namespace
