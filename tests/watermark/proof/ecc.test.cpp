// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/watermark/proof/ecc.hpp>
#include <string>
#include <utility>
#include <vector>

#include "watermark/proof/drawn_message.hpp"

using namespace compmark;
using testing::drawn_message;

namespace {

const Random ecc_stream(3, 0, random_stage("test/ecc"));

/// Flips `count` different bits.
Message with_errors(Message word, std::size_t count, std::uint64_t index) {
  Message mask(word.size());
  for (std::uint64_t draw = 0; mask.ones() < count; ++draw)
    mask.set(static_cast<std::size_t>(ecc_stream.below((1ull << 40) + 1000 * index + draw, word.size())), true);
  return word ^ mask;
}

}  // namespace

TEST_CASE("proof/ecc: payload sizes are those of the published tables") {
  struct Size {
    std::size_t length, correctable, payload;
  };
  // BCH(15), (31), (63), (127) in full (Lin and Costello, appendix), and shortened as in docs/spec/watermark.md, 5
  for (const Size& s :
       {Size{15, 1, 11},   Size{15, 2, 7},    Size{15, 3, 5},    Size{31, 3, 16},  Size{31, 5, 11},  Size{31, 7, 6},
        Size{63, 3, 45},   Size{63, 5, 36},   Size{63, 7, 24},   Size{63, 10, 18}, Size{63, 11, 16}, Size{63, 13, 10},
        Size{63, 15, 7},   Size{127, 3, 106}, Size{127, 5, 92},  Size{127, 7, 78}, Size{127, 9, 71}, Size{127, 11, 57},
        Size{127, 13, 50}, Size{127, 14, 43}, Size{127, 15, 36}, Size{48, 3, 30},  Size{48, 4, 24},  Size{48, 5, 21},
        Size{48, 6, 15},   Size{48, 7, 9},    Size{32, 2, 20},   Size{32, 3, 14},  Size{32, 4, 8},   Size{64, 3, 43},
        Size{64, 4, 36},   Size{64, 5, 29},   Size{64, 6, 22},   Size{64, 7, 15}}) {
    const Result<BchCode> code = BchCode::make(s.length, s.correctable);
    CAPTURE(s.length);
    CAPTURE(s.correctable);
    REQUIRE(code.ok());
    CHECK(code->payload_bits() == s.payload);
  }
  CHECK_FALSE(BchCode::make(7, 1).ok());
  CHECK_FALSE(BchCode::make(128, 3).ok());
  CHECK_FALSE(BchCode::make(48, 0).ok());
  CHECK_FALSE(BchCode::make(48, 16).ok());
  CHECK_FALSE(BchCode::make(16, 7).ok());
  CHECK_FALSE(PayloadCode::make(48, 7, CrcKind::crc16).ok());
}

TEST_CASE("proof/ecc: (15, 7, 2) has the generator of the books, 1 + x^4 + x^6 + x^7 + x^8") {
  const Message word = BchCode::make(15, 2)->encode(*Message::from_binary("0000001"));
  CHECK(word.binary() == "000000111010001");
}

TEST_CASE("proof/ecc: every word with up to t errors is corrected, and linear codes add") {
  for (const auto& pair : {std::pair<std::size_t, std::size_t>{48, 3},
                           {48, 4},
                           {48, 5},
                           {48, 6},
                           {32, 3},
                           {32, 4},
                           {64, 5},
                           {64, 7},
                           {31, 5},
                           {63, 11},
                           {127, 10},
                           {16, 1}}) {
    const std::size_t length = pair.first, correctable = pair.second;
    const BchCode code = *BchCode::make(length, correctable);
    const Message first = drawn_message(ecc_stream, 1, code.payload_bits()),
                  second = drawn_message(ecc_stream, 2, code.payload_bits());
    CHECK((code.encode(first) ^ code.encode(second)) == code.encode(first ^ second));
    std::size_t wrong = 0, least = length;
    for (std::uint64_t trial = 0; trial < 100; ++trial) {
      const Message payload = drawn_message(ecc_stream, 10 + trial, code.payload_bits());
      const Message word = code.encode(payload);
      if (word.ones() != 0) least = std::min(least, word.ones());
      for (std::size_t errors = 0; errors <= correctable; ++errors) {
        const auto decoded = code.decode(with_errors(word, errors, 100 * trial + errors));
        wrong += !decoded || decoded->payload != payload || decoded->corrected != errors ? 1 : 0;
      }
    }
    CAPTURE(length);
    CAPTURE(correctable);
    CHECK(wrong == 0);
    CHECK(least >= 2 * correctable + 1);  // the distance the errors need
  }
}

