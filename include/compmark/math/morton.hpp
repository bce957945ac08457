// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Voxels, the integers an anchor's position is made of (position = voxel_size * v), and two orders along the Morton
// curve, x in the lowest bit, full 32 bits an axis: morton_less by signed coordinates (cells and levels of anchors),
// which no other anchor changes, and morton_order by the distance from an origin, anchors of one voxel in the order
// they came (what a file holds). Cost: one sort.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace compmark {

using Voxel = std::array<std::int32_t, 3>;

/// World position of one coordinate: one double product, one rounding.
[[nodiscard]] inline float voxel_position(std::int32_t coordinate, double voxel_size) {
  return static_cast<float>(static_cast<double>(coordinate) * voxel_size);
}

namespace detail {

/// Two zeros before each of the low 21 bits.
[[nodiscard]] constexpr std::uint64_t spread_bits(std::uint64_t x) {
  x &= 0x1FFFFFu;
  x = (x | x << 32) & 0x1F00000000FFFFull;
  x = (x | x << 16) & 0x1F0000FF0000FFull;
  x = (x | x << 8) & 0x100F00F00F00F00Full;
  x = (x | x << 4) & 0x10C30C30C30C30C3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

}  // namespace detail

/// Morton code of three 32-bit numbers, x in the lowest bit: 33 bits in `high`, 63 in `low`.
struct MortonCode {
  std::uint64_t high = 0, low = 0;

  friend constexpr bool operator==(const MortonCode&, const MortonCode&) = default;
  friend constexpr bool operator<(const MortonCode& a, const MortonCode& b) {
    return a.high != b.high ? a.high < b.high : a.low < b.low;
  }
};

[[nodiscard]] constexpr MortonCode morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  using detail::spread_bits;
  return {spread_bits(x >> 21) | spread_bits(y >> 21) << 1 | spread_bits(z >> 21) << 2,
          spread_bits(x) | spread_bits(y) << 1 | spread_bits(z) << 2};
}

/// Whether a comes before b along the Morton curve of signed coordinates: the axis with the highest differing bit
/// decides, of several the later one.
[[nodiscard]] constexpr bool morton_less(const Voxel& a, const Voxel& b) {
  std::size_t axis = 2;
  std::uint32_t most = 0;
  for (std::size_t i = 3; i-- > 0;) {
    const std::uint32_t difference = static_cast<std::uint32_t>(a[i]) ^ static_cast<std::uint32_t>(b[i]);
    if (most < difference && most < (most ^ difference)) {
      axis = i;
      most = difference;
    }
  }
  return a[axis] < b[axis];
}

/// Where the numbers of a set of voxels begin, and how many bits an axis they take from there.
struct VoxelRange {
  Voxel
      /// minimum, rounded down to a multiple of 64, so that the voxels of coarse anchors keep their trailing zeros
      origin{};
  int bits = 0;  ///< 0 … 32

  [[nodiscard]] std::uint32_t relative(const Voxel& voxel, std::size_t axis) const {
    return static_cast<std::uint32_t>(voxel[axis]) - static_cast<std::uint32_t>(origin[axis]);
  }
  [[nodiscard]] MortonCode code(const Voxel& voxel) const {
    return morton_code(relative(voxel, 0), relative(voxel, 1), relative(voxel, 2));
  }
};

[[nodiscard]] inline VoxelRange voxel_range(std::span<const Voxel> voxels) {
  VoxelRange range;
  if (voxels.empty()) return range;
  Voxel least = voxels[0], greatest = voxels[0];
  for (const Voxel& voxel : voxels) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      least[axis] = std::min(least[axis], voxel[axis]);
      greatest[axis] = std::max(greatest[axis], voxel[axis]);
    }
  }
  std::uint32_t span = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    range.origin[axis] = least[axis] & ~std::int32_t{63};
    span |= range.relative(greatest, axis);
  }
  range.bits = static_cast<int>(std::bit_width(span));
  return range;
}

/// The order of coding: order[i] is the row of the i-th anchor.
[[nodiscard]] inline std::vector<std::uint32_t> morton_order(std::span<const Voxel> voxels, const VoxelRange& range) {
  std::vector<MortonCode> codes(voxels.size());
  for (std::size_t i = 0; i < voxels.size(); ++i) codes[i] = range.code(voxels[i]);
  std::vector<std::uint32_t> order(voxels.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return codes[a] == codes[b] ? a < b : codes[a] < codes[b]; });
  return order;
}

}  // namespace compmark
