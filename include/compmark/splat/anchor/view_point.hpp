// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The camera centre as two scalars a coordinate, so that (position - high) - low keeps its digits far from the origin
// (docs/spec/numerics.md, PR7): the first difference is exact or as exact as the result, the second adds what rounding
// the centre to float would have lost.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace compmark::detail {

/// center = high + low, three coordinates each; an anchor nearer than min_distance has no direction
/// (docs/spec/numerics.md, PR9). The high part is the double with its last 29 bits cleared. The obvious
/// static_cast<double>(static_cast<float>(c)) is not used: g++ 12 drops the rounding when it vectorises such casts of
/// neighbouring elements (-O2, any instruction set), and the low part becomes zero.
template <class T>
struct ViewPoint {
  T high[3];
  T low[3];
  T min_distance;

  ViewPoint(const std::array<double, 3>& center, double least_distance) : min_distance(static_cast<T>(least_distance)) {
    for (std::size_t i = 0; i < 3; ++i) {
      double leading = center[i];
      if constexpr (std::is_same_v<T, float>) {
        leading = std::bit_cast<double>(std::bit_cast<std::uint64_t>(center[i]) & ~((std::uint64_t{1} << 29) - 1));
      }
      high[i] = static_cast<T>(leading);
      low[i] = static_cast<T>(center[i] - leading);
    }
  }
  ViewPoint() : ViewPoint({0, 0, 0}, 0) {}
};

}  // namespace compmark::detail
