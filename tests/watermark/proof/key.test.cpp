// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/io/owner_key.hpp>
#include <compmark/math/binomial.hpp>
#include <compmark/watermark/proof/key.hpp>
#include <cstdint>
#include <string>
#include <vector>

using namespace compmark;

namespace {
OwnerKey numbered(std::uint64_t number, std::size_t bits = 48) {
  Digest256 secret{};
  secret[0] = std::byte{1};
  for (std::size_t i = 0; i < 8; ++i) secret[31 - i] = static_cast<std::byte>(number >> (8 * i) & 0xFF);
  return *make_key(secret, "2026-01-31T23:59:59Z", bits);
}
}  // namespace

TEST_CASE("proof/key: message, payload mask and carrier seed come from one secret under three labels") {
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

TEST_CASE("proof/key: messages of different secrets are as different as random ones") {
  // 300 secrets that differ in one counter: 44,850 pairs at 48 bits; the mean match is 24 with standard error sqrt(12 /
  // 44850) = 0.016
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

TEST_CASE("proof/key: a payload is read back under the secret, from bits of which some are wrong") {
  OwnerKey key = numbered(7);
  key.corrects = 4;
  key.payload = "5eed";
  REQUIRE(check_payload(key).ok());
  const Message message = message_of(key);
  CHECK(message != message_of(numbered(7)));
  CHECK(message == (payload_code(key)->encode(*Message::from_hex("5eed", 16)) ^ payload_mask(key)));
  OwnerKey reader = key;  // another key of the same secret: it reads what it does not know
  reader.payload = "0000";
  Message wrong = message;
  for (const std::size_t bit : {0u, 11u, 30u, 47u}) wrong.flip(bit);
  for (const Message& read : {message, wrong}) {
    const PayloadCode::Reading reading = read_payload(reader, read);
    REQUIRE(reading.outcome == PayloadCode::Outcome::read);
    CHECK(reading.data.hex() == "5eed");
    CHECK(reading.corrected == message_of(key).size() - read.matches(message));
  }
  // Under another secret the bits are noise: 1.3 % of them lie near a code word, and the CRC lets one in 256 of those
  // through.
  std::size_t read = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    OwnerKey other = numbered(100 + i);
    other.corrects = 4;
    other.payload = "0000";
    read += read_payload(other, message).outcome == PayloadCode::Outcome::read ? 1 : 0;
  }
  CHECK(read <= 3);  // 0.1 expected; without the CRC 25
  key.payload = "5eed1";
  REQUIRE_FALSE(check_payload(key).ok());
  CHECK(check_payload(key).error().line().find("16 bits of payload, 4 digits") != std::string::npos);
  CHECK(check_payload(key).error().line().find("the last of which") == std::string::npos);
  OwnerKey wider = numbered(7);
  wider.bits = 32;
  wider.corrects = 1;  // 18 bits: two of the last digit
  wider.payload = "05eed";
  REQUIRE_FALSE(check_payload(wider).ok());
  CHECK(check_payload(wider).error().line().find("18 bits of payload, 5 digits, the last of which is 0, 4, 8 or c") !=
        std::string::npos);
  wider.payload = "05eec";
  CHECK(check_payload(wider).ok());
  key.corrects = 12;
  CHECK_FALSE(check_payload(key).ok());
  CHECK(check_payload(numbered(7)).ok());
}

TEST_CASE("proof/key: messages with one payload are as random as others, those of one secret are not") {
  std::size_t hits = 0;
  const std::size_t keys = 4000;
  const auto of = [](std::uint64_t secret, const char* payload) {
    OwnerKey key = numbered(secret);
    key.corrects = 4;
    key.payload = payload;
    return message_of(key);
  };
  const Message fixed = of(1, "0000");
  for (std::uint64_t i = 0; i < keys; ++i) hits += of(50 + i, "0000").matches(fixed) >= 33 ? 1 : 0;
  CHECK(clopper_pearson(hits, keys).contains(binomial_tail(33, 48)));
  // The control: one secret's messages differ by code words, which the code alone decides.
  CHECK((of(1, "0001") ^ of(1, "0000")) == (of(2, "0001") ^ of(2, "0000")));
}
