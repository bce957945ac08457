// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses cells that give levels of the wanted sizes (ContextGS; docs/spec/compression.md, 2.1): edges such that a
// fifth of the anchors are heads of fine cells, and a fifth of those of coarse ones, by bisection over whole edges with
// ratios as fractions. A file stores the edges: only the encoder chooses, no decoder repeats it. Cost: a sort of all
// anchors for each of some ten steps.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "compmark/codec/context_gs/anchor_levels.hpp"
#include "compmark/core/buffer.hpp"

namespace compmark {

struct AnchorCellSettings {
  std::uint64_t ratio = 20, tolerance = 1;  ///< heads of a hundred anchors
};

namespace detail {

/// Cells that are not empty.
[[nodiscard]] inline std::size_t occupied_cells(std::span<const Voxel> voxels, std::int32_t kappa,
                                                Buffer<Voxel>& scratch) {
  scratch.resize(voxels.size());
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) scratch[i][axis] = cell_coordinate(voxels[i][axis], kappa);
  }
  std::sort(scratch.begin(), scratch.end());
  return static_cast<std::size_t>(std::unique(scratch.begin(), scratch.end()) - scratch.begin());
}

/// The first edge between `least` and the extent of the anchors that bisection meets within the tolerance; where none
/// is, the largest that still leaves more heads than wanted.
[[nodiscard]] inline std::int32_t cell_edge(std::span<const Voxel> voxels, std::int32_t least,
                                            const AnchorCellSettings& settings, Buffer<Voxel>& scratch) {
  std::int64_t above = least;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax_element(voxels.begin(), voxels.end(),
                                                 [&](const Voxel& a, const Voxel& b) { return a[axis] < b[axis]; });
    if (low != voxels.end()) above = std::max(above, std::int64_t{(*high)[axis]} - (*low)[axis]);
  }
  above = std::min<std::int64_t>(above + 1, INT32_MAX);
  const std::uint64_t n = voxels.size();
  std::int64_t below = least;
  while (above - below > 1) {
    const std::int64_t middle = (below + above) / 2;
    const std::uint64_t heads = 100 * occupied_cells(voxels, static_cast<std::int32_t>(middle), scratch);
    const std::uint64_t wanted = settings.ratio * n;
    if ((heads > wanted ? heads - wanted : wanted - heads) < settings.tolerance * n) {
      return static_cast<std::int32_t>(middle);
    }
    (heads < wanted ? above : below) = middle;
  }
  return static_cast<std::int32_t>(below);
}

}  // namespace detail

/// Edges for these anchors, all of them coded.
[[nodiscard]] inline AnchorCells choose_anchor_cells(std::span<const Voxel> voxels,
                                                     const AnchorCellSettings& settings = {}) {
  Buffer<Voxel> scratch, heads;
  AnchorCells cells;
  cells.fine = detail::cell_edge(voxels, 1, settings, scratch);
  AnchorLevels levels;
  levels.sort(voxels, {cells.fine, cells.fine});  // a head alone in its coarse cell: level 2
  levels.assign();
  heads.resize(levels.counts()[2]);
  std::size_t next = 0;
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (levels.level()[i] == 2) heads[next++] = voxels[i];
  }
  cells.coarse = detail::cell_edge(std::as_const(heads).span(), cells.fine, settings, scratch);
  return cells;
}

}  // namespace compmark
