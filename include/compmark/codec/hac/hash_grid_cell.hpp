// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A position's cell in a level of the hash grid, in any scalar: the plain form of the rule in hash_grid_layout.hpp,
// which the sixteen lanes of hash_grid_lanes.hpp are proven against.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compmark/codec/hac/hash_grid_layout.hpp"
#include "compmark/math/pack.hpp"

namespace compmark::detail {

/// Where a position lies in a level: two neighbours an axis and their weights.
template <class T, int dimensions>
struct GridCell {
  bool inside = true;
  std::uint32_t neighbour[3][2] = {};
  T weight[3][2] = {};

  COMPMARK_INLINE GridCell(const HashGridLevel& level, const T* unit) {
    for (int d = 0; d < dimensions; ++d) {
      const T t = unit[level.axis[static_cast<std::size_t>(d)]];
      inside = inside && t >= T(0) && t <= T(1);
    }
    if (!inside) return;
    const int last = level.resolution - 2;
    for (int d = 0; d < dimensions; ++d) {
      const T t = unit[level.axis[static_cast<std::size_t>(d)]];
      const T p = fma(Pack<T, 1>(t), Pack<T, 1>(static_cast<T>(last)), Pack<T, 1>(T(0.5))).lane(0);
      const int below = static_cast<int>(p);  // p >= 0
      const T fraction = p - static_cast<T>(below);
      neighbour[d][0] = static_cast<std::uint32_t>(level.clamped(below));
      neighbour[d][1] = static_cast<std::uint32_t>(level.clamped(below + 1));
      weight[d][0] = 1 - fraction;
      weight[d][1] = fraction;
    }
  }
  /// f(entry, weight) of the 4 or 8 corners.
  template <bool dense, class F>
  COMPMARK_INLINE void corners(const HashGridLevel& level, const F& f) const {
    const auto r = static_cast<std::uint32_t>(level.resolution);
    const std::uint32_t step1 = dense ? r : HashGridLevel::prime1, step2 = dense ? r * r : HashGridLevel::prime2;
    const auto entry = [&](std::uint32_t i0, std::uint32_t rest) {
      return level.first + (dense ? i0 + rest : (i0 ^ rest) & level.hash_mask);
    };
    for (int c2 = 0; c2 < (dimensions == 3 ? 2 : 1); ++c2) {
      const std::uint32_t h2 = dimensions == 3 ? neighbour[2][c2] * step2 : 0u;
      for (int c1 = 0; c1 < 2; ++c1) {
        const std::uint32_t h1 = neighbour[1][c1] * step1, rest = dense ? h1 + h2 : h1 ^ h2;
        const T w = dimensions == 3 ? weight[1][c1] * weight[2][c2] : weight[1][c1];
        f(entry(neighbour[0][0], rest), weight[0][0] * w);
        f(entry(neighbour[0][1], rest), weight[0][1] * w);
      }
    }
  }
};

}  // namespace compmark::detail
