// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The cells of 16 positions at once, for builds with gather instructions: neighbours, table rows and weights of a
// level's corners in lanes (hash_grid_cell.hpp has the scalar form; both add the same terms in the same order). A
// corner's four signs are half a byte: the word around it is gathered and shifted, and a sign is one exclusive or with
// the weight. Cost: 20 cycles a corner of 16 positions, a third of the scalar form.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "compmark/codec/hac/hash_grid_layout.hpp"
#include "compmark/math/pack.hpp"

namespace compmark::detail {

template <class T>
inline constexpr bool has_grid_lanes = std::is_same_v<T, float>&& native_width<T> == 16;

/// Sixteen positions [16, 3] by axis.
COMPMARK_INLINE void by_axis(const float* unit, float* soa) {
  for (int i = 0; i < 16; ++i) {
    for (int axis = 0; axis < 3; ++axis) soa[axis * 16 + i] = unit[3 * i + axis];
  }
}

/// What the backward pass needs of them, in memory, to be read corner by corner.
template <int corners>
struct GridBlock {
  alignas(64) std::uint32_t entry[corners][16];
  alignas(64) float weight[corners][16];
  unsigned inside;  ///< bit i: position i is
};

/// Positions by axis: unit[axis * stride + lane], 16 lanes from there. Lanes outside the box have inside false and sit
/// at the origin.
template <int dimensions, bool dense>
struct GridLanes {
  static constexpr int W = 16;
  using P = Pack<float, W>;
  using U = typename LaneStorage<std::uint32_t, W>::type;
  using I = typename LaneStorage<std::int32_t, W>::type;
  static constexpr int corners = 1 << dimensions;

  Mask<float, W> inside;
  alignas(64) std::uint32_t entry[corners][W];
  P weight[corners];

  COMPMARK_INLINE GridLanes(const HashGridLevel& level, const float* unit, std::size_t stride) {
    inside = Mask<float, W>::first(W);
    P t[3];
    for (int d = 0; d < dimensions; ++d) {
      t[d] = P::load(unit + static_cast<std::size_t>(level.axis[static_cast<std::size_t>(d)]) * stride);
      inside = inside & (t[d] >= P(0.0f)) & (t[d] <= P(1.0f));
    }
    const int last = level.resolution - 2;
    U neighbour[3][2];
    P share[3][2];
    for (int d = 0; d < dimensions; ++d) {
      const P p = fma(keep(inside, t[d]), P(static_cast<float>(last)), P(0.5f));
      const I below = __builtin_convertvector(p.native, I);  // p >= 0
      const P fraction = p - P::from_native(__builtin_convertvector(below, typename P::Native));
      neighbour[d][0] = (U)(below - (below < 1));             // a mask is -1 where true: 0 becomes 1
      neighbour[d][1] = (U)(below + 1 + (below + 1 > last));  // … and last + 1 becomes last
      share[d][0] = P(1.0f) - fraction;
      share[d][1] = fraction;
    }
    const auto r = static_cast<std::uint32_t>(level.resolution);
    const std::uint32_t step1 = dense ? r : HashGridLevel::prime1, step2 = dense ? r * r : HashGridLevel::prime2;
    for (int c = 0; c < corners / 2; ++c) {
      const int c1 = c & 1, c2 = c >> 1;
      U rest = neighbour[1][c1] * step1;
      P w = share[1][c1];
      if constexpr (dimensions == 3) {
        const U high = neighbour[2][c2] * step2;
        rest = dense ? rest + high : rest ^ high;
        w = w * share[2][c2];
      }
      for (int c0 = 0; c0 < 2; ++c0) {
        const U at = dense ? neighbour[0][c0] + rest : (neighbour[0][c0] ^ rest) & level.hash_mask;
        const U row = at + level.first;
        __builtin_memcpy(entry[2 * c + c0], &row, sizeof(row));
        weight[2 * c + c0] = share[0][c0] * w;
      }
    }
  }

  void store(GridBlock<corners>& block) const {
    for (int c = 0; c < corners; ++c) weight[c].store(block.weight[c]);
    __builtin_memcpy(block.entry, entry, sizeof(entry));
    block.inside = inside.bits();
  }
  /// sum[feature] over the corners; 0 outside. `signs` is aligned to words.
  COMPMARK_INLINE void interpolate(const std::uint8_t* signs, P (&sum)[4]) const {
    for (P& s : sum) s = P(0.0f);
    for (int c = 0; c < corners; ++c) {
      U row;
      __builtin_memcpy(&row, entry[c], sizeof(row));
      const U word = row >> 2;
      alignas(64) std::int32_t index[W];
      __builtin_memcpy(index, &word, sizeof(word));
      const U minus = ~((U)P::gather(reinterpret_cast<const float*>(signs), index).native >> ((row & 3u) << 3));
      for (int f = 0; f < 4; ++f) {
        const U sign = (minus << (31 - f)) & 0x80000000u;
        sum[f] = sum[f] + P::from_native((typename P::Native)((U)weight[c].native ^ sign));
      }
    }
    for (P& s : sum) s = keep(inside, s);
  }
  /// Feature-major to row-major: row i of four features begins at rows[at(i)].
  static COMPMARK_INLINE void transpose(const P (&sum)[4], float* rows) {
    const auto a = low_pairs(sum[0].native, sum[1].native), b = low_pairs(sum[2].native, sum[3].native);
    const auto c = high_pairs(sum[0].native, sum[1].native), d = high_pairs(sum[2].native, sum[3].native);
    P::from_native(low_halves(a, b)).store(rows);
    P::from_native(high_halves(a, b)).store(rows + 16);
    P::from_native(low_halves(c, d)).store(rows + 32);
    P::from_native(high_halves(c, d)).store(rows + 48);
  }
  static constexpr std::size_t at(std::size_t i) { return (i & 3) * 16 + (i >> 2) * 4; }

 private:
  using N = typename P::Native;
  static COMPMARK_INLINE N low_pairs(N x, N y) {
    return __builtin_shufflevector(x, y, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
  }
  static COMPMARK_INLINE N high_pairs(N x, N y) {
    return __builtin_shufflevector(x, y, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
  }
  static COMPMARK_INLINE N low_halves(N x, N y) {
    return __builtin_shufflevector(x, y, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29);
  }
  static COMPMARK_INLINE N high_halves(N x, N y) {
    return __builtin_shufflevector(x, y, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31);
  }
};

}  // namespace compmark::detail
