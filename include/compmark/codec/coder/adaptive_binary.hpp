// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Adaptive binary coder for masks, hash bits and octree occupancy: a range coder of 32 bits whose carries wait in a
// cached byte and a count (written bytes are never edited: docs/spec/numerics.md, EN9), with contexts that learn the
// probability of a one from the bits themselves. Whole numbers only. The first bits of a context count (rate 1/(n +
// 1.5): a prior of a quarter bit each way), later ones age at 1/256; the estimate has 32 bits and the coder 16 of them,
// so that a constant bit costs 2e-5 bits (CO1). A stream ends with the lower end of its last interval: a decoder that
// took another path ends elsewhere, which `valid` sees with a probability of at least 1 - 2^-16.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace compmark {

namespace detail {

/// 2^16 / (n + 1.5): how far an estimate moves after its n-th bit.
inline constexpr auto binary_rates = [] {
  std::array<std::uint16_t, 256> rates{};
  for (std::uint32_t n = 0; n < 256; ++n) rates[n] = static_cast<std::uint16_t>((1u << 17) / (2 * n + 3));
  return rates;
}();

inline constexpr std::uint32_t least_binary_range = 1u << 24;

}  // namespace detail

/// What a coder has learnt of one kind of bit. Encoder and decoder each keep their own and begin with equal ones.
struct BinaryContext {
  std::uint32_t one = 1u << 31;  ///< probability of a one, in units of 2^-32
  std::uint32_t count = 0;       ///< bits seen, held at the last of `detail::binary_rates`

  /// Probability of a one in units of 2^-16, never 0 and never 1.
  [[nodiscard]] std::uint32_t probability() const { return std::clamp(one >> 16, 1u, 65535u); }

  void learn(bool bit) {
    const std::int64_t target = bit ? 0xffffffff : 0;
    one = static_cast<std::uint32_t>(one + ((target - one) * detail::binary_rates[count] >> 16));
    count = std::min<std::uint32_t>(count + 1, detail::binary_rates.size() - 1);
  }
};

/// Bits in, bytes out.
class BinaryEncoder {
 public:
  void encode(BinaryContext& context, bool bit) {
    normalise();
    const std::uint32_t ones = (range_ >> 16) * context.probability();
    if (bit) {
      range_ = ones;
    } else {
      low_ += ones;
      range_ -= ones;
    }
    context.learn(bit);
  }

  /// The `count` <= 32 low bits of a value at one bit each, the highest first.
  void encode_bits(std::uint32_t value, int count) {
    while (count > 0) {
      const int part = std::min(count, 8);
      count -= part;
      normalise();
      range_ >>= part;
      low_ += static_cast<std::uint64_t>(range_) * (value >> count & ((1u << part) - 1));
    }
  }

  /// The `count` low bits of a value, the highest first. The bits above each one select its context: `contexts` holds
  /// 2^count - 1.
  void encode_tree(std::span<BinaryContext> contexts, std::uint32_t value, int count) {
    std::size_t node = 0;
    while (count-- > 0) {
      const bool bit = (value >> count & 1u) != 0;
      encode(contexts[node], bit);
      node = 2 * node + (bit ? 2 : 1);
    }
  }

  /// The stream; empty if nothing was encoded. The encoder begins anew.
  [[nodiscard]] std::vector<std::uint8_t> finish() {
    if (begun_) {
      for (int byte = 0; byte < 5; ++byte) shift();
    }
    std::vector<std::uint8_t> stream = std::move(bytes_);
    *this = BinaryEncoder{};
    return stream;
  }

 private:
  void normalise() {
    begun_ = true;
    while (range_ < detail::least_binary_range) {
      shift();
      range_ <<= 8;
    }
  }
  /// Moves the top byte of `low` out. A byte 0xff may still receive a carry and waits, as does the byte before it.
  void shift() {
    if (low_ < 0xff000000u || low_ > 0xffffffffu) {
      const auto carry = static_cast<std::uint8_t>(low_ >> 32);
      if (cached_) bytes_.push_back(static_cast<std::uint8_t>(cache_ + carry));
      bytes_.insert(bytes_.end(), waiting_, static_cast<std::uint8_t>(0xff + carry));
      waiting_ = 0;
      cache_ = static_cast<std::uint8_t>(low_ >> 24);
      cached_ = true;
    } else {
      ++waiting_;
    }
    low_ = (low_ & 0x00ffffffu) << 8;
  }

  std::uint64_t low_ = 0;  // 32 bits and a carry
  std::uint32_t range_ = 0xffffffff;
  std::uint8_t cache_ = 0;
  bool cached_ = false;
  bool begun_ = false;
  std::size_t waiting_ = 0;  // bytes 0xff behind the cached one
  std::vector<std::uint8_t> bytes_;
};

/// The bits again. Any bytes may be given: beyond their end zeros are read, and `overrun` tells.
class BinaryDecoder {
 public:
  explicit BinaryDecoder(std::span<const std::uint8_t> stream) : stream_(stream) {
    if (stream.empty()) {
      range_ = 1;  // the first bit asked for finds nothing
    } else {
      for (int byte = 0; byte < 4; ++byte) offset_ = offset_ << 8 | next();
      overrun_ = overrun_ || offset_ >= range_;
    }
  }

  [[nodiscard]] bool decode(BinaryContext& context) {
    normalise();
    const std::uint32_t ones = (range_ >> 16) * context.probability();
    const bool bit = offset_ < ones;
    if (bit) {
      range_ = ones;
    } else {
      offset_ -= ones;
      range_ -= ones;
    }
    context.learn(bit);
    return bit;
  }

  [[nodiscard]] std::uint32_t decode_bits(int count) {
    std::uint32_t value = 0;
    while (count > 0) {
      const int part = std::min(count, 8);
      count -= part;
      normalise();
      range_ >>= part;
      const std::uint32_t digit = offset_ / range_, most = (1u << part) - 1;
      overrun_ = overrun_ || digit > most;  // what a whole division of the range leaves over: no encoder goes there
      offset_ -= std::min(digit, most) * range_;
      value = value << part | std::min(digit, most);
    }
    return value;
  }

  [[nodiscard]] std::uint32_t decode_tree(std::span<BinaryContext> contexts, int count) {
    std::size_t node = 0;
    std::uint32_t value = 0;
    while (count-- > 0) {
      const bool bit = decode(contexts[node]);
      value = value << 1 | (bit ? 1u : 0u);
      node = 2 * node + (bit ? 2 : 1);
    }
    return value;
  }

  /// True after bits were asked for that the stream does not hold, or that no encoder writes: their values are
  /// meaningless. For loops whose end depends on the bits themselves.
  [[nodiscard]] bool overrun() const { return overrun_; }
  /// After the last bit: the stream is used up, and the decoder stands where the encoder ended.
  [[nodiscard]] bool valid() const { return !overrun_ && position_ == stream_.size() && offset_ == 0; }

 private:
  void normalise() {
    while (range_ < detail::least_binary_range) {
      offset_ = offset_ << 8 | next();
      range_ <<= 8;
    }
  }
  std::uint8_t next() {
    if (position_ < stream_.size()) return stream_[position_++];
    overrun_ = true;
    return 0;
  }

  std::span<const std::uint8_t> stream_;
  std::size_t position_ = 0;
  std::uint32_t offset_ = 0;  // of the stream's number above the interval's lower end
  std::uint32_t range_ = 0xffffffff;
  bool overrun_ = false;
};

}  // namespace compmark
