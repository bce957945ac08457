// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/coder/symbol_coder.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "codec/coder/shared_tables.hpp"
#include "compmark/core/random.hpp"
#include "compmark/io/sha256.hpp"

namespace {

using namespace compmark;
using testing::shared_tables;

using Bytes = std::vector<std::uint8_t>;

struct Chunk {
  std::vector<SymbolModel> models;
  std::vector<std::int32_t> symbols;
  long double ideal = 0;  ///< bits of the symbols under their true Gaussians, not on any grid

  [[nodiscard]] Bytes encoded() const {
    Bytes bytes;
    encode_symbols(shared_tables(), models, symbols, bytes);
    return bytes;
  }
  [[nodiscard]] double table_bits() const {
    double bits = 0;
    for (std::size_t i = 0; i < symbols.size(); ++i) bits += ideal_bits(shared_tables(), models[i], symbols[i]);
    return bits;
  }
};

long double exact_gaussian_bits(std::int32_t symbol, long double mean, long double sigma) {
  const long double low = std::abs(symbol - mean) - 0.5L;
  const auto tail = [&](long double a) { return 0.5L * std::erfc(a / (sigma * std::numbers::sqrt2_v<long double>)); };
  return -std::log2(tail(low) - tail(low + 1));
}

/// Deviations from 0.3 to 8 bins, evenly in their logarithm.
Chunk sample_chunk(std::size_t count, std::uint64_t key, double least = 0.3, double most = 8) {
  const Random random(3, key, random_stage("symbol test"));
  Chunk chunk;
  for (std::size_t i = 0; i < count; ++i) {
    const double octaves = std::log2(least) + random.uniform(4 * i) * std::log2(most / least);
    const double sigma = std::exp2(octaves), mean = 60 * (random.uniform(4 * i + 1) - 0.5);
    const auto symbol = static_cast<std::int32_t>(std::lround(mean + sigma * random.normal(4 * i + 2)));
    const auto index = std::max(0l, std::lround(8 * octaves) - GaussianTables::least_level);
    chunk.models.push_back({static_cast<std::uint16_t>(index), static_cast<std::int32_t>(std::lround(32 * mean))});
    chunk.symbols.push_back(symbol);
    chunk.ideal += exact_gaussian_bits(symbol, mean, sigma);
  }
  return chunk;
}

bool round_trip(const Chunk& chunk) {
  std::vector<std::int32_t> symbols(chunk.symbols.size(), -77);
  return decode_symbols(shared_tables(), chunk.models, chunk.encoded(), symbols).ok() && symbols == chunk.symbols;
}

/// A second decoder, written from the description of the layout: one state after the other, a linear search, numbers
/// read one by one.
std::vector<std::int64_t> plain_decode(const std::vector<SymbolModel>& models, const Bytes& chunk, bool& ended) {
  std::size_t at = 1;
  const auto number = [&] {
    std::uint64_t value = 0;
    for (int shift = 0;; shift += 7) {
      value |= std::uint64_t{chunk.at(at) & 127u} << shift;
      if (chunk.at(at++) < 128) return value;
    }
  };
  const std::uint64_t count = number(), escape_bytes = number();
  const unsigned sizes = chunk.at(at) + 256u * chunk.at(at + 1);
  at += 2;
  std::uint64_t states[4] = {};
  for (unsigned s = 0; s < 4; ++s) {
    const unsigned size = 4 + (sizes >> 4 * s) % 16;
    for (unsigned byte = 0; byte < size; ++byte) states[s] += std::uint64_t{chunk.at(at++)} << 8 * byte;
  }
  std::size_t word = at, words_end = chunk.size() - escape_bytes;
  at = words_end;
  std::vector<std::int64_t> symbols;
  for (std::uint64_t i = 0; i < count; ++i) {
    std::uint64_t& state = states[i % 4];
    const double sigma = std::exp2((models[i].sigma_index + GaussianTables::least_level) / 8.0);
    const int window = static_cast<int>(std::ceil(5 * sigma)) + 1;
    const double centre = std::floor(models[i].mean / 32.0 + 0.5);
    const bool below = models[i].mean < 32 * centre;
    const GaussianTables::Table& table = *shared_tables().place(models[i]).table;
    std::uint32_t slot = 0, start = 0;
    while (start + shared_tables().interval(table, slot).frequency <= state % 65536) {
      start += shared_tables().interval(table, slot++).frequency;
    }
    state = shared_tables().interval(table, slot).frequency * (state / 65536) + state % 65536 - start;
    while (state < std::uint64_t{1} << 31) {
      for (unsigned byte = 0; byte < 4; ++byte) state = state << 8 | chunk.at(word + 3 - byte);
      word += 4;
    }
    std::int64_t bin = static_cast<std::int64_t>(slot) - window;
    if (bin > window) {
      const std::uint64_t code = number();
      bin = code % 2 == 0 ? window + 1 + static_cast<std::int64_t>(code / 2)
                          : -window - 1 - static_cast<std::int64_t>(code / 2);
    }
    symbols.push_back(static_cast<std::int64_t>(centre) + (below ? -bin : bin));
  }
  ended = word == words_end && at == chunk.size() && states[0] == std::uint64_t{1} << 31;
  return symbols;
}

}  // namespace

