// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Cells of a cubic grid, and a set of them. A cell is three 32-bit integers, compared in full: packed 64-bit keys of 21
// bits an axis merge far points of real scenes (docs/spec/numerics.md, AN3). Finding one costs a hash and about one
// probe.
#pragma once

#include <bit>
#include <cmath>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/random.hpp"

namespace compmark {

struct Cell {
  std::int32_t x = 0, y = 0, z = 0;
  friend constexpr auto operator<=>(const Cell&, const Cell&) = default;
};

/// The cell of a point: each coordinate divided by the cell size, rounded to nearest, ties to even
/// (docs/spec/numerics.md, AN1). False if a coordinate is not finite or 2^31 cells away. In double, whatever T, so that
/// a quotient above 2^24 still names one cell.
template <class T>
[[nodiscard]] bool cell_of(const T* position, double size, Cell& cell) {
  double rounded[3];
  for (int axis = 0; axis < 3; ++axis) {
    rounded[axis] = std::nearbyint(static_cast<double>(position[axis]) / size);
    if (!(std::abs(rounded[axis]) < 0x1p31)) return false;
  }
  cell = {static_cast<std::int32_t>(rounded[0]), static_cast<std::int32_t>(rounded[1]),
          static_cast<std::int32_t>(rounded[2])};
  return true;
}

/// A set of cells, numbered in the order of their first insertion. Linear probing, at most half full.
class CellSet {
 public:
  static constexpr std::uint32_t none = ~std::uint32_t{0};

  /// Empties the set and makes room for `count` cells.
  void reset(std::size_t count) {
    cells_.clear();
    cells_.reserve(count);
    table_.assign(std::bit_ceil(2 * count + 2), none);
  }
  /// Number of the cell, new or not. At most `count` different cells after reset(count).
  std::uint32_t insert(const Cell& cell) {
    const std::size_t at = place(cell);
    if (table_[at] == none) {
      table_[at] = static_cast<std::uint32_t>(cells_.size());
      cells_.push_back(cell);
    }
    return table_[at];
  }
  /// Number of the cell, or `none`.
  [[nodiscard]] std::uint32_t find(const Cell& cell) const { return table_.empty() ? none : table_[place(cell)]; }

  [[nodiscard]] std::span<const Cell> cells() const { return cells_; }
  [[nodiscard]] std::size_t size() const { return cells_.size(); }

 private:
  [[nodiscard]] std::size_t place(const Cell& cell) const {
    const auto wide = [](std::int32_t value) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(value)); };
    const std::size_t mask = table_.size() - 1;
    std::size_t at = mix_bits(mix_bits(wide(cell.x) | wide(cell.y) << 32) ^ wide(cell.z)) & mask;
    while (table_[at] != none && cells_[table_[at]] != cell) at = (at + 1) & mask;
    return at;
  }
  std::vector<std::uint32_t> table_;
  std::vector<Cell> cells_;
};

}  // namespace compmark
