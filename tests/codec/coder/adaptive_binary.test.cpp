// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/coder/adaptive_binary.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

using Bytes = std::vector<std::uint8_t>;

/// The same intervals in exact arithmetic: `low` is one long number, and a carry runs through it as far as it must.
struct ExactEncoder {
  Bytes digits{0, 0, 0, 0};  // big end first; the last four are under the range
  std::uint32_t range = 0xffffffff;
  bool begun = false;

  void add(std::uint32_t value) {
    std::uint64_t carry = value;
    for (std::size_t i = digits.size(); i-- > 0 && carry != 0;) {
      carry += digits[i];
      digits[i] = static_cast<std::uint8_t>(carry & 0xff);
      carry >>= 8;
    }
    REQUIRE(carry == 0);  // a code below one
  }
  void normalise() {
    begun = true;
    for (; range < (1u << 24); range <<= 8) digits.push_back(0);
  }
  void encode(BinaryContext& context, bool bit) {
    normalise();
    const std::uint32_t ones = (range >> 16) * context.probability();
    if (!bit) add(ones);
    range = bit ? ones : range - ones;
    context.learn(bit);
  }
  [[nodiscard]] Bytes finish() const { return begun ? digits : Bytes{}; }
};

/// The naive formula: a carry is added to the last byte that was written, and goes no further.
struct CarelessEncoder {
  Bytes bytes;
  std::uint64_t low = 0;
  std::uint32_t range = 0xffffffff;

  void shift() {
    if (low >> 32 != 0 && !bytes.empty()) ++bytes.back();
    bytes.push_back(static_cast<std::uint8_t>(low >> 24));
    low = (low & 0x00ffffffu) << 8;
  }
  void encode(BinaryContext& context, bool bit) {
    for (; range < (1u << 24); range <<= 8) shift();
    const std::uint32_t ones = (range >> 16) * context.probability();
    if (!bit) low += ones;
    range = bit ? ones : range - ones;
    context.learn(bit);
  }
  [[nodiscard]] Bytes finish() {
    for (int i = 0; i < 4; ++i) shift();
    return bytes;
  }
};

/// Bits of three contexts: rare, even, frequent.
std::vector<bool> sample_bits(std::size_t count, std::uint64_t key) {
  const Random random(5, key, random_stage("binary test"));
  std::vector<bool> bits;
  const double probability[3] = {0.01, 0.5, 0.97};
  for (std::size_t i = 0; i < count; ++i) bits.push_back(random.uniform(i) < probability[i % 3]);
  return bits;
}
Bytes encoded(const std::vector<bool>& bits) {
  BinaryEncoder encoder;
  BinaryContext contexts[3];
  for (std::size_t i = 0; i < bits.size(); ++i) encoder.encode(contexts[i % 3], bits[i]);
  return encoder.finish();
}
/// The bits, and whether the decoder holds the stream for good.
bool decodes(const Bytes& stream, const std::vector<bool>& bits, bool& equal) {
  BinaryDecoder decoder(stream);
  BinaryContext contexts[3];
  equal = true;
  for (std::size_t i = 0; i < bits.size(); ++i) equal &= decoder.decode(contexts[i % 3]) == bits[i];
  return decoder.valid();
}

/// A coder that runs beside the encoder and knows where its interval is, and where a point is at which a carry is decided.
struct Straddle {
  std::uint64_t low = 0;
  std::uint64_t edge = 0x80000000u;
  std::uint32_t range = 0xffffffff;
  void normalise() {
    for (; range < (1u << 24); range <<= 8) {
      edge = (edge - (low & 0xff000000u))
             << 8;  // 2^32 from the second byte on: the bytes before it are 0xff, or a carry and zeros
      low = (low & 0x00ffffffu) << 8;
    }
  }
  [[nodiscard]] std::uint32_t ones(const BinaryContext& context) const { return (range >> 16) * context.probability(); }
  [[nodiscard]] bool open() const { return low < edge && edge < low + range; }
  void take(bool bit, std::uint32_t ones) {
    if (!bit) low += ones;
    range = bit ? ones : range - ones;
  }
};

}  // namespace

TEST_CASE(
    "coder/adaptive_binary: bits come back, the stream is used up, and streams that follow one another do not mix") {
  for (const std::size_t count : {0u, 1u, 2u, 7u, 100u, 20000u}) {
    const std::vector<bool> bits = sample_bits(count, count);
    const Bytes stream = encoded(bits);
    CAPTURE(count);
    CHECK((count == 0) == stream.empty());
    bool equal = false;
    CHECK(decodes(stream, bits, equal));
    CHECK(equal);
  }
  BinaryEncoder encoder;  // used twice: the second stream knows nothing of the first
  BinaryContext first, second;
  for (int i = 0; i < 100; ++i) encoder.encode(first, i % 7 == 0);
  const Bytes one = encoder.finish();
  for (int i = 0; i < 100; ++i) encoder.encode(second, i % 7 == 0);
  CHECK(encoder.finish() == one);
}