TEST_CASE("coder/symbol_coder: symbols come back; no symbols are no bytes (EN10)") {
  for (const std::size_t count : {0u, 1u, 2u, 3u, 4u, 5u, 7u, 8u, 31u, 1000u, 40000u}) {
    CAPTURE(count);
    const Chunk chunk = sample_chunk(count, count, 0.12, 100);
    CHECK((count == 0) == chunk.encoded().empty());
    CHECK(round_trip(chunk));
  }
  const Bytes nothing;
  std::vector<std::int32_t> symbols(3);
  const std::vector<SymbolModel> models(3);
  CHECK(!decode_symbols(shared_tables(), models, nothing, symbols));
}

TEST_CASE("coder/symbol_coder: a decoder written from the layout reads the same, with escapes and mirrored means") {
  Chunk chunk = sample_chunk(3000, 5, 0.12, 30);
  for (std::size_t i = 0; i < chunk.symbols.size(); i += 97) chunk.symbols[i] += i % 2 == 0 ? 500 : -70000;
  CHECK(round_trip(chunk));
  bool ended = false;
  const std::vector<std::int64_t> symbols = plain_decode(chunk.models, chunk.encoded(), ended);
  CHECK(ended);
  CHECK(std::vector<std::int32_t>(symbols.begin(), symbols.end()) == chunk.symbols);
}

TEST_CASE("coder/symbol_coder: the size is that of the tables, and theirs that of the Gaussians (EN4)") {
  const Chunk chunk = sample_chunk(200000, 6);
  const double bytes = static_cast<double>(chunk.encoded().size());
  const double table = chunk.table_bits() / 8, ideal = static_cast<double>(chunk.ideal) / 8;
  // 69,031 bytes, 69,006.3 by the tables, 68,981.9 by the Gaussians
  CHECK(bytes - table > 0);
  CHECK(bytes - table < 34);                   // header and states; 25 are usual
  CHECK(bytes - table < 0.0005 * table);       // 0.04 %
  CHECK(bytes - ideal < 0.003 * ideal);        // 0.07 % with everything
  CHECK(table - ideal < 0.001 * ideal);        // 0.04 %: grids of the deviation and of the mean, frequencies
  const Chunk small = sample_chunk(32768, 7);  // the size of chunk with which ours is compared
  const double small_bytes = static_cast<double>(small.encoded().size());
  CHECK(small_bytes < 1.003 * static_cast<double>(small.ideal) / 8);  // 0.25 %
}

