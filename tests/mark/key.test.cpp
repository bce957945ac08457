// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/io/owner_key.hpp>
#include <compmark/mark/key.hpp>
#include <compmark/math/binomial.hpp>
#include <cstdint>
#include <string>
#include <vector>

using namespace compmark;

namespace {
OwnerKey numbered(std::uint64_t number, std::size_t bits = 48) {
  Digest256 secret{};
  secret[0] = std::byte{1};
  for (std::size_t i = 0; i < 8; ++i) secret[31 - i] = static_cast<std::byte>(number >> (8 * i) & 0xFF);
  return OwnerKey{secret, "2026-01-31T23:59:59Z", bits};
}
}  // namespace

TEST_CASE("mark/key: message, payload mask and carrier seed come from one secret under three labels") {
  const OwnerKey key = numbered(5, 128);
  std::array<std::byte, 16> bytes{};
  key.derive("compmark/message/v1", bytes);
  CHECK(message_of(key).hex() == to_hex(bytes));
  key.derive("compmark/payload/v1", bytes);
  CHECK(payload_mask(key).hex() == to_hex(bytes));
  std::array<std::byte, 32> seed{};
  key.derive("compmark/carriers/v1", seed);
  std::string text;
  for (const std::uint64_t word : carrier_seed(key)) {
    for (int shift = 60; shift >= 0; shift -= 4) text += "0123456789abcdef"[word >> shift & 15u];
  }
  CHECK(text == to_hex(seed));
  CHECK(message_of(key) != payload_mask(key));
  CHECK(message_of(numbered(5, 32)).binary() == message_of(key).binary().substr(0, 32));
}

TEST_CASE("mark/key: messages of different secrets are as different as random ones") {
  // 300 secrets that differ in one counter: 44,850 pairs at 48 bits; the mean match is 24 with standard error sqrt(12 / 44850) = 0.016
  std::vector<Message> messages;
  for (std::uint64_t i = 0; i < 300; ++i) messages.push_back(message_of(numbered(i)));
  double total = 0, pairs = 0;
  std::size_t most = 0;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const std::size_t count = messages[i].matches(messages[j]);
      total += static_cast<double>(count);
      pairs += 1;
      most = std::max(most, count);
    }
  }
  CHECK(std::abs(total / pairs - 24) < 0.08);
  CHECK(binomial_tail(most, 48) * pairs > 1e-3);  // no pair is stranger than chance allows
}
