// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Expands a 256-bit seed to the secret bytes that carriers need. It is the ChaCha20 key stream (RFC 8439, counter from
// 0, nonce 0). 48 carriers in 96 dimensions take 72 KiB, more than HKDF gives. The library's counter-based random
// numbers are no choice here: they are not secret once their generator is known. Cost: ~4 cycles a byte.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/watermark/proof/carriers.hpp"

namespace compmark {

/// Sixteen words of the key stream for sixteen words of state.
[[nodiscard]] inline std::array<std::uint32_t, 16> chacha20_block(const std::array<std::uint32_t, 16>& state) {
  std::array<std::uint32_t, 16> x = state;
  const auto quarter = [&](std::size_t a, std::size_t b, std::size_t c, std::size_t d) {
    x[a] += x[b];
    x[d] = std::rotl(x[d] ^ x[a], 16);
    x[c] += x[d];
    x[b] = std::rotl(x[b] ^ x[c], 12);
    x[a] += x[b];
    x[d] = std::rotl(x[d] ^ x[a], 8);
    x[c] += x[d];
    x[b] = std::rotl(x[b] ^ x[c], 7);
  };
  for (int round = 0; round < 10; ++round) {
    for (std::size_t i = 0; i < 4; ++i) quarter(i, 4 + i, 8 + i, 12 + i);
    for (std::size_t i = 0; i < 4; ++i) quarter(i, 4 + (i + 1) % 4, 8 + (i + 2) % 4, 12 + (i + 3) % 4);
  }
  for (std::size_t i = 0; i < 16; ++i) x[i] += state[i];
  return x;
}

/// Fills `bytes` with the key stream of `seed`, whose words are key bytes in little-endian order.
inline void chacha20_stream(const std::array<std::uint64_t, 4>& seed, std::span<std::byte> bytes) {
  std::array<std::uint32_t, 16> state{0x61707865, 0x3320646e, 0x79622d32, 0x6b206574};
  for (std::size_t i = 0; i < 4; ++i) {
    state[4 + 2 * i] = static_cast<std::uint32_t>(seed[i]);
    state[5 + 2 * i] = static_cast<std::uint32_t>(seed[i] >> 32);
  }
  for (std::size_t at = 0; at < bytes.size(); at += 64, ++state[12]) {
    const std::array<std::uint32_t, 16> block = chacha20_block(state);
    for (std::size_t i = 0; i < 64 && at + i < bytes.size(); ++i)
      bytes[at + i] = static_cast<std::byte>(block[i / 4] >> (8 * (i % 4)));
  }
}

/// Carriers of a key: make_carriers(carrier_seed(key), bits, weights.dimension()).
[[nodiscard]] inline std::vector<double> make_carriers(const std::array<std::uint64_t, 4>& seed, int bits,
                                                       int dimension) {
  std::vector<std::byte> bytes(carrier_bytes(bits, dimension));
  chacha20_stream(seed, bytes);
  return make_carriers(std::span<const std::byte>(bytes), bits, dimension);
}

}  // namespace compmark
