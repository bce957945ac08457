// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Adaptive bits with one interface for both directions: BitsOut writes the bit that a call is given, BitsIn ignores it
// and returns the bit it reads. One traversal of a tree, a mask or a table then serves the encoder and the decoder, and
// the two cannot differ.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "compmark/codec/coder/adaptive_binary.hpp"

namespace compmark::detail {

[[nodiscard]] inline std::span<const std::uint8_t> octets(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
}

class BitsOut {
 public:
  static constexpr bool writes = true;

  bool operator()(BinaryContext& context, bool bit) {
    coder_.encode(context, bit);
    return bit;
  }
  /// The low bits of a value; the context of each is given by the bits above it.
  std::uint32_t tree(std::span<BinaryContext> contexts, std::uint32_t value, int count) {
    coder_.encode_tree(contexts, value, count);
    return value;
  }
  /// The same without contexts, one bit each.
  std::uint32_t raw(std::uint32_t value, int count) {
    coder_.encode_bits(value, count);
    return value;
  }
  [[nodiscard]] static bool overrun() { return false; }
  [[nodiscard]] std::vector<std::byte> finish() {
    const std::vector<std::uint8_t> stream = coder_.finish();
    const std::span<const std::byte> bytes = std::as_bytes(std::span<const std::uint8_t>(stream));
    return {bytes.begin(), bytes.end()};
  }

 private:
  BinaryEncoder coder_;
};

class BitsIn {
 public:
  static constexpr bool writes = false;

  explicit BitsIn(std::span<const std::byte> bytes) : coder_(octets(bytes)), empty_(bytes.empty()) {}

  bool operator()(BinaryContext& context, bool /*bit*/) {
    used_ = true;
    return coder_.decode(context);
  }
  std::uint32_t tree(std::span<BinaryContext> contexts, std::uint32_t /*value*/, int count) {
    used_ = true;
    return coder_.decode_tree(contexts, count);
  }
  std::uint32_t raw(std::uint32_t /*value*/, int count) {
    used_ = used_ || count > 0;
    return coder_.decode_bits(count);
  }
  /// True after more bits were read than there are: the values are meaningless.
  [[nodiscard]] bool overrun() const { return coder_.overrun(); }
  /// True where the decoder stands at the encoder's last position and no byte is left.
  [[nodiscard]] bool complete() const { return used_ ? coder_.valid() : empty_; }

 private:
  BinaryDecoder coder_;
  bool empty_ = true, used_ = false;
};

/// value >= 0 as Exp-Golomb of adaptive bits: contexts [2][32].
template <class Bits>
[[nodiscard]] std::uint32_t adaptive_count(Bits& bits, std::array<BinaryContext, 64>& contexts, std::uint32_t value) {
  const std::uint64_t shifted = std::uint64_t{value} + 1;
  const int digits = static_cast<int>(std::bit_width(shifted)) - 1;
  int length = 0;
  while (length < 32 && bits(contexts[static_cast<std::size_t>(length)], length < digits)) ++length;
  if (length >= 32) return std::numeric_limits<std::uint32_t>::max();  // only garbage says so; callers check the sum
  std::uint64_t result = 1;
  for (int i = length - 1; i >= 0; --i) {
    result = result << 1 | (bits(contexts[static_cast<std::size_t>(32 + i)], (shifted >> i & 1u) != 0) ? 1u : 0u);
  }
  return static_cast<std::uint32_t>(result - 1);
}

}  // namespace compmark::detail