TEST_CASE("coder/adaptive_binary: values of many bits and trees") {
  BinaryEncoder encoder;
  std::vector<BinaryContext> tree(255);
  const Random random(6, 0, random_stage("binary test"));
  std::vector<std::uint32_t> values;
  for (std::uint32_t i = 0; i < 3000; ++i) values.push_back(static_cast<std::uint32_t>(random.bits(i)));
  values.push_back(0);
  values.push_back(0xffffffffu);
  for (std::size_t i = 0; i < values.size(); ++i) {
    encoder.encode_bits(values[i], static_cast<int>(i % 33));
    encoder.encode_tree(tree, values[i] & 0x81u, 8);
  }
  const Bytes stream = encoder.finish();
  BinaryDecoder decoder(stream);
  std::vector<BinaryContext> again(255);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int count = static_cast<int>(i % 33);
    const std::uint64_t mask = (std::uint64_t{1} << count) - 1;
    REQUIRE(decoder.decode_bits(count) == (values[i] & mask));
    REQUIRE(decoder.decode_tree(again, 8) == (values[i] & 0x81u));
  }
  CHECK(decoder.valid());
  CHECK(stream.size() < 3002 * (16 + 2) / 8 * 1.02 + 40);  // 16 bits on average, and two of eight that are not constant
}

TEST_CASE("coder/adaptive_binary: short sequences agree with exact arithmetic to the last byte (EN9)") {
  const Random random(7, 0, random_stage("binary test"));
  std::size_t careless_differs = 0;
  for (std::uint64_t sequence = 0; sequence < 10000; ++sequence) {
    BinaryEncoder encoder;
    ExactEncoder exact;
    CarelessEncoder careless;
    BinaryContext mine[2], theirs[2], naive[2];
    const std::size_t count = 1 + random.bits(sequence << 20) % 60;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint64_t draw = random.bits((sequence << 20) + i + 1);
      const std::size_t which = draw >> 8 & 1;
      const bool bit = (draw & 0xff) < (which == 0 ? 10u : 128u);
      encoder.encode(mine[which], bit);
      exact.encode(theirs[which], bit);
      careless.encode(naive[which], bit);
    }
    const Bytes expected = exact.finish();
    REQUIRE(encoder.finish() == expected);
    careless_differs += careless.finish() != expected;
  }
  CHECK(careless_differs < 100);  // 13 of 10,000: random bits hardly find a carry that stops too early
  CHECK(careless_differs > 0);
}

TEST_CASE(
    "coder/adaptive_binary: a carry through a long run of 0xff (EN9); without its propagation the same bits are "
    "lost") {
  // The same odds for ever (what learns would soon need no bytes), and no power of two, whose intervals end at the edge.
  const BinaryContext odds{0x6a09e667, 0};
  for (const bool carry : {true, false}) {
    BinaryEncoder encoder;
    CarelessEncoder careless;
    BinaryContext mine = odds, naive = odds, model = odds;
    Straddle straddle;
    std::vector<bool> bits;
    const auto put = [&](bool bit) {
      straddle.take(bit, straddle.ones(model));
      encoder.encode(mine, bit);
      careless.encode(naive, bit);
      mine = naive = model = odds;
      bits.push_back(bit);
    };
    do {  // always into the part that holds the edge, for some 30,000 bytes; then to one side of it
      straddle.normalise();
      put(bits.size() < 240000 ? straddle.low + straddle.ones(model) > straddle.edge : !carry);
    } while (bits.size() < 240000 || straddle.open());
    const Bytes stream = encoder.finish();
    std::size_t run = 0;
    while (1 + run < stream.size() && stream[1 + run] == (carry ? 0 : 0xff)) ++run;
    CHECK(stream[0] == (carry ? 0x80 : 0x7f));
    CHECK(run > 25000);
    const Bytes naive_stream = careless.finish();
    CHECK((naive_stream == stream) == !carry);
    BinaryDecoder decoder(stream);
    BinaryContext context = odds;
    bool equal = true;
    for (const bool bit : bits) {
      equal &= decoder.decode(context) == bit;
      context = odds;
    }
    CHECK(equal);
    CHECK(decoder.valid());
  }
}

