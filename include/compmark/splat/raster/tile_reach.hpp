// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which splats reach which block of a cell, as a bit matrix that is read both ways: by splat (which blocks?) and by
// block (which splats?). Lists are worked on in chunks of 256 splats, so that this, and everything kept a splat, has a
// fixed size.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "compmark/core/config.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/raster/tile_cell.hpp"

namespace compmark::detail {

inline constexpr std::size_t chunk_splats = 256;  ///< splats of a tile's list that are worked on together
inline constexpr std::size_t chunk_words = chunk_splats / 64;

/// Splats that a block works on together.
inline constexpr int step_splats = 4;

/// Transposes 8 rows of 8 bits.
[[nodiscard]] constexpr std::uint64_t transpose_bits(std::uint64_t x) {
  std::uint64_t t = (x ^ (x >> 7)) & 0x00AA00AA00AA00AAull;
  x ^= t ^ (t << 7);
  t = (x ^ (x >> 14)) & 0x0000CCCC0000CCCCull;
  x ^= t ^ (t << 14);
  t = (x ^ (x >> 28)) & 0x00000000F0F0F0F0ull;
  return x ^ t ^ (t << 28);
}

/// The blocks each splat of a chunk reaches, as bits, both ways round.
struct ReachBits {
  alignas(64) std::uint8_t low[chunk_splats], high[chunk_splats];  // splat by splat: blocks 0 … 7 and 8 … 15
  alignas(64) std::uint64_t word[cell_blocks][chunk_words];        // block by block: bit k of word k / 64 is splat k

  /// Fills `word` from the first `count` splats.
  void by_block(std::size_t count) {
    static_assert(std::endian::native == std::endian::little, "ReachBits reads eight bytes as one little-endian word");
    for (std::size_t k = count; k < (count + 63) / 64 * 64; ++k) low[k] = high[k] = 0;
    for (std::size_t i = 0; i < (count + 63) / 64; ++i) {
      for (int half = 0; half < 2; ++half) {
        std::uint64_t words[8] = {};
        for (std::size_t group = 0; group < 8; ++group) {
          std::uint64_t bits;
          std::memcpy(&bits, (half == 0 ? low : high) + 64 * i + 8 * group, 8);
          bits = transpose_bits(bits);
          for (std::size_t b = 0; b < 8; ++b) words[b] |= (bits >> (8 * b) & 0xFFu) << (8 * group);
        }
        for (std::size_t b = 0; b < 8; ++b) word[static_cast<std::size_t>(8 * half) + b][i] = words[b];
      }
    }
  }
  /// Fills `low` and `high` from `word`.
  void by_splat(std::size_t count) {
    for (std::size_t i = 0; i < (count + 63) / 64; ++i) {
      for (int half = 0; half < 2; ++half) {
        for (std::size_t group = 0; group < 8; ++group) {
          std::uint64_t bits = 0;
          for (std::size_t b = 0; b < 8; ++b)
            bits |= (word[static_cast<std::size_t>(8 * half) + b][i] >> (8 * group) & 0xFFu) << (8 * b);
          bits = transpose_bits(bits);
          std::memcpy((half == 0 ? low : high) + 64 * i + 8 * group, &bits, 8);
        }
      }
    }
  }
};

/// The splats of one block in order, as indices into the chunk, padded to whole steps with `chunk_splats` (a splat of
/// opacity 0). With mask registers, sixteen bits become their indices by one compressing store, and there is no branch
/// to mispredict.
struct BlockList {
  alignas(64) std::uint32_t index[chunk_splats + 16];
  std::size_t size = 0;

  COMPMARK_INLINE BlockList(const std::uint64_t (&words)[chunk_words], std::size_t count) {
    if constexpr (uses_mask_register<float, 16>) {
      using P = Pack<float, 16>;
      using Integers = typename LaneStorage<std::int32_t, 16>::type;
      Integers ramp = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
      for (std::size_t i = 0; i < count; ++i) {
        for (int part = 0; part < 64; part += 16, ramp += 16) {
          const auto mask = Mask<float, 16>::from_bits(static_cast<unsigned>(words[i] >> part & 0xFFFFu));
          // The integers travel as the bits of floats; nothing computes with them.
          P::from_native((typename P::Native)ramp).compress_store(reinterpret_cast<float*>(index + size), mask);
          size += static_cast<std::size_t>(count_bits(mask));
        }
      }
    } else {
      for (std::size_t i = 0; i < count; ++i) {
        for (std::uint64_t bits = words[i]; bits != 0; bits &= bits - 1) {
          index[size++] = static_cast<std::uint32_t>(64 * i + static_cast<std::size_t>(std::countr_zero(bits)));
        }
      }
    }
    for (std::size_t i = size; i < size + step_splats; ++i) index[i] = static_cast<std::uint32_t>(chunk_splats);
  }

 private:
  static COMPMARK_INLINE int count_bits(Mask<float, 16> mask) { return compmark::count(mask); }
};

/// Number of chunks of a list.
[[nodiscard]] constexpr std::size_t list_chunks(std::size_t length) {
  return (length + chunk_splats - 1) / chunk_splats;
}

}  // namespace compmark::detail