TEST_CASE("coder/symbol_coder: an outlier costs less than 8 bytes; a common alphabet pays on every symbol (EN5)") {
  Chunk chunk = sample_chunk(20000, 8);
  const std::size_t before = chunk.encoded().size();
  for (const std::int32_t outlier : {10000, -10000, 1000000}) {
    Chunk far = chunk;
    far.symbols[777] = outlier;
    CHECK(far.encoded().size() < before + 8);
    CHECK(round_trip(far));
  }
  // Control: 16 bits shared by all values between the outliers, each with a frequency of at least one.
  const double alphabet = 20001, naive = -std::log2(1 - alphabet / 65536) * 20000 / 8;
  CHECK(naive > 1000);
}

TEST_CASE("coder/symbol_coder: the whole of int32, against means far away, comes back (EN8)") {
  using Limits = std::numeric_limits<std::int32_t>;
  Chunk chunk;
  for (const std::int32_t symbol : {Limits::min(), Limits::max(), 0, 1, -1, Limits::min() + 1}) {
    for (const std::int32_t mean : {0, 15, 16, -16, -17, 33, Limits::min(), Limits::max()}) {
      for (const int index : {0, 40, 81, 65535}) {
        chunk.models.push_back({static_cast<std::uint16_t>(index), mean});
        chunk.symbols.push_back(symbol);
      }
    }
  }
  CHECK(round_trip(chunk));
  CHECK(static_cast<double>(chunk.encoded().size()) < chunk.table_bits() / 8 + 34);
}

TEST_CASE("coder/symbol_coder: a million zeros that were expected cost tens of bytes (EN7)") {
  Chunk chunk;
  chunk.models.assign(1000000, SymbolModel{0, 0});
  chunk.symbols.assign(1000000, 0);
  CHECK(chunk.encoded().size() < 45);  // 39: 14 for the tables' least cost of 1.1e-4 bits a symbol
  CHECK(round_trip(chunk));
}

TEST_CASE("coder/symbol_coder: cut, flipped or lengthened chunks are errors at every bit (EN10)") {
  Chunk chunk = sample_chunk(150, 9, 0.12, 8);
  chunk.symbols[10] = 5000;
  chunk.symbols[90] = -3;
  const Bytes good = chunk.encoded();
  std::vector<std::int32_t> symbols(chunk.symbols.size());
  for (std::size_t length = 0; length < good.size(); ++length) {
    const auto read = decode_symbols(shared_tables(), chunk.models, std::span(good).first(length), symbols);
    REQUIRE(!read);
    CHECK(!read.error().problem.empty());
  }
  Bytes longer = good;
  for (int extra = 0; extra < 9; ++extra) {
    longer.push_back(0);
    REQUIRE(!decode_symbols(shared_tables(), chunk.models, longer, symbols));
  }
  std::size_t silent = 0;
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes damaged = good;
    damaged[bit / 8] = static_cast<std::uint8_t>(damaged[bit / 8] ^ (1u << bit % 8));
    silent += decode_symbols(shared_tables(), chunk.models, damaged, symbols).ok();
  }
  CHECK(silent == 0);
  Bytes two = good;  // chunks that follow one another do not mix
  encode_symbols(shared_tables(), chunk.models, chunk.symbols, two);
  REQUIRE(two.size() == 2 * good.size());
  CHECK(
      decode_symbols(shared_tables(), chunk.models, std::span<const std::uint8_t>(two).subspan(good.size()), symbols));
  CHECK(symbols == chunk.symbols);
}

TEST_CASE("coder/symbol_coder: rubbish is refused") {
  const Random random(11, 0, random_stage("symbol test"));
  const Chunk chunk = sample_chunk(64, 10);
  std::vector<std::int32_t> symbols(64);
  std::size_t accepted = 0;
  for (std::uint64_t trial = 0; trial < 20000; ++trial) {
    Bytes bytes(random.bits(trial << 10) % 90);
    for (std::size_t i = 0; i < bytes.size(); ++i)
      bytes[i] = static_cast<std::uint8_t>(random.bits((trial << 10) + i + 1));
    if (trial % 2 == 0 && bytes.size() > 25) {  // a header that lets the symbols be reached
      bytes[0] = 1;
      bytes[1] = 64;
      bytes[2] = static_cast<std::uint8_t>(bytes[2] % 8);
      bytes[3] = bytes[4] = 0;
      for (const std::size_t top : {8u, 12u, 16u, 20u}) bytes[top] |= 0x80;
    }
    accepted += decode_symbols(shared_tables(), chunk.models, bytes, symbols).ok();
  }
  CHECK(accepted == 0);
}

