// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Moves the anchors of a finished model onto the grid of its cells, which is how codecs store them. Those of recipes
// without a contracted space lie on it. Those of a far field do not (splat/anchor/contracted_space.hpp), and those of a
// model that was edited need not. Their Gaussians stay where they are: offsets make up for the way that an anchor goes,
// and what an anchor looks like from a camera changes by the angle of that way alone. A large anchor goes to a coarser
// grid of 2^k cells, a quarter of its base scale at most: low digits that are zero cost a file little
// (codec/container/geometry.hpp).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/table.hpp"
#include "compmark/splat/training/model.hpp"

namespace compmark {

namespace detail {

/// The cell of a coordinate, as a double, and whether the coordinate is the cell's place: a float holds a place to
/// 2^-24 of itself. NaN lies nowhere.
struct AnchorCell {
  double cell = 0;
  bool in_range = false, on_grid = false;
};
[[nodiscard]] inline AnchorCell anchor_cell(double place, double voxel_size) {
  AnchorCell found;
  found.cell = std::round(place / voxel_size);
  found.in_range = std::abs(found.cell) < 0x1p31;
  found.on_grid =
      found.in_range && std::abs(place - found.cell * voxel_size) <= 1e-3 * voxel_size + 0x1p-22 * std::abs(place);
  return found;
}

}  // namespace detail

/// What move_onto_grid did.
struct GridMoves {
  std::size_t anchors = 0;  ///< that were moved
  double farthest = 0;      ///< the longest way along an axis, world units
};

/// Moves each anchor of `model` that does not lie on the grid of model.voxel_size to the nearest place on it, or on the
/// grid of 2^k cells; the others, and every number of theirs, stay to the bit. Positions of Gaussians stay to the
/// rounding of their numbers. Error: a place too far out for cells of that size (2^31), or not a number; the model is
/// not changed then. Cost: linear.
template <Recipe R>
[[nodiscard]] Result<GridMoves> move_onto_grid(Model<R>& model) {
  using Scalar = typename R::Scalar;
  const AnchorColumns<Scalar> columns = anchor_values(model.arena, model.anchors);
  const double size = model.voxel_size;
  for (std::size_t i = 0; i < model.anchor_count(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (detail::anchor_cell(static_cast<double>(columns.position(i, axis)), size).in_range) continue;
      return Error{ErrorKind::invalid,
                   {},
                   "anchor.position[" + std::to_string(i) + "]",
                   "lies too far out for cells of " + std::to_string(size) + ", or is not a number",
                   "train with larger cells (--voxel-size), or leave such points out of the data"};
    }
  }
  GridMoves moves;
  for (std::size_t i = 0; i < model.anchor_count(); ++i) {
    bool all_on_grid = true;
    double least_scale = std::numeric_limits<double>::infinity();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      all_on_grid = all_on_grid && detail::anchor_cell(static_cast<double>(columns.position(i, axis)), size).on_grid;
      least_scale = std::min(least_scale, std::exp(static_cast<double>(columns.scaling(i, axis))));
    }
    if (all_on_grid) continue;
    ++moves.anchors;
    double spacing = size;
    for (int k = 0; k < 30 && 2 * spacing <= least_scale / 4; ++k) spacing *= 2;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double from = static_cast<double>(columns.position(i, axis));
      columns.position(i, axis) = static_cast<Scalar>(std::round(from / spacing) * spacing);
      const double way = from - static_cast<double>(columns.position(i, axis));
      moves.farthest = std::max(moves.farthest, std::abs(way));
      // Offsets are in units of the base scale; one that is smaller than the way would need a huge one.
      const double scale = std::exp(static_cast<double>(columns.scaling(i, axis)));
      if (std::abs(way) > scale) columns.scaling(i, axis) = static_cast<Scalar>(std::log(std::abs(way)));
      const double used = std::exp(static_cast<double>(columns.scaling(i, axis)));
      for (std::size_t at = axis; at < columns.offset.columns; at += 3)
        columns.offset(i, at) = static_cast<Scalar>((static_cast<double>(columns.offset(i, at)) * scale + way) / used);
    }
  }
  return moves;
}

}  // namespace compmark
