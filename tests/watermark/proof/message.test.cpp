// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/watermark/proof/message.hpp>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

using namespace compmark;

// The published strings: docs/spec/method.md, 5.4.
TEST_CASE("proof/message: published seeds give the published messages") {
  const std::vector<std::pair<std::uint32_t, std::string>> published{
      {42, "1110100001000001100101111111010100011010010001000011010001010101"},
      {57494, "1001110001011011011100010100010110001000000000010100011111111011"},
      {777, "100010010110100011101000000111101001110111001111"},
      {19701105, "001000011110010110010101101001011101001001111011"},
      {19911108, "000110001001100111100011111011110101010001101100"},
      {19961124, "110001010101011111011100011010100100011101101001"},
      {20240519, "111101100100101111000101111111001100001011101010"},
  };
  for (const auto& [seed, text] : published) {
    for (const std::size_t bits : {std::size_t{32}, std::size_t{48}, text.size()}) {
      CHECK(Message::from_published_seed(seed, bits).binary() == text.substr(0, bits));
    }
  }
  CHECK(Message::from_published_seed(42, 48).ones() == 22);
  CHECK(Message::from_published_seed(57494, 48).ones() == 19);

  // Control: the obvious recipe, the sign of std::normal_distribution on the same generator, gives another message.
  std::mt19937 generator(42);
  std::normal_distribution<float> normal;
  Message naive(48);
  for (std::size_t i = 0; i < 48; ++i) naive.set(i, normal(generator) > 0);
  CHECK(naive.binary() != published[0].second.substr(0, 48));
}

TEST_CASE("proof/message: the quadrant is the sign of cos and sin in float") {
  for (const std::uint32_t angle : {0u, 1u, (1u << 22) - 1, 1u << 22, (1u << 22) + 1, (1u << 23) - 1, 1u << 23,
                                    3u << 22, (3u << 22) - 1, (1u << 24) - 1}) {
    const float theta = 2 * std::numbers::pi_v<float> * (static_cast<float>(angle) * 0x1p-24f);
    CHECK((angle < (1u << 22) || angle >= (3u << 22)) == (std::cos(theta) > 0));
    CHECK((angle > 0 && angle < (1u << 23)) == (std::sin(theta) > 0));
  }
}

TEST_CASE("proof/message: texts, bytes and words round-trip at every length") {
  const Random random(1, 0, random_stage("test/message"));
  for (std::size_t bits = 1; bits <= message_bits_limit; ++bits) {
    const Message message = Message::from_words(random.bits(2 * bits), random.bits(2 * bits + 1), bits);
    CHECK(message.size() == bits);
    CHECK(message.binary().size() == bits);
    Result<Message> binary = Message::from_binary(message.binary());
    REQUIRE(binary.ok());
    CHECK(*binary == message);
    Result<Message> hex = Message::from_hex(message.hex(), bits);
    REQUIRE(hex.ok());
    CHECK(*hex == message);
    std::vector<std::byte> bytes((bits + 7) / 8);
    std::vector<float> logits(bits);
    for (std::size_t i = 0; i < bits; ++i) {
      if (message[i]) bytes[i / 8] |= std::byte{static_cast<unsigned char>(0x80u >> (i % 8))};
      logits[i] = message[i] ? 0.25f : -0.25f;
    }
    CHECK(Message::from_bytes(bytes, bits) == message);
    CHECK(Message::from_logits<float>(logits) == message);
    CHECK(matches<float>(message, logits) == bits);
  }
}

TEST_CASE("proof/message: matches count equal bits") {
  Message message = Message::from_published_seed(7, 100), other = message;
  CHECK(message.bit_accuracy(other) == 1);
  for (std::size_t i = 0; i < 100; i += 4) other.flip(i);
  CHECK(message.matches(other) == 75);
  CHECK(message.bit_accuracy(other) == doctest::Approx(0.75));
  CHECK((message ^ other).ones() == 25);
  const std::vector<double> logits{0, -1, 2, std::numeric_limits<double>::quiet_NaN()};
  const Message expected = *Message::from_binary("0011");
  CHECK(matches<double>(expected, logits) == 3);  // zero and NaN read as 0
  CHECK(Message::from_logits<double>(logits).binary() == "0010");
}

TEST_CASE("proof/message: bad texts are refused with the place") {
  CHECK_FALSE(Message::from_binary("").ok());
  CHECK_FALSE(Message::from_binary(std::string(129, '0')).ok());
  const Result<Message> letter = Message::from_binary("0102");
  REQUIRE_FALSE(letter.ok());
  CHECK(letter.error().line() == "message: '2' at place 3; a message is written with 0 and 1 only");
  CHECK_FALSE(Message::from_hex("e8", 4).ok());
  CHECK_FALSE(Message::from_hex("e", 5).ok());
  CHECK_FALSE(Message::from_hex("eg", 8).ok());
  CHECK_FALSE(Message::from_hex("e9", 5).ok());
  CHECK_FALSE(Message::from_hex("ff", 7).ok());
  CHECK_FALSE(Message::from_hex("", 0).ok());
  CHECK(Message::from_hex("fe", 7).ok());
  CHECK(Message::from_hex("E841", 16)->binary() == "1110100001000001");
}
