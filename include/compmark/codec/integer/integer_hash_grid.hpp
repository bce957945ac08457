// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The mixed hash grid in whole numbers (docs/spec/compression.md, 3.2, points 1 and 2): voxel to box coordinate by one
// 64-bit product (32-bit scale and 64-bit offset an axis stand in the file), to a level's coordinate by another,
// fractions of 8 bits, +-1 at the vertices, activations of +-4096 with one rounding. Same entries, neighbours and
// clamping as the float grid of training (hash_grid_layout.hpp); it differs by the rounding of the fraction, at most
// 2^-9 of a cell an axis. A voxel outside the box on an axis that a grid uses gets zeros from it, as in training. Cost:
// 0.2-0.3 us an anchor.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/hac/hash_grid_layout.hpp"
#include "compmark/codec/integer/integer_dot.hpp"

namespace compmark {

/// From a voxel to the place in the context's box: t = (scale v + offset) 2^-fraction, of which [0, 1] is used.
struct VoxelBox {
  std::array<std::int32_t, 3> scale{1 << 30, 1 << 30, 1 << 30};
  std::array<std::int32_t, 3> fraction{33, 33, 33};
  std::array<std::int64_t, 3> offset{};

  static constexpr std::uint64_t outside = ~std::uint64_t{0};

  /// t with 32 fraction bits, 0 … 2^32, or `outside`.
  [[nodiscard]] std::uint64_t place(std::int32_t coordinate, std::size_t axis) const {
    const std::int64_t t = (std::int64_t{scale[axis]} * coordinate + offset[axis]) >> (fraction[axis] - 32);
    return t < 0 || t > std::int64_t{1} << 32 ? outside : static_cast<std::uint64_t>(t);
  }
  /// True if no coordinate of 32 bits overflows; checked before the numbers of a file are used.
  [[nodiscard]] bool valid() const {
    constexpr std::int64_t limit = std::int64_t{1} << 61;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (scale[axis] <= 0 || scale[axis] > 1 << 30 || fraction[axis] < 32 || fraction[axis] > 62) return false;
      if (offset[axis] < -limit || offset[axis] > limit) return false;
    }
    return true;
  }
  friend bool operator==(const VoxelBox&, const VoxelBox&) = default;
};

/// The same map for a box in world units; an axis without extent counts as 1 wide (as in training), none as less than 4
/// voxels. An invalid result (see valid()) means a box of no use: not finite, inverted, or 2^31 voxels away.
[[nodiscard]] inline VoxelBox make_voxel_box(std::span<const float, 6> minimum_maximum, double voxel_size) {
  VoxelBox box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low = minimum_maximum[axis] / voxel_size, extent = minimum_maximum[3 + axis] / voxel_size - low;
    const double width = std::max(extent > 0 ? extent : 1 / voxel_size, 4.0);
    if (!(std::abs(low) < 0x1p31) || !(extent >= 0) || !(width < 0x1p31)) {
      box.scale[axis] = 0;
      continue;
    }
    int exponent = 0;
    (void)std::frexp(width, &exponent);  // width in [2^(exponent - 1), 2^exponent)
    box.fraction[axis] = 29 + exponent;
    box.scale[axis] = static_cast<std::int32_t>(std::lround(std::ldexp(1 / width, box.fraction[axis])));
    box.offset[axis] = std::llround(std::ldexp(-low / width, box.fraction[axis]));
  }
  return box;
}

class IntegerHashGrid {
 public:
  static constexpr int activation_bits = 12;  ///< +-1 is +-2^12
  static constexpr int fraction_bits = 8;     ///< of a place within a cell

  IntegerHashGrid() = default;
  /// `shape` must be valid().
  IntegerHashGrid(const HashGridShape& shape, const VoxelBox& box) : box_(box), shape_(shape) {
    for (int i = 0; i < shape.levels(); ++i) levels_.push_back(shape.level(i));
    entries_.assign(shape.entries(), 0);
  }

  [[nodiscard]] const HashGridShape& shape() const { return shape_; }
  [[nodiscard]] const VoxelBox& box() const { return box_; }
  [[nodiscard]] std::span<const HashGridLevel> levels() const { return levels_; }
  /// Bit f of entry e: feature f is +1, else -1.
  [[nodiscard]] std::span<std::uint8_t> entries() { return entries_; }
  [[nodiscard]] std::span<const std::uint8_t> entries() const { return entries_; }

