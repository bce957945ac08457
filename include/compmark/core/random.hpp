// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Counter-based random numbers: every number is a pure function of (seed, iteration, stage, index). No generator
// carries state, so the number a thread draws does not depend on what other threads drew, and a resumed run draws what
// the uninterrupted one would have. The mixer is the 64-bit finaliser of SplitMix64 (Steele, Lea, Flood, OOPSLA 2014),
// applied to a keyed counter.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string_view>

namespace compmark {

/// Names a consumer of random numbers: FNV-1a of its name, so that two stages never share a stream by accident.
[[nodiscard]] constexpr std::uint64_t random_stage(std::string_view name) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return hash;
}

[[nodiscard]] constexpr std::uint64_t mix_bits(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

/// A stream of random numbers, addressed by index. Cost: one multiply-xor chain (~2 ns) a number; 8 bytes.
class Random {
 public:
  constexpr Random(std::uint64_t seed, std::uint64_t iteration, std::uint64_t stage)
      : key_(mix_bits(mix_bits(mix_bits(seed) ^ iteration) ^ stage)) {}

  [[nodiscard]] constexpr std::uint64_t bits(std::uint64_t index) const {
    return mix_bits(key_ ^ mix_bits(index * 0xD1342543DE82EF95ull + 1));
  }
  /// Uniform in the open interval (0, 1): a multiple of 2^-52 plus 2^-53.
  [[nodiscard]] constexpr double uniform(std::uint64_t index) const {
    return (static_cast<double>(bits(index) >> 12) + 0.5) * 0x1p-52;
  }
  /// Uniform in the open interval (-1/2, 1/2), every value exact in float (23 bits; docs/spec/numerics.md, QD3).
  [[nodiscard]] constexpr float centered(std::uint64_t index) const {
    return (static_cast<float>(bits(index) >> 41) + 0.5f) * 0x1p-23f - 0.5f;
  }
  /// Uniform integer in [0, n), n > 0, by the high word of a 64 x 32 bit product (bias below n / 2^64 for n < 2^32).
  [[nodiscard]] constexpr std::uint64_t below(std::uint64_t index, std::uint64_t n) const {
    __extension__ using Wide = unsigned __int128;
    return static_cast<std::uint64_t>((static_cast<Wide>(bits(index)) * n) >> 64);
  }
  /// Standard normal by Box and Muller; index and index + 2^63 are its two uniforms.
  [[nodiscard]] double normal(std::uint64_t index) const {
    const double radius = std::sqrt(-2 * std::log(uniform(index)));
    return radius * std::cos(2 * std::numbers::pi * uniform(index ^ (1ull << 63)));
  }

 private:
  std::uint64_t key_;
};

}  // namespace compmark
