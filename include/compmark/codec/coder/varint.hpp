// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whole numbers of any size in seven bits a byte, lowest first, the top bit set on all bytes but the last: escapes and
// counts (docs/spec/numerics.md, EN8). One number has one spelling: a reader refuses needless zeros and what does not
// fit 64 bits. Signs by zig-zag, total on int64.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace compmark {

/// 0, -1, 1, -2, ... to 0, 1, 2, 3, ...
[[nodiscard]] constexpr std::uint64_t zigzag(std::int64_t value) {
  return static_cast<std::uint64_t>(value) << 1 ^ static_cast<std::uint64_t>(value >> 63);
}
[[nodiscard]] constexpr std::int64_t unzigzag(std::uint64_t code) {
  return static_cast<std::int64_t>(code >> 1 ^ (~(code & 1) + 1));
}

[[nodiscard]] constexpr int varint_size(std::uint64_t value) {
  int size = 1;
  while (value >>= 7) ++size;
  return size;
}

inline void put_varint(std::vector<std::uint8_t>& bytes, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) bytes.push_back(static_cast<std::uint8_t>(value | 0x80));
  bytes.push_back(static_cast<std::uint8_t>(value));
}

/// The number at the head of `bytes`, which then begin behind it; nothing if there is none.
[[nodiscard]] inline std::optional<std::uint64_t> take_varint(std::span<const std::uint8_t>& bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < bytes.size() && i < 10; ++i) {
    const std::uint64_t digit = bytes[i] & 0x7fu;
    if (i == 9 && bytes[i] > 1) return std::nullopt;  // bit 64
    value |= digit << (7 * i);
    if (bytes[i] < 0x80) {
      if (i > 0 && digit == 0) return std::nullopt;
      bytes = bytes.subspan(i + 1);
      return value;
    }
  }
  return std::nullopt;
}

}  // namespace compmark