  /// Features of up to `integer_panel` voxels as the network's first layer reads them, [channel / 2][lane][2].
  void evaluate(std::span<const std::array<std::int32_t, 3>> voxels, std::int16_t* out) const {
    std::uint64_t place[3][integer_panel];
    places(voxels, place);
    for (std::size_t level = 0; level < levels_.size(); ++level) {
      const HashGridLevel& l = levels_[level];
      const int shift = fraction_bits * l.dimensions - activation_bits;
      for (std::size_t lane = 0; lane < integer_panel; ++lane) {
        std::int32_t sum[4]{};
        vertices(l, place, lane, [&](std::uint32_t entry, std::int32_t weight) {
          const auto& sign = signs[entries_[entry] & 15u];
          for (std::size_t f = 0; f < 4; ++f) sum[f] += weight * sign[f];
        });
        for (std::size_t f = 0; f < 4; ++f) {
          const std::int32_t value = (sum[f] + (1 << (shift - 1))) >> shift;
          out[((2 * level + f / 2) * integer_panel + lane) * 2 + f % 2] = static_cast<std::int16_t>(value);
        }
      }
    }
  }

  /// Sets the bytes of all entries of one level that these voxels read; `seen` has entries().size() of them, levels are
  /// disjoint.
  void mark_seen(std::size_t level, std::span<const std::array<std::int32_t, 3>> voxels,
                 std::span<std::uint8_t> seen) const {
    for (std::size_t first = 0; first < voxels.size(); first += integer_panel) {
      const auto panel = voxels.subspan(first, std::min<std::size_t>(integer_panel, voxels.size() - first));
      std::uint64_t place[3][integer_panel];
      places(panel, place);
      for (std::size_t lane = 0; lane < panel.size(); ++lane) {
        vertices(levels_[level], place, lane, [&](std::uint32_t entry, std::int32_t) { seen[entry] = 1; });
      }
    }
  }

 private:
  static constexpr auto signs = [] {
    std::array<std::array<std::int32_t, 4>, 16> table{};
    for (std::size_t nibble = 0; nibble < 16; ++nibble) {
      for (std::size_t f = 0; f < 4; ++f) table[nibble][f] = (nibble >> f & 1u) != 0 ? 1 : -1;
    }
    return table;
  }();

  /// Lanes behind the last voxel repeat it.
  void places(std::span<const std::array<std::int32_t, 3>> voxels, std::uint64_t (*place)[integer_panel]) const {
    for (std::size_t lane = 0; lane < integer_panel; ++lane) {
      const auto& voxel = voxels[std::min(lane, voxels.size() - 1)];
      for (std::size_t axis = 0; axis < 3; ++axis) place[axis][lane] = box_.place(voxel[axis], axis);
    }
  }
  /// visit(entry, weight) for the 4 or 8 vertices around a place, in a fixed order; weights sum to 2^(8 dimensions).
  template <class Visit>
  static void vertices(const HashGridLevel& l, const std::uint64_t (*place)[integer_panel], std::size_t lane,
                       const Visit& visit) {
    std::uint32_t index[3][2]{};
    std::int32_t weight[3][2]{};
    for (std::size_t d = 0; d < static_cast<std::size_t>(l.dimensions); ++d) {
      if (place[static_cast<std::size_t>(l.axis[d])][lane] == VoxelBox::outside) return;
    }
    for (std::size_t d = 0; d < static_cast<std::size_t>(l.dimensions); ++d) {
      // p = t (R - 2) + 1/2 with 8 fraction bits
      const std::uint64_t t = place[static_cast<std::size_t>(l.axis[d])][lane];
      const auto p = static_cast<std::int32_t>(
          (t * static_cast<std::uint64_t>(l.resolution - 2) + (std::uint64_t{1} << 31) + (std::uint64_t{1} << 23)) >>
          24);
      const int cell = p >> fraction_bits;
      weight[d][1] = p & 255;
      weight[d][0] = 256 - weight[d][1];
      index[d][0] = static_cast<std::uint32_t>(l.clamped(cell));
      index[d][1] = static_cast<std::uint32_t>(l.clamped(cell + 1));
    }
    if (l.dimensions == 2) {
      for (std::size_t v = 0; v < 4; ++v) {
        visit(l.entry(index[0][v & 1], index[1][v >> 1]), weight[0][v & 1] * weight[1][v >> 1]);
      }
    } else {
      for (std::size_t v = 0; v < 8; ++v) {
        visit(l.entry(index[0][v & 1], index[1][v >> 1 & 1], index[2][v >> 2]),
              weight[0][v & 1] * weight[1][v >> 1 & 1] * weight[2][v >> 2]);
      }
    }
  }

  VoxelBox box_;
  HashGridShape shape_;
  std::vector<HashGridLevel> levels_;
  std::vector<std::uint8_t> entries_;
};

}  // namespace compmark
