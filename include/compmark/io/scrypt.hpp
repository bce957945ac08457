// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// scrypt (RFC 7914): a derivation that takes time and memory on purpose, so that keys cannot be tried by the billion.
// PBKDF2-HMAC-SHA-256 with one iteration, ROMix over N blocks of 128 r bytes, Salsa20/8. Cost: 4 N r Salsa cores and
// 128 N r bytes; N = 2^17, r = 8 takes 128 MiB and 0.6 s of one thread (OpenSSL: 0.7). As sha256.hpp, not in constant
// time.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/io/hmac_sha256.hpp"

namespace compmark {

/// The numbers of one derivation: N = 2^log2_n (a cost that doubles with each step), blocks of 128 r bytes, p lanes.
struct ScryptCost {
  unsigned log2_n = 17;
  unsigned r = 8;
  unsigned p = 1;
};

/// Bytes that the derivation holds.
[[nodiscard]] constexpr std::uint64_t scrypt_memory(const ScryptCost& cost) {
  return (std::uint64_t{128} * cost.r) << cost.log2_n;
}

namespace detail {

/// PBKDF2-HMAC-SHA-256 with one iteration.
inline void pbkdf2_once(ByteSpan password, ByteSpan salt, std::span<std::byte> out) {
  for (std::size_t begin = 0, round = 1; begin < out.size(); begin += 32, ++round) {
    const std::array<std::byte, 4> counter{static_cast<std::byte>(round >> 24), static_cast<std::byte>(round >> 16),
                                           static_cast<std::byte>(round >> 8), static_cast<std::byte>(round)};
    const Digest256 block = hmac_sha256(password, {salt, counter});
    std::copy_n(block.begin(), std::min<std::size_t>(32, out.size() - begin),
                out.begin() + static_cast<std::ptrdiff_t>(begin));
  }
}

// Plain arrays, not std::array or spans: without an optimiser a call for each word would take 9 s a key, not 2.
struct SalsaBlock {
  std::uint32_t words[16];
};

/// Salsa20 with 8 rounds, in place (RFC 7914, 3).
inline void salsa20_8(SalsaBlock& block) {
  // The four words of each quarter round: columns, then rows.
  static constexpr unsigned char quarters[8][4] = {{0, 4, 8, 12}, {5, 9, 13, 1}, {10, 14, 2, 6}, {15, 3, 7, 11},
                                                   {0, 1, 2, 3},  {5, 6, 7, 4},  {10, 11, 8, 9}, {15, 12, 13, 14}};
  std::uint32_t x[16];
  for (int i = 0; i < 16; ++i) x[i] = block.words[i];
  for (int round = 0; round < 8; round += 2)
    for (const auto& quarter : quarters) {
      std::uint32_t a = x[quarter[0]], b = x[quarter[1]], c = x[quarter[2]], d = x[quarter[3]], sum = a + d;
      b ^= sum << 7 | sum >> 25;
      sum = b + a;
      c ^= sum << 9 | sum >> 23;
      sum = c + b;
      d ^= sum << 13 | sum >> 19;
      sum = d + c;
      a ^= sum << 18 | sum >> 14;
      x[quarter[0]] = a, x[quarter[1]] = b, x[quarter[2]] = c, x[quarter[3]] = d;
    }
  for (int i = 0; i < 16; ++i) block.words[i] += x[i];
}

/// scryptBlockMix of 2 r blocks, from `in` to `out` (RFC 7914, 4).
inline void scrypt_block_mix(std::span<const SalsaBlock> in, std::span<SalsaBlock> out) {
  SalsaBlock x = in.back();
  const std::size_t half = in.size() / 2;
  for (std::size_t i = 0; i < in.size(); ++i) {
    const std::uint32_t* const words = in[i].words;
    for (int w = 0; w < 16; ++w) x.words[w] ^= words[w];
    salsa20_8(x);
    out[i / 2 + (i % 2) * half] = x;
  }
}

/// scryptROMix of one lane of 128 r bytes, in place (RFC 7914, 5).
inline void scrypt_ro_mix(std::span<std::byte> lane, const ScryptCost& cost) {
  const std::size_t blocks = 2 * std::size_t{cost.r}, n = std::size_t{1} << cost.log2_n;
  std::vector<SalsaBlock> table(blocks * n), x(blocks), y(blocks);
  for (std::size_t i = 0; i < 16 * blocks; ++i) {
    const auto byte = [&](std::size_t k) { return std::to_integer<std::uint32_t>(lane[4 * i + k]); };
    x[i / 16].words[i % 16] = byte(0) | byte(1) << 8 | byte(2) << 16 | byte(3) << 24;
  }
  for (std::size_t i = 0; i < n; ++i) {
    std::copy(x.begin(), x.end(), table.begin() + static_cast<std::ptrdiff_t>(i * blocks));
    scrypt_block_mix(x, y);
    x.swap(y);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = x[blocks - 1].words[0] & (n - 1);  // Integerify modulo N, N at most 2^32
    for (std::size_t k = 0; k < blocks; ++k) {
      std::uint32_t* const mixed = x[k].words;
      const std::uint32_t* const read = table[j * blocks + k].words;
      for (int w = 0; w < 16; ++w) mixed[w] ^= read[w];
    }
    scrypt_block_mix(x, y);
    x.swap(y);
  }
  for (std::size_t i = 0; i < 16 * blocks; ++i)
    for (std::size_t k = 0; k < 4; ++k) lane[4 * i + k] = static_cast<std::byte>(x[i / 16].words[i % 16] >> (8 * k));
}

}  // namespace detail

/// Fills `out` from a password and a salt. 1 <= log2_n <= 30, r >= 1, p >= 1.
inline void scrypt(ByteSpan password, ByteSpan salt, const ScryptCost& cost, std::span<std::byte> out) {
  COMPMARK_ASSERT(cost.log2_n >= 1 && cost.log2_n <= 30 && cost.r >= 1 && cost.p >= 1, "scrypt: its cost is none");
  const std::size_t lane = std::size_t{128} * cost.r;
  std::vector<std::byte> mixed(lane * cost.p);
  detail::pbkdf2_once(password, salt, mixed);
  for (std::size_t i = 0; i < cost.p; ++i) detail::scrypt_ro_mix(std::span(mixed).subspan(i * lane, lane), cost);
  detail::pbkdf2_once(password, mixed, out);
}

}  // namespace compmark
