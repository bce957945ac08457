// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// SHA-256 (FIPS 180-4), for naming models: two runs that agree in every bit of their model file show the same 64
// digits. No dependency. One core takes 370 MB/s; built for a processor that has the instructions for it (-march=native
// where it does), 1,600 MB/s, and the digits are the same. It proves equality, and HMAC (hmac_sha256.hpp) derives from
// an owner's key with it; it does not run in constant time, so not where an attacker can time it.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

namespace compmark {
namespace detail {

using Sha256State = std::array<std::uint32_t, 8>;

/// The constants of the 64 rounds (FIPS 180-4, 4.2.2).
alignas(16) inline constexpr std::array<std::uint32_t, 64> sha256_constants{
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2};

/// Takes `blocks` blocks of 64 bytes into the state, in plain arithmetic (FIPS 180-4, 6.2.2).
inline void sha256_portable(Sha256State& state, const std::byte* data, std::size_t blocks) {
  for (; blocks > 0; --blocks, data += 64) {
    std::array<std::uint32_t, 16> w;  // the message schedule, of which a round needs the last sixteen words
    for (std::size_t i = 0; i < 16; ++i) {
      w[i] = std::to_integer<std::uint32_t>(data[4 * i]) << 24 | std::to_integer<std::uint32_t>(data[4 * i + 1]) << 16 |
             std::to_integer<std::uint32_t>(data[4 * i + 2]) << 8 | std::to_integer<std::uint32_t>(data[4 * i + 3]);
    }
    auto [a, b, c, d, e, f, g, h] = state;
    // One round renames its registers rather than moving them: the caller passes them turned by one.
    const auto round = [&w](std::size_t i, std::uint32_t a1, std::uint32_t b1, std::uint32_t c1, std::uint32_t& d1,
                            std::uint32_t e1, std::uint32_t f1, std::uint32_t g1, std::uint32_t& h1) {
      const std::uint32_t first = h1 + (std::rotr(e1, 6) ^ std::rotr(e1, 11) ^ std::rotr(e1, 25)) +
                                  (g1 ^ (e1 & (f1 ^ g1))) + sha256_constants[i] + w[i % 16];
      d1 += first;
      h1 = first + (std::rotr(a1, 2) ^ std::rotr(a1, 13) ^ std::rotr(a1, 22)) + ((a1 & b1) | (c1 & (a1 | b1)));
    };
    for (std::size_t i = 0; i < 64; i += 8) {
      if (i >= 16) {
        for (std::size_t j = i; j < i + 8; ++j) {
          const std::uint32_t s0 =
              std::rotr(w[(j + 1) % 16], 7) ^ std::rotr(w[(j + 1) % 16], 18) ^ (w[(j + 1) % 16] >> 3);
          const std::uint32_t s1 =
              std::rotr(w[(j + 14) % 16], 17) ^ std::rotr(w[(j + 14) % 16], 19) ^ (w[(j + 14) % 16] >> 10);
          w[j % 16] += s0 + w[(j + 9) % 16] + s1;
        }
      }
      round(i, a, b, c, d, e, f, g, h);
      round(i + 1, h, a, b, c, d, e, f, g);
      round(i + 2, g, h, a, b, c, d, e, f);
      round(i + 3, f, g, h, a, b, c, d, e);
      round(i + 4, e, f, g, h, a, b, c, d);
      round(i + 5, d, e, f, g, h, a, b, c);
      round(i + 6, c, d, e, f, g, h, a, b);
      round(i + 7, b, c, d, e, f, g, h, a);
    }
    const Sha256State sum{a, b, c, d, e, f, g, h};
    for (std::size_t i = 0; i < 8; ++i) state[i] += sum[i];
  }
}

#if defined(__SHA__) && defined(__SSE4_1__)
/// The same with the processor's instructions: four rounds at a time, on the state as the pairs (f e b a) and (h g d
/// c). They have no AVX form, and after AVX instructions each of them waits for the upper halves of registers, a
/// hundred times as long as it takes: so these are cleared, and the compiler may use no AVX in here.
[[gnu::noinline, gnu::target("no-avx,sse4.1,sha")]] inline void sha256_instructions(Sha256State& state,
                                                                                    const std::byte* data,
                                                                                    std::size_t blocks) {
  using Words = std::uint32_t __attribute__((vector_size(16)));
  using Signed = std::int32_t __attribute__((vector_size(16)));  // as the instructions are declared
  using Bytes = char __attribute__((vector_size(16)));
#if defined(__AVX__)
  asm volatile("vzeroupper" ::: "memory");
#endif
  Words feba{state[5], state[4], state[1], state[0]}, hgdc{state[7], state[6], state[3], state[2]};
  for (; blocks > 0; --blocks, data += 64) {
    const Words feba_before = feba, hgdc_before = hgdc;
    Words w[4];
    for (std::size_t i = 0; i < 4; ++i) {
      Bytes bytes;
      std::memcpy(&bytes, data + 16 * i, 16);
      bytes = __builtin_shufflevector(bytes, bytes, 3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12);
      std::memcpy(&w[i], &bytes, 16);
    }
    for (std::size_t i = 0; i < 16; ++i) {
      const Words now = w[i % 4];
      Words sum;
      std::memcpy(&sum, sha256_constants.data() + 4 * i, 16);
      sum += now;
      hgdc = reinterpret_cast<Words>(__builtin_ia32_sha256rnds2(
          reinterpret_cast<Signed>(hgdc), reinterpret_cast<Signed>(feba), reinterpret_cast<Signed>(sum)));
      sum = __builtin_shufflevector(sum, sum, 2, 3, 0, 0);
      feba = reinterpret_cast<Words>(__builtin_ia32_sha256rnds2(
          reinterpret_cast<Signed>(feba), reinterpret_cast<Signed>(hgdc), reinterpret_cast<Signed>(sum)));
      if (i < 12) {  // the words of round 4 i + 16, in the place of those just used
        const Words last = w[(i + 3) % 4],
                    first = reinterpret_cast<Words>(__builtin_ia32_sha256msg1(
                        reinterpret_cast<Signed>(now), reinterpret_cast<Signed>(w[(i + 1) % 4])));
        const Words mixed = first + __builtin_shufflevector(w[(i + 2) % 4], last, 1, 2, 3, 4);
        w[i % 4] = reinterpret_cast<Words>(
            __builtin_ia32_sha256msg2(reinterpret_cast<Signed>(mixed), reinterpret_cast<Signed>(last)));
      }
    }
    feba += feba_before;
    hgdc += hgdc_before;
  }
  state = {feba[3], feba[2], hgdc[3], hgdc[2], feba[1], feba[0], hgdc[1], hgdc[0]};
}
#endif

/// The faster of the two that this program was built for.
inline void sha256_blocks(Sha256State& state, const std::byte* data, std::size_t blocks) {
#if defined(__SHA__) && defined(__SSE4_1__)
  sha256_instructions(state, data, blocks);
#else
  sha256_portable(state, data, blocks);
#endif
}

}  // namespace detail

class Sha256 {
 public:
  Sha256& update(std::span<const std::byte> data) {
    length_ += data.size();
    if (fill_ > 0) {
      const std::size_t taken = std::min(data.size(), block_.size() - fill_);
      std::copy_n(data.begin(), taken, block_.begin() + static_cast<std::ptrdiff_t>(fill_));
      fill_ += taken;
      data = data.subspan(taken);
      if (fill_ < block_.size()) return *this;
      detail::sha256_blocks(state_, block_.data(), 1);
    }
    detail::sha256_blocks(state_, data.data(), data.size() / block_.size());
    fill_ = data.size() % block_.size();
    std::copy(data.end() - static_cast<std::ptrdiff_t>(fill_), data.end(), block_.begin());
    return *this;
  }

