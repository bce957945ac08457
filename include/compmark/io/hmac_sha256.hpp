// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// HMAC-SHA-256 (RFC 2104, FIPS 198-1) and HKDF (RFC 5869): one secret gives independent bytes for every purpose, and
// none of them says anything about the secret or about the others. Cost: two extra compressions a message, ~1 us.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/io/sha256.hpp"

namespace compmark {

using Digest256 = std::array<std::byte, 32>;
using ByteSpan = std::span<const std::byte>;

[[nodiscard]] inline ByteSpan bytes_of(std::string_view text) {
  return std::as_bytes(std::span<const char>(text.data(), text.size()));
}

/// Lower-case hexadecimal digits.
[[nodiscard]] inline std::string to_hex(ByteSpan bytes) {
  std::string text;
  for (const std::byte value : bytes) {
    const unsigned byte = std::to_integer<unsigned>(value);
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15u];
  }
  return text;
}

/// Bytes of hexadecimal digits, as many as `out` holds; false if it is another number or another character.
[[nodiscard]] inline bool from_hex(std::string_view text, std::span<std::byte> out) {
  if (text.size() != 2 * out.size()) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const bool lower = c >= 'a' && c <= 'f', upper = c >= 'A' && c <= 'F';
    if (!lower && !upper && (c < '0' || c > '9')) return false;
    const unsigned digit = static_cast<unsigned>(c - (lower ? 'a' - 10 : upper ? 'A' - 10 : '0'));
    out[i / 2] = static_cast<std::byte>(i % 2 == 0 ? digit << 4 : std::to_integer<unsigned>(out[i / 2]) | digit);
  }
  return true;
}

/// SHA-256 of the parts, one after the other.
[[nodiscard]] inline Digest256 sha256_digest(std::initializer_list<ByteSpan> parts) {
  Sha256 hash;
  for (const ByteSpan part : parts) hash.update(part);
  return hash.digest();
}

/// HMAC-SHA-256 of the parts, one after the other.
[[nodiscard]] inline Digest256 hmac_sha256(ByteSpan key, std::initializer_list<ByteSpan> parts) {
  std::array<std::byte, 64> inner{}, outer{};
  if (key.size() > inner.size()) {
    const Digest256 digest = sha256_digest({key});
    std::copy(digest.begin(), digest.end(), inner.begin());
  } else {
    std::copy(key.begin(), key.end(), inner.begin());
  }
  for (std::size_t i = 0; i < inner.size(); ++i) {
    outer[i] = inner[i] ^ std::byte{0x5C};
    inner[i] ^= std::byte{0x36};
  }
  Sha256 hash;
  hash.update(inner);
  for (const ByteSpan part : parts) hash.update(part);
  const Digest256 digest = hash.digest();
  return sha256_digest({outer, digest});
}

/// HKDF-SHA-256: fills `out` (at most 255 * 32 bytes) from the secret, for the purpose `info`.
inline void hkdf_sha256(ByteSpan secret, ByteSpan salt, ByteSpan info, std::span<std::byte> out) {
  COMPMARK_ASSERT(out.size() <= 255 * 32, "hkdf_sha256: at most 8160 bytes");
  const Digest256 extracted = hmac_sha256(salt, {secret});
  Digest256 block{};
  for (std::size_t begin = 0, round = 1; begin < out.size(); begin += block.size(), ++round) {
    const std::array<std::byte, 1> counter{static_cast<std::byte>(round)};
    const ByteSpan previous = round == 1 ? ByteSpan{} : ByteSpan{block};
    block = hmac_sha256(extracted, {previous, info, counter});
    std::copy_n(block.begin(), std::min(block.size(), out.size() - begin),
                out.begin() + static_cast<std::ptrdiff_t>(begin));
  }
}

}  // namespace compmark
