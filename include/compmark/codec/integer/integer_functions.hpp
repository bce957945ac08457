// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions that the coding side needs, in whole numbers: shifts that round, the step q / Q0 = 1 + tanh r on a grid
// of sixteen steps an octave (docs/spec/compression.md, 3.2, point 4), its value and its reciprocal. Tables come from
// integer square roots and squarings that the compiler runs: no float, no libm, the same bits on every machine. They
// are part of the numeric specification of a file: a change of one entry is another decoder, which a hash in the tests
// and in each file (TABL) sees.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace compmark {

/// x / 2^shift to the nearest, halves up; a negative shift multiplies. |x| < 2^62 / 2^-shift is the caller's to keep.
[[nodiscard]] constexpr std::int64_t round_shift(std::int64_t x, int shift) {
  if (shift <= 0) return x * (std::int64_t{1} << -shift);
  return (x + (std::int64_t{1} << (shift - 1))) >> shift;
}

/// Steps of quantization: q = Q0 2^(index / 16), index in [-96, 16].
struct StepGrid {
  static constexpr int least = -96, greatest = 16, count = greatest - least + 1;
  static constexpr int fraction_bits = 24;  ///< of `ratio` and `reciprocal`
  static constexpr int r_bits = 16;         ///< fraction bits of r
};

namespace detail {

[[nodiscard]] constexpr std::uint64_t integer_sqrt(std::uint64_t x) {
  std::uint64_t root = 0;
  for (std::uint64_t bit = std::uint64_t{1} << 31; bit != 0; bit >>= 1) {
    if ((root | bit) * (root | bit) <= x) root |= bit;
  }
  return root;
}

/// 2^(k / 32) with 31 fraction bits.
[[nodiscard]] constexpr std::array<std::uint64_t, 32> make_octave() {
  std::array<std::uint64_t, 32> octave{};
  std::uint64_t root = std::uint64_t{1} << 32;  // 2
  octave[0] = root >> 1;
  for (std::size_t k = 16; k >= 1; k /= 2) {
    root = integer_sqrt(root << 31);
    octave[k] = root;
  }
  for (std::size_t k = 3; k < 32; ++k) {
    const std::size_t low = k & (~k + 1);
    if (low != k) octave[k] = (octave[k - low] * octave[low] + (std::uint64_t{1} << 30)) >> 31;
  }
  return octave;
}
inline constexpr std::array<std::uint64_t, 32> octave_table = make_octave();

/// 2^(k / 32) with `bits` <= 31 fraction bits, any k that fits.
[[nodiscard]] constexpr std::uint64_t power_of_two(int k, int bits) {
  const int octave = k >> 5, shift = 31 - bits - octave;
  const std::uint64_t value = octave_table[static_cast<std::size_t>(k & 31)];
  return shift <= 0 ? value << -shift : (value + (std::uint64_t{1} << (shift - 1))) >> shift;
}

/// log2(x 2^-31) with 26 fraction bits, 0 < x < 2^32: one bit a squaring.
[[nodiscard]] constexpr std::int64_t log2_q26(std::uint64_t x) {
  std::int64_t result = 0;
  while (x < std::uint64_t{1} << 31) {
    x <<= 1;
    result -= std::int64_t{1} << 26;
  }
  for (int bit = 25; bit >= 0; --bit) {
    x = (x * x + (std::uint64_t{1} << 30)) >> 31;
    if (x >= std::uint64_t{1} << 32) {
      result += std::int64_t{1} << bit;
      x >>= 1;
    }
  }
  return result;
}

struct StepTables {
  std::array<std::uint32_t, StepGrid::count> ratio{};         ///< q / Q0, Q24
  std::array<std::uint32_t, StepGrid::count> reciprocal{};    ///< Q0 / q, Q24
  std::array<std::int32_t, StepGrid::count - 1> threshold{};  ///< [i]: least r (Q16) of index least + 1 + i
};

[[nodiscard]] constexpr StepTables make_step_tables() {
  StepTables tables;
  constexpr std::int64_t ln2 = 744'261'118;  // Q30
  for (int i = 0; i < StepGrid::count; ++i) {
    const int index = StepGrid::least + i;
    tables.ratio[static_cast<std::size_t>(i)] =
        static_cast<std::uint32_t>(power_of_two(2 * index, StepGrid::fraction_bits));
    tables.reciprocal[static_cast<std::size_t>(i)] =
        static_cast<std::uint32_t>(power_of_two(-2 * index, StepGrid::fraction_bits));
    if (i == 0) continue;
    // The border to the index before: y = 1 + tanh r = 2^((index - 1/2) / 16), r = (log2 y - log2(2 - y)) ln 2 / 2.
    const std::uint64_t y = power_of_two(2 * index - 1, 31);
    const std::int64_t log2_ratio = (std::int64_t{2 * index - 1} << 21) - log2_q26((std::uint64_t{1} << 32) - y);
    tables.threshold[static_cast<std::size_t>(i - 1)] =
        static_cast<std::int32_t>(round_shift(log2_ratio * ln2, 26 + 30 + 1 - StepGrid::r_bits));
  }
  return tables;
}
inline constexpr StepTables step_tables = make_step_tables();

}  // namespace detail

/// round(16 log2(1 + tanh r)) in [-96, 16]; r with 16 fraction bits.
[[nodiscard]] inline int step_index(std::int32_t r) {
  const auto& border = detail::step_tables.threshold;
  return StepGrid::least + static_cast<int>(std::upper_bound(border.begin(), border.end(), r) - border.begin());
}
/// q / Q0 with 24 fraction bits.
[[nodiscard]] constexpr std::int64_t step_ratio(int index) {
  return detail::step_tables.ratio[static_cast<std::size_t>(index - StepGrid::least)];
}
/// Q0 / q with 24 fraction bits.
[[nodiscard]] constexpr std::int64_t step_reciprocal(int index) {
  return detail::step_tables.reciprocal[static_cast<std::size_t>(index - StepGrid::least)];
}

/// The greatest symbol. Up to it k q, rounded to float, still rounds back to k: 2^23 - 1 half bins of 2^-24 are less
/// than a half.
inline constexpr std::int32_t greatest_symbol = (1 << 23) - 1;

/// The value of a symbol: an exact integer product, one product of doubles, one rounding to float.
[[nodiscard]] inline float symbol_value(std::int32_t symbol, int index, double base_step) {
  return static_cast<float>(static_cast<double>(symbol * step_ratio(index)) * (base_step * 0x1p-24));
}

/// FNV-1a of the tables, least byte first.
[[nodiscard]] constexpr std::uint64_t step_table_hash() {
  std::uint64_t hash = 0xCBF29CE484222325ull;
  const auto add = [&](std::uint32_t word) {
    for (int shift = 0; shift < 32; shift += 8) hash = (hash ^ (word >> shift & 255u)) * 0x100000001B3ull;
  };
  for (const std::uint32_t value : detail::step_tables.ratio) add(value);
  for (const std::uint32_t value : detail::step_tables.reciprocal) add(value);
  for (const std::int32_t value : detail::step_tables.threshold) add(static_cast<std::uint32_t>(value));
  return hash;
}

}  // namespace compmark