TEST_CASE("proof/ecc: probabilities of the table, in closed form and decoded") {
  struct Row {
    std::size_t correctable;
    double at[6];
  };
  const double rates[6]{0.02, 0.04, 0.05, 0.08, 0.10, 0.15};
  const Row table[]{{3, {0.985, 0.875, 0.782, 0.458, 0.280, 0.057}},
                    {4, {0.997, 0.958, 0.909, 0.662, 0.469, 0.134}},
                    {5, {0.9996, 0.988, 0.968, 0.817, 0.653, 0.254}},
                    {6, {0.99995, 0.997, 0.991, 0.914, 0.800, 0.406}}};
  for (const Row& row : table) {
    const PayloadCode code = *PayloadCode::make(48, row.correctable);
    for (int i = 0; i < 6; ++i) CHECK(std::abs(code.code.decode_probability(rates[i]) - row.at[i]) < 6e-4);
    for (const int i : {2, 4}) {  // errors drawn bit by bit
      const std::size_t trials = 2000;
      std::size_t read = 0, wrong = 0;
      for (std::uint64_t trial = 0; trial < trials; ++trial) {
        const Message data = drawn_message(ecc_stream, 5000 + trial, code.data_bits());
        Message word = code.encode(data);
        for (std::size_t bit = 0; bit < 48; ++bit) {
          if (ecc_stream.uniform((1ull << 50) + 48 * trial + bit) < rates[i]) word.flip(bit);
        }
        const PayloadCode::Reading reading = code.decode(word);
        if (reading.outcome != PayloadCode::Outcome::read) continue;
        reading.data == data ? ++read : ++wrong;
      }
      const double p = row.at[i], sigma = std::sqrt(p * (1 - p) / static_cast<double>(trials));
      CAPTURE(row.correctable);
      CHECK(std::abs(static_cast<double>(read) / static_cast<double>(trials) - p) < 4 * sigma);
      CHECK(wrong <= 3);
    }
  }
  CHECK(std::abs(BchCode::make(31, 3)->decode_probability(0.05) - 0.933) < 1e-3);
  CHECK(std::abs(BchCode::make(31, 5)->decode_probability(0.05) - 0.996) < 1e-3);
  CHECK(std::abs(BchCode::make(63, 5)->decode_probability(0.05) - 0.906) < 1e-3);
  CHECK(std::abs(BchCode::make(63, 7)->decode_probability(0.05) - 0.987) < 1e-3);
}

TEST_CASE("proof/ecc: random words rarely decode, and the CRC keeps the rest") {
  const PayloadCode code = *PayloadCode::make(48, 4);
  CHECK(code.code.random_decode_rate() == doctest::Approx(1.3e-2).epsilon(0.03));
  CHECK(binomial_tail(44, 48) == doctest::Approx(7.6e-10).epsilon(0.01));  // near one given code word
  const std::size_t trials = 40000;
  std::size_t near = 0, accepted = 0;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    const PayloadCode::Reading reading = code.decode(drawn_message(ecc_stream, 1000000 + trial, 48));
    near += reading.outcome != PayloadCode::Outcome::too_many_errors ? 1 : 0;
    accepted += reading.outcome == PayloadCode::Outcome::read ? 1 : 0;
  }
  CHECK(clopper_pearson(near, trials, 0.9999).contains(code.code.random_decode_rate()));
  CHECK(accepted <= 10);  // 40,000 x 1.3e-2 / 256 = 2 expected; P(more than 10) < 1e-5
  CHECK(near > 300);      // control: without the CRC each of these were a silent wrong payload

  // One error too many: refused, or another payload that the CRC refuses; never the true one.
  std::size_t silent = 0, refused = 0;
  for (std::uint64_t trial = 0; trial < 4000; ++trial) {
    const Message data = drawn_message(ecc_stream, 2000000 + trial, code.data_bits());
    const PayloadCode::Reading reading = code.decode(with_errors(code.encode(data), 5, 3000 + trial));
    if (reading.outcome == PayloadCode::Outcome::read) ++silent;
    if (reading.outcome == PayloadCode::Outcome::too_many_errors) ++refused;
  }
  CHECK(silent <= 6);
  CHECK(refused > 3000);
}

TEST_CASE("proof/ecc: check values of the CRC catalogue; zeros are never valid") {
  std::vector<std::byte> digits;
  for (const char c : std::string("123456789")) digits.push_back(static_cast<std::byte>(c));
  const Message message = Message::from_bytes(digits, 72);
  CHECK(crc_of(message, CrcKind::crc8) == 0xDF);
  CHECK(crc_of(message, CrcKind::crc16) == 0x29B1);
  CHECK(crc_of(message, CrcKind::none) == 0);
  for (const std::size_t bits : {32u, 48u, 64u}) {
    CHECK(PayloadCode::make(bits, 3)->decode(Message(bits)).outcome == PayloadCode::Outcome::crc_failed);
    Message ones(bits);
    for (std::size_t i = 0; i < bits; ++i) ones.set(i, true);
    CHECK(PayloadCode::make(bits, 3)->decode(ones).outcome != PayloadCode::Outcome::read);
  }
}
