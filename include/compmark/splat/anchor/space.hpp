// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept Space: in which coordinates the cells are cubes that anchors are put into. EuclideanSpace, the absent type,
// is the world itself; ContractedSpace (splat/anchor/contracted_space.hpp) lets cells grow with the distance from the
// cameras.
//
//   expression                       meaning
//   s.cell_of(position, size, cell)  the cell of a point; false if it has none (not finite, or 2^31 cells away)
//   s.center(cell, size)             the centre of a cell in the world
//   s.in_range(cell, size)           the centre lies in the cell: new anchors are put into such cells alone
//   s.stretch(position)              world length of a short unit of cell length there, across the line of sight from
//                                    the cameras
//
// Laws: S1 cell_of(center(c)) = c where in_range(c); S2 stretch is 1 and cells are those of EuclideanSpace wherever
// nothing is stretched, to the bit. Cost of EuclideanSpace: none.
#pragma once

#include <array>
#include <concepts>

#include "compmark/core/absent.hpp"
#include "compmark/splat/anchor/cells.hpp"

namespace compmark {

template <class S>
concept Space = requires(const S& space, const double* position, double size, Cell& cell) {
  { space.cell_of(position, size, cell) } -> std::same_as<bool>;
  { space.center(cell, size) } -> std::same_as<std::array<double, 3>>;
  { space.in_range(cell, size) } -> std::same_as<bool>;
  { space.stretch(position) } -> std::same_as<double>;
};

/// Cells are cubes of the world.
struct EuclideanSpace : Absent<EuclideanSpace> {
  template <class T>
  [[nodiscard]] static bool cell_of(const T* position, double size, Cell& cell) {
    return compmark::cell_of(position, size, cell);
  }
  [[nodiscard]] static std::array<double, 3> center(const Cell& cell, double size) {
    return {cell.x * size, cell.y * size, cell.z * size};
  }
  [[nodiscard]] static constexpr bool in_range(const Cell& /*cell*/, double /*size*/) { return true; }
  template <class T>
  [[nodiscard]] static constexpr double stretch(const T* /*position*/) {
    return 1;
  }
};
static_assert(Space<EuclideanSpace>);

}  // namespace compmark