  /// The digest, 32 bytes. The object is spent afterwards.
  [[nodiscard]] std::array<std::byte, 32> digest() {
    const std::uint64_t bits = length_ * 8;
    std::array<std::byte, 72> tail{std::byte{0x80}};
    const std::size_t padding = (fill_ < 56 ? 56 : 120) - fill_;  // up to the length, which ends the last block
    for (std::size_t i = 0; i < 8; ++i) tail[padding + i] = static_cast<std::byte>(bits >> (56 - 8 * i));
    update(std::span<const std::byte>(tail).first(padding + 8));
    std::array<std::byte, 32> bytes{};
    for (std::size_t i = 0; i < bytes.size(); ++i)
      bytes[i] = static_cast<std::byte>(state_[i / 4] >> (24 - 8 * (i % 4)) & 0xFFu);
    return bytes;
  }
  /// The same as 64 hexadecimal digits.
  [[nodiscard]] std::string hex() {
    std::string text;
    for (const std::byte value : digest()) {
      const unsigned byte = std::to_integer<unsigned>(value);
      text += "0123456789abcdef"[byte >> 4];
      text += "0123456789abcdef"[byte & 15u];
    }
    return text;
  }

 private:
  detail::Sha256State state_{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                             0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  std::array<std::byte, 64> block_{};
  std::size_t fill_ = 0;
  std::uint64_t length_ = 0;
};

}  // namespace compmark
