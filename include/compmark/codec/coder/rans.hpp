// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The two steps of an asymmetric numeral system (Duda 2013, arXiv:1311.2540, in its range variant): a state of 63 bits
// that gives and takes words of 32. Symbols are put in backwards and come out forwards. There are no carries. A step
// loses less than 2^-15 bits.
#pragma once

#include <cstdint>

namespace compmark {

/// Between symbols every state is in [least, 2^32 least).
inline constexpr std::uint64_t least_rans_state = std::uint64_t{1} << 31;

/// Puts the symbol with the numbers [start, start + frequency) of 2^16 into a state. Words grow downwards: the one
/// below `words` is written in any case and kept if the state has overflowed. frequency > 0.
inline void rans_put(std::uint64_t& state, std::uint32_t*& words, std::uint32_t start, std::uint32_t frequency) {
  const unsigned full = state >= std::uint64_t{frequency} << (63 - 16) ? 1 : 0;
  *(words - 1) = static_cast<std::uint32_t>(state);
  words -= full;
  state >>= 32 * full;
  const std::uint64_t quotient = state / frequency;
  state = (quotient << 16) + (state - quotient * frequency) + start;
}

/// The number below 2^16 that names the next symbol.
[[nodiscard]] inline std::uint32_t rans_number(std::uint64_t state) {
  return static_cast<std::uint32_t>(state & 0xffff);
}

/// Takes a symbol out. Below the least state a word must follow: state << 32 | word.
[[nodiscard]] inline std::uint64_t rans_take(std::uint64_t state, std::uint32_t start, std::uint32_t frequency) {
  return frequency * (state >> 16) + (state & 0xffff) - start;
}

}  // namespace compmark