TEST_CASE("coder/adaptive_binary: streams that no encoder writes are not valid (found by ten minutes of fuzzing)") {
  // Their number lies beyond the first interval, or in what a division of the range into 2^n parts leaves over. Taken for the last part, it
  // stays beyond the interval, wraps at 2^32 and comes down anywhere, also on what `valid` looks for.
  const auto reads = [](const Bytes& stream, Bytes& again) {
    BinaryDecoder decoder(stream);
    BinaryEncoder encoder;
    BinaryContext theirs[16], ours[16];
    for (std::size_t i = 0; i < 16 * stream.size() + 16 && !decoder.overrun() && !decoder.valid(); ++i) {
      if (i % 5 == 4) {
        encoder.encode_bits(decoder.decode_bits(static_cast<int>(i % 33)), static_cast<int>(i % 33));
      } else {
        encoder.encode(ours[i % 16], decoder.decode(theirs[i % 16]));
      }
    }
    again = encoder.finish();
    return decoder.valid();
  };
  const Bytes found{0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xf6, 0xff,
                    0xff, 0xff, 0x05, 0x02, 0x00, 0x00, 0x01, 0xff, 0xef, 0xff, 0x7e, 0x7e, 0x7e, 0x7e,
                    0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e, 0x7e,
                    0x7e, 0xb4, 0x00, 0x00, 0xff, 0x08, 0x00, 0x00, 0x00, 0x80, 0x00, 0x00, 0x00};
  Bytes again;
  CHECK_FALSE(reads(found, again));
  const Random random(31, 0, 1);
  std::size_t valid = 0;
  for (std::uint64_t trial = 0; trial < 20000; ++trial) {
    const std::uint64_t size = 4 + random.below(1000 * trial, 6), zeros = std::min(size, trial % 4);
    Bytes stream;
    for (std::uint64_t i = 0; i < size; ++i) {
      const std::uint64_t byte = i < trial % 5 ? 0xff : random.below(1000 * trial + 1 + i, 256);
      stream.push_back(i + zeros < size ? static_cast<std::uint8_t>(byte) : std::uint8_t{0});
    }
    if (!reads(stream, again)) continue;
    ++valid;
    CHECK(again == stream);
  }
  MESSAGE(valid, " of 20000 are valid");

  const Bytes beyond{0xff, 0xff, 0xff, 0x00}, within{0xff, 0xff, 0xfe, 0xff};
  BinaryDecoder gap(beyond);  // 256 times the 2^-8th part of 2^32 - 1, and a little
  CHECK(gap.decode_bits(8) == 255);
  CHECK(gap.overrun());
  BinaryDecoder last(within);
  CHECK(last.decode_bits(8) == 255);
  CHECK_FALSE(last.overrun());
}

TEST_CASE("coder/adaptive_binary: 1.7 million ones take less than 64 bytes (CO1)") {
  BinaryEncoder encoder;
  BinaryContext context;
  for (int i = 0; i < 1700000; ++i) encoder.encode(context, true);
  const Bytes stream = encoder.finish();
  CHECK(stream.size() < 64);
  BinaryDecoder decoder(stream);
  BinaryContext again;
  bool all = true;
  for (int i = 0; i < 1700000; ++i) all &= decoder.decode(again);
  CHECK(all);
  CHECK(decoder.valid());
  MESSAGE(stream.size(), " bytes");
  const double zeros = 0, share = zeros / 1700000;  // negative control: the share of zeros that was counted
  CHECK_FALSE(std::isfinite(-std::log2(share)));
}

TEST_CASE("coder/adaptive_binary: the rate of a constant source is its entropy and what learning costs") {
  for (const double p : {0.5, 0.2, 0.02, 0.001}) {
    const Random random(8, 0, random_stage("binary test"));
    BinaryEncoder encoder;
    BinaryContext context;
    constexpr std::size_t count = 200000;
    std::size_t ones = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const bool bit = random.uniform(i) < p;
      ones += bit;
      encoder.encode(context, bit);
    }
    const double share = static_cast<double>(ones) / count;
    const double entropy = -share * std::log2(share) - (1 - share) * std::log2(1 - share);
    const double bits = 8.0 * static_cast<double>(encoder.finish().size()) / count;
    CAPTURE(p);
    MESSAGE("p = ", p, ": ", bits - entropy, " bits a bit above ", entropy);
    CHECK(bits - entropy < 0.003);
  }
}

TEST_CASE(
    "coder/adaptive_binary: what is cut off or flipped is seen at the end, and nothing is read beyond it (EN10)") {
  const std::vector<bool> bits = sample_bits(600, 1);
  const Bytes stream = encoded(bits);
  bool equal = false;
  for (std::size_t length = 0; length < stream.size(); ++length) {
    const Bytes cut(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(length));
    CHECK(!decodes(cut, bits, equal));
  }
  Bytes longer = stream;
  longer.push_back(0);
  CHECK(!decodes(longer, bits, equal));
  std::size_t silent = 0;
  for (std::size_t i = 0; i < 8 * stream.size(); ++i) {
    Bytes damaged = stream;
    damaged[i / 8] = static_cast<std::uint8_t>(damaged[i / 8] ^ (1u << i % 8));
    const bool valid = decodes(damaged, bits, equal);
    if (valid) CHECK(!equal);  // what the end does not show is wrong all the same: the CRC's matter
    silent += valid;
  }
  CHECK(silent == 0);
  BinaryDecoder nothing(std::span<const std::uint8_t>{});
  CHECK(nothing.valid());
  (void)nothing.decode_bits(1);
  CHECK(nothing.overrun());
  CHECK(!nothing.valid());
  BinaryContext context;
  for (int i = 0; i < 1000; ++i) (void)nothing.decode(context);  // no end, no harm
}
