// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/crc32c.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

std::uint32_t crc_of(std::string_view text) {
  return crc32c(std::as_bytes(std::span<const char>(text.data(), text.size())));
}

TEST_CASE("io/crc32c: published vectors") {
  CHECK(crc_of("") == 0u);
  CHECK(crc_of("123456789") == 0xE3069283u);  // the check value of the catalogue of CRCs
  // RFC 3720, B.4
  std::vector<std::byte> bytes(32, std::byte{0});
  CHECK(crc32c(bytes) == 0x8A9136AAu);
  bytes.assign(32, std::byte{0xFF});
  CHECK(crc32c(bytes) == 0x62A8AB43u);
  for (std::size_t i = 0; i < 32; ++i) bytes[i] = static_cast<std::byte>(i);
  CHECK(crc32c(bytes) == 0x46DD794Eu);
  for (std::size_t i = 0; i < 32; ++i) bytes[i] = static_cast<std::byte>(31 - i);
  CHECK(crc32c(bytes) == 0x113FDB5Cu);
}

TEST_CASE("io/crc32c: eight bytes at a time, bit by bit and in pieces are the same") {
  const Random random(1, 0, random_stage("crc32c test"));
  std::vector<std::byte> bytes(257);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(random.uniform(i) * 256);
  for (std::size_t n = 0; n <= bytes.size(); ++n) {
    std::uint32_t plain = ~0u;
    for (std::size_t i = 0; i < n; ++i) {
      plain ^= std::to_integer<std::uint32_t>(bytes[i]);
      for (int bit = 0; bit < 8; ++bit) plain = (plain >> 1) ^ ((plain & 1u) != 0 ? 0x82F63B78u : 0u);
    }
    const std::span<const std::byte> head = std::span<const std::byte>(bytes).first(n);
    REQUIRE(crc32c(head) == ~plain);
    REQUIRE(crc32c(head.subspan(n / 3), crc32c(head.first(n / 3))) == ~plain);
  }
}

TEST_CASE("io/crc32c: every flipped bit and every pair of neighbours is found") {
  std::vector<std::byte> bytes(61);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(i * 37);
  const std::uint32_t right = crc32c(bytes);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      for (const unsigned pattern : {1u, 3u}) {
        const std::byte kept = bytes[i];
        bytes[i] ^= static_cast<std::byte>(pattern << bit);
        CHECK((bytes[i] == kept || crc32c(bytes) != right));
        bytes[i] = kept;
      }
    }
  }
}

}  // namespace
