// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/bytes.hpp"

#include <doctest/doctest.h>

#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <vector>

namespace {

using namespace compmark;

TEST_CASE("io/bytes: numbers lie with their low byte first") {
  ByteWriter writer;
  writer.put(std::uint32_t{0x01020304}).put(std::int16_t{-2}).put(1.0f);
  const std::array<unsigned, 10> expected{4, 3, 2, 1, 0xFE, 0xFF, 0, 0, 0x80, 0x3F};
  REQUIRE(writer.size() == expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) CHECK(std::to_integer<unsigned>(writer.bytes()[i]) == expected[i]);
}

TEST_CASE("io/bytes: what is written is read, to the bit of a NaN") {
  const double nan = std::bit_cast<double>(0x7FF4000000000123ull);
  ByteWriter writer;
  writer.put(std::uint8_t{200})
      .put(std::numeric_limits<std::int64_t>::min())
      .put(nan)
      .put(-0.0f)
      .put(std::string_view("key"));
  const std::vector<std::byte> bytes = writer.take();
  CHECK(writer.size() == 0);
  ByteReader reader(bytes);
  CHECK(reader.get<std::uint8_t>() == 200);
  CHECK(reader.get<std::int64_t>() == std::numeric_limits<std::int64_t>::min());
  CHECK(std::bit_cast<std::uint64_t>(reader.get<double>()) == 0x7FF4000000000123ull);
  CHECK(std::bit_cast<std::uint32_t>(reader.get<float>()) == 0x80000000u);
  CHECK(!reader.complete());
  CHECK(reader.text(3) == "key");
  CHECK(reader.complete());
}

TEST_CASE("io/bytes: past the end come zeros, and the reader remembers") {
  const std::vector<std::byte> bytes(3, std::byte{0xFF});
  ByteReader reader(bytes);
  CHECK(reader.get<std::uint32_t>() == 0);
  CHECK(reader.failed());
  CHECK(reader.left() == 0);
  CHECK(reader.get<std::uint8_t>() == 0);
  CHECK(!reader.complete());
  ByteReader far(bytes);
  CHECK(far.take(std::numeric_limits<std::uint64_t>::max()).empty());
  CHECK(far.failed());
}

TEST_CASE("io/bytes: a count is believed only when its elements can follow") {
  ByteWriter writer;
  writer.put(std::uint32_t{2}).put(std::uint64_t{0});
  ByteReader fits(writer.bytes());
  CHECK(fits.count(4) == 2);
  CHECK(!fits.failed());
  ByteReader exceeds(writer.bytes());
  CHECK(exceeds.count(5) == 0);
  CHECK(exceeds.failed());
}

TEST_CASE("io/bytes: a product that does not fit is refused") {
  std::uint64_t product = 0;
  CHECK(checked_product(1ull << 32, (1ull << 32) - 1, product));
  CHECK(product == 0xFFFFFFFF00000000ull);
  CHECK(!checked_product(1ull << 32, 1ull << 32, product));
  const std::uint64_t rows = (1ull << 61) + 1, columns = 8;  // negative control: it wraps to what any file could hold
  CHECK(!checked_product(rows, columns, product));
  CHECK(rows * columns == 8);
  CHECK(checked_product(0, ~0ull, product));
  CHECK(product == 0);
}

}  // namespace
