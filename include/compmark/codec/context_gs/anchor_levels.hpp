// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The three levels of anchors of ContextGS (Wang et al., NeurIPS 2024, section 3.2; docs/spec/compression.md, 2.1): a
// coarse anchor predicts the anchors of its cell, so that an anchor's best context is another anchor. Everything here
// is whole numbers, and training and coding share it (docs/spec/compression.md, 5.8: the published split hangs on a
// division by a float). With v the voxel of an anchor, v = round(position / voxel size):
//
//   cell(v, kappa) = floor(v / kappa), an axis at a time, from voxel 0; kappa fine < coarse, both whole
//   head of a set of anchors = the first along the Morton curve (x in the lowest bit, signed coordinates in their
//     order), then in row order
//   every fine cell has a head; among heads, every coarse cell has one
//   level 2: head of a coarse cell; no parent
//   level 1: another head; parent: the head of its coarse cell, of level 2
//   level 0: the others; parent: the head of the fine cell, of level 1 or 2
//
// Masked anchors do not exist: with or without them in the list, the others get the same levels and parents. The
// published code codes level 1 with the parents of other rows (docs/spec/compression.md, 5.9); here a parent is the
// parent. Anchors of levels 2, 1, 0 may be coded in this order, each level in any order. Cost: sort() three sorts, when
// voxels or cells change; assign() two walks, when an anchor dies or revives.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/math/morton.hpp"

namespace compmark {

/// Edges of cells in voxels.
struct AnchorCells {
  std::int32_t fine = 1, coarse = 1;
  friend bool operator==(const AnchorCells&, const AnchorCells&) = default;
};

/// floor(v / kappa), kappa > 0.
[[nodiscard]] constexpr std::int32_t cell_coordinate(std::int32_t v, std::int32_t kappa) {
  return v / kappa - (v % kappa < 0 ? 1 : 0);
}

class AnchorLevels {
 public:
  static constexpr std::size_t levels = 3;
  static constexpr std::uint8_t masked = 3;                 ///< in place of a level
  static constexpr std::uint32_t none = 0xFFFFFFFFu;        ///< in place of a parent
  static constexpr std::size_t most_anchors = 0x80000000u;  ///< less than these

  /// Orders the anchors by their cells; assign() follows.
  void sort(std::span<const Voxel> voxels, AnchorCells cells) {
    COMPMARK_ASSERT(voxels.size() < most_anchors && cells.fine > 0 && cells.coarse > 0, "AnchorLevels: too many");
    const std::size_t n = voxels.size();
    curve_.resize(n);
    for (std::size_t i = 0; i < n; ++i) curve_[i] = static_cast<std::uint32_t>(i);
    std::sort(curve_.begin(), curve_.end(), [&](std::uint32_t a, std::uint32_t b) {
      return voxels[a] == voxels[b] ? a < b : morton_less(voxels[a], voxels[b]);
    });
    by_cell(voxels, cells.fine, fine_);
    by_cell(voxels, cells.coarse, coarse_);
  }

  /// Levels and parents of the sorted anchors; unmasked[i] == 0 is a masked one, an empty list says that all unmasked.
  void assign(std::span<const std::uint8_t> unmasked = {}) {
    const std::size_t n = fine_.size();
    COMPMARK_ASSERT(unmasked.empty() || unmasked.size() == n, "AnchorLevels: mask flags of other anchors");
    level_.resize(n, masked);
    parent_.resize(n, none);
    counts_ = {};
    std::uint32_t head = none;
    for (const std::uint32_t place : fine_) {
      const std::uint32_t row = place & ~first_of_cell;
      if ((place & first_of_cell) != 0) head = none;
      if (!unmasked.empty() && unmasked[row] == 0) continue;
      level_[row] = head == none ? 1 : 0;
      parent_[row] = head;
      if (head == none) head = row;
    }
    for (const std::uint32_t place : coarse_) {
      const std::uint32_t row = place & ~first_of_cell;
      if ((place & first_of_cell) != 0) head = none;
      if (level_[row] == masked) continue;
      if (level_[row] == 1) {
        if (head == none) level_[row] = 2;
        parent_[row] = head;
        if (head == none) head = row;
      }
      ++counts_[level_[row]];
    }
  }

  [[nodiscard]] std::span<const std::uint8_t> level() const { return level_.span(); }
  /// Rows.
  [[nodiscard]] std::span<const std::uint32_t> parent() const { return parent_.span(); }
  /// Anchors of levels 0, 1, 2.
  [[nodiscard]] const std::array<std::size_t, levels>& counts() const { return counts_; }

 private:
  __extension__ using Wide = unsigned __int128;
  static constexpr std::uint32_t first_of_cell = 0x80000000u;

  /// Rows by cell, then along the curve.
  void by_cell(std::span<const Voxel> voxels, std::int32_t kappa, Buffer<std::uint32_t>& order) {
    const std::size_t n = voxels.size();
    keys_.resize(n);
    for (std::size_t rank = 0; rank < n; ++rank) {
      Wide key = 0;
      for (const std::int32_t v : voxels[curve_[rank]]) {
        key = key << 32 | (static_cast<std::uint32_t>(cell_coordinate(v, kappa)) ^ 0x80000000u);
      }
      keys_[rank] = key << 32 | static_cast<std::uint32_t>(rank);
    }
    std::sort(keys_.begin(), keys_.end());
    order.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      const bool first = i == 0 || keys_[i] >> 32 != keys_[i - 1] >> 32;
      order[i] = curve_[static_cast<std::uint32_t>(keys_[i])] | (first ? first_of_cell : 0u);
    }
  }

  Buffer<std::uint32_t> curve_, fine_, coarse_, parent_;
  Buffer<std::uint8_t> level_;
  Buffer<Wide> keys_;
  std::array<std::size_t, levels> counts_{};
};

}  // namespace compmark