TEST_CASE("coder/symbol_coder: other models than the encoder's are noticed, a whole bin included") {
  const Chunk chunk = sample_chunk(5000, 12);
  const Bytes bytes = chunk.encoded();
  std::vector<std::int32_t> symbols(chunk.symbols.size());
  struct Change {
    std::size_t place;
    int index, mean;
  };
  for (const Change& change : {Change{0, 1, 0}, {2500, 0, 13}, {4999, 0, 32}, {17, 0, -64}, {4, 0, 32}}) {
    std::vector<SymbolModel> wrong = chunk.models;
    SymbolModel& model = wrong[change.place];
    model.sigma_index = static_cast<std::uint16_t>(model.sigma_index + change.index);
    model.mean += change.mean;
    CAPTURE(change.place);
    CHECK(!decode_symbols(shared_tables(), wrong, bytes, symbols));
  }
  // Control: by a whole bin the states end as they should, and only the digest in three of them tells.
  std::vector<SymbolModel> wrong = chunk.models;
  wrong[4999].mean += 32;
  bool ended = false;
  CHECK(plain_decode(wrong, bytes, ended)[4999] == chunk.symbols[4999] + 1);
  CHECK(ended);
}

TEST_CASE("coder/symbol_coder: this chunk is these bytes for ever") {
  const Random random(13, 0, random_stage("symbol test"));
  Chunk chunk;  // whole numbers all the way: no other library's logarithm can change it
  for (std::uint64_t i = 0; i < 3001; ++i) {
    const auto index = static_cast<int>(random.bits(4 * i) % 82);
    const auto mean = static_cast<std::int32_t>(random.bits(4 * i + 1) % 4001) - 2000;
    const auto spread = static_cast<std::int64_t>(1) << (index / 8);
    const auto away = static_cast<std::int64_t>(random.bits(4 * i + 2) % 1000) -
                      static_cast<std::int64_t>(random.bits(4 * i + 3) % 1000);
    chunk.models.push_back({static_cast<std::uint16_t>(index), mean});
    chunk.symbols.push_back(static_cast<std::int32_t>(mean / 32 + away * spread / 2000));
  }
  const Bytes bytes = chunk.encoded();
  CHECK(Sha256{}.update(std::as_bytes(std::span<const std::uint8_t>(bytes))).hex() ==
        "c98daa340678e18f6bb188b10b0d2f0dadd0537a10789d54d0e3fac843cd9f12");
  CHECK(round_trip(chunk));
}

TEST_CASE("coder/symbol_coder: the digest sees values, order and length") {
  std::vector<std::int32_t> symbols(37);
  for (std::size_t i = 0; i < symbols.size(); ++i) symbols[i] = static_cast<std::int32_t>(i * i) - 100;
  const SymbolDigest digest = digest_symbols(symbols);
  for (std::size_t i = 0; i < symbols.size(); ++i) {
    std::vector<std::int32_t> other = symbols;
    other[i] ^= std::numeric_limits<std::int32_t>::min();
    CHECK(!(digest_symbols(other) == digest));
    other = symbols;
    std::swap(other[i], other[(i + 8) % symbols.size()]);
    CHECK(!(digest_symbols(other) == digest));
  }
  CHECK(!(digest_symbols(std::span(symbols).first(36)) == digest));
  symbols.assign(16, 0);
  CHECK(!(digest_symbols(symbols) == digest_symbols(std::span(symbols).first(8))));
}
