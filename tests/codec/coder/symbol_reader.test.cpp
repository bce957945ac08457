// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/coder/symbol_reader.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "codec/coder/shared_tables.hpp"
#include "compmark/core/random.hpp"

namespace {

using namespace compmark;
using testing::shared_tables;

/// Each symbol is expected where the one before it was: only who decodes in order knows the models.
SymbolModel after(std::int32_t before) {
  return {static_cast<std::uint16_t>(20 + (before & 15)), 32 * before - before % 7};
}
std::vector<std::int32_t> walk(std::size_t count, double leap) {
  const Random random(5, count, random_stage("symbol reader"));
  std::vector<std::int32_t> symbols;
  std::int32_t before = 0;
  for (std::size_t i = 0; i < count; ++i) {
    before += static_cast<std::int32_t>(std::lround(leap * random.normal(i)));
    symbols.push_back(before);
  }
  return symbols;
}
std::vector<std::uint8_t> chunk_of(std::span<const std::int32_t> symbols) {
  std::vector<SymbolModel> models;
  std::int32_t before = 0;
  for (const std::int32_t symbol : symbols) {
    models.push_back(after(before));
    before = symbol;
  }
  std::vector<std::uint8_t> bytes;
  encode_symbols(shared_tables(), models, symbols, bytes);
  return bytes;
}
bool reads(std::span<const std::uint8_t> chunk, std::size_t count, std::vector<std::int32_t>& symbols) {
  SymbolReader reader(shared_tables(), chunk);
  symbols.clear();
  if (!reader.check(count).ok()) return false;
  std::int32_t before = 0;
  for (std::size_t i = 0; i < count; ++i) {
    before = reader.next(after(before));
    symbols.push_back(before);
  }
  return reader.finish(symbols).ok();
}

TEST_CASE("coder/symbol_reader: reads what encode_symbols wrote, escapes included, where models follow symbols") {
  for (const std::size_t count : {0u, 1u, 2u, 3u, 4u, 5u, 7u, 1000u, 20'001u}) {
    for (const double leap : {1.0, 300.0}) {  // 300 bins: most are escapes
      const std::vector<std::int32_t> symbols = walk(count, leap);
      std::vector<std::int32_t> read;
      REQUIRE(reads(chunk_of(symbols), count, read));
      REQUIRE(read == symbols);
    }
  }
}

TEST_CASE("coder/symbol_reader: every flipped bit, every truncation, a byte more and another count are found") {
  const std::vector<std::int32_t> symbols = walk(60, 3);
  const std::vector<std::uint8_t> good = chunk_of(symbols);
  std::vector<std::int32_t> read;
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      std::vector<std::uint8_t> damaged = good;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ 1 << bit);
      REQUIRE_FALSE(reads(damaged, symbols.size(), read));
    }
    REQUIRE_FALSE(reads(std::span(good).first(i), symbols.size(), read));
  }
  std::vector<std::uint8_t> longer = good;
  longer.push_back(0);
  CHECK_FALSE(reads(longer, symbols.size(), read));
  CHECK_FALSE(reads(good, symbols.size() - 1, read));
  CHECK_FALSE(reads(good, symbols.size() + 1, read));
  CHECK(reads(good, symbols.size(), read));  // negative control
}

}  // namespace
