// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Blocks of ContextGS's entropy model in the arena, their first values, and the parts that are computed from all
// anchors when its context begins: box and statistics as for HAC (hac_parameters.hpp) and the cells of the levels. A
// coder must use the same inputs to predict the same:
//   inputs of level 2    [2 (x - box minimum) / (box maximum - box minimum) - 1, clipped to [-1, 1] (3); z (12)]
//   inputs of 1 and 0    [(v - v of the parent) / edge of the parent's cell (3): coarse for level 1, fine for level 0;
//                         (f - mean) / deviation of the parent's decoded features (D); (l - mean) / deviation of its
//                           scales (6); z (12)]
//   z                    its symbol is the nearest whole number, half to even, coded before all else; 0 for NaN and
//                        beyond 1e6
//   decoded              k q of the parent's symbols and steps; scales unclipped, so that 0 is possible
//   outputs              as HAC's: mu_f, s_f, mu_l, s_l, mu_o, s_o, r_f, r_l, r_o (hac_attributes.hpp)
// The published inputs are raw world coordinates of the parent, which depend on the scale of the scene and do not
// contain the anchor's place in its parent's cell (docs/spec/compression.md, 2.3 and 5.13). Rows of new anchors have z
// = 0 (published: the largest of the merged parents'); a mask's 0 is logit 1.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "compmark/codec/context_gs/anchor_cells.hpp"
#include "compmark/codec/context_gs/anchor_levels.hpp"
#include "compmark/codec/context_gs/context_gs_levels.hpp"
#include "compmark/codec/hac/hac_parameters.hpp"
#include "compmark/codec/rate/factorised_prior.hpp"
#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

struct ContextGsHandles {
  struct Network {
    BlockHandle weight1, bias1, weight2, bias2;
  };
  BlockHandle mask;        ///< "anchor.mask"          [N, K]   logit - 1
  BlockHandle hyperprior;  ///< "anchor.hyperprior"    [N, 12]  z
  std::array<Network, 3>
      network;        ///< of level i: "context_gs.i.0.weight" [100, inputs], ".0.bias" [1, 100], ".2.weight", ".2.bias"
  BlockHandle prior;  ///< "context_gs.prior"     [12, 58] see factorised_prior.hpp
  BlockHandle
      /// "context_gs.cells" [1, 4] edges fine, coarse; voxel size, and what its rounding left; not trained
      cells;
  BlockHandle box;                       ///< "context.box"          [2, 3]   minimum, maximum; not trained
  BlockHandle statistics;                ///< "context.statistics"   [2, D + 6 + 3 K] mean, deviation; not trained
  BlockHandle feature, scaling, offset;  ///< of the anchor table
};

template <class T, class Root, class Child, class Attributes, class Prior>
ContextGsHandles add_context_gs_blocks(ParameterArena<T>& arena, std::size_t anchor_rows, std::size_t offsets) {
  const auto add = [&](const std::string& name, int rows, int columns, const LearningSchedule& schedule) {
    return arena.add(name, static_cast<std::size_t>(rows), static_cast<std::size_t>(columns), RowKind::fixed,
                     BlockRole::context, schedule);
  };
  constexpr LearningSchedule hyperprior{0.0075, 0.0075, RateUnit::one, context_schedule.starts_after};
  ContextGsHandles handles;
  handles.mask = arena.add("anchor.mask", anchor_rows, offsets, RowKind::anchor, BlockRole::mask, offset_mask_schedule);
  handles.hyperprior = arena.add("anchor.hyperprior", anchor_rows, static_cast<std::size_t>(Prior::channels),
                                 RowKind::anchor, BlockRole::context, hyperprior);
  for (std::size_t level = 0; level < 3; ++level) {
    const std::string name = "context_gs." + std::to_string(level);
    handles.network[level].weight1 =
        add(name + ".0.weight", Root::hidden, level == 2 ? Root::inputs : Child::inputs, context_schedule);
    handles.network[level].bias1 = add(name + ".0.bias", 1, Root::hidden, context_schedule);
    handles.network[level].weight2 = add(name + ".2.weight", Root::outputs, Root::hidden, context_schedule);
    handles.network[level].bias2 = add(name + ".2.bias", 1, Root::outputs, context_schedule);
  }
  handles.prior = add("context_gs.prior", Prior::channels, Prior::parameters, context_schedule);
  handles.cells = add("context_gs.cells", 1, 4, LearningSchedule::fixed());
  add_common_blocks<Attributes>(arena, handles);
  return handles;
}

/// PyTorch's default for Linear, U(-1, 1) / sqrt(fan_in); z = 0; masks at logit 1; box and statistics of the unit box;
/// no cells yet.
template <class Prior, class T>
void initialise_context_gs(ParameterArena<T>& arena, const ContextGsHandles& handles, std::uint64_t seed) {
  const auto fill = [&](BlockHandle handle, BlockHandle weight) {
    const Random random(seed, 0, random_stage(arena.layout().block(handle).name));
    const double bound = 1 / std::sqrt(static_cast<double>(arena.layout().block(weight).columns));
    std::size_t index = 0;
    for (T& value : arena.values(handle).flat()) value = static_cast<T>(bound * (2 * random.uniform(index++) - 1));
  };
  for (const ContextGsHandles::Network& network : handles.network) {
    fill(network.weight1, network.weight1);
    fill(network.bias1, network.weight1);
    fill(network.weight2, network.weight2);
    fill(network.bias2, network.weight2);
  }
  Prior::initialise(arena.values(handles.prior), seed);
  for (const BlockHandle handle : {handles.mask, handles.hyperprior, handles.cells}) {
    for (T& value : arena.values(handle).flat()) value = T(0);
  }
  for (const BlockHandle handle : {handles.box, handles.statistics}) {
    const MatrixView<T> block = arena.values(handle);
    std::fill_n(block.row(0), block.columns, T(0));
    std::fill_n(block.row(1), block.columns, T(1));
  }
}

/// The block "context_gs.cells" as numbers.
template <class T>
[[nodiscard]] AnchorCells anchor_cells(MatrixView<const T> block) {
  return {static_cast<std::int32_t>(block(0, 0)), static_cast<std::int32_t>(block(0, 1))};
}
template <class T>
[[nodiscard]] double anchor_voxel_size(MatrixView<const T> block) {
  return static_cast<double>(block(0, 2)) + static_cast<double>(block(0, 3));
}

/// Cells for the unmasked anchors as they are; the voxel size stays. Call it again when growing has ended
/// (docs/spec/compression.md, 5.11).
template <class T>
void choose_context_gs_cells(ParameterArena<T>& arena, const ContextGsHandles& handles, MatrixView<const T> position) {
  const MatrixView<T> cells = arena.values(handles.cells);
  const MatrixView<const T> mask = std::as_const(arena).values(handles.mask);
  const double voxel_size = anchor_voxel_size<T>(cells);
  Buffer<Voxel> voxels(position.rows);
  std::size_t unmasked = 0;
  for (std::size_t i = 0; i < position.rows; ++i) {
    if (any_unmasked(mask.row(i), mask.columns)) voxels[unmasked++] = nearest_voxel(position.row(i), voxel_size);
  }
  const AnchorCells chosen = choose_anchor_cells(std::as_const(voxels).span().first(unmasked));
  // Edges above 2^24 lose digits in float: all anchors are in one cell then. The largest would become 2^31, which is no
  // int32 any more.
  constexpr std::int32_t largest = std::int32_t{1} << 30;
  cells(0, 0) = static_cast<T>(std::min(chosen.fine, largest));
  cells(0, 1) = static_cast<T>(std::min(chosen.coarse, largest));
}

template <class Attributes, class T>
void begin_context_gs(ParameterArena<T>& arena, const ContextGsHandles& handles, MatrixView<const T> position,
                      MatrixView<const T> feature, MatrixView<const T> scaling, MatrixView<const T> offset,
                      double voxel_size) {
  HacHandles common;
  common.mask = handles.mask;
  common.box = handles.box;
  common.statistics = handles.statistics;
  begin_hac_context<Attributes>(arena, common, position, feature, scaling, offset);
  const MatrixView<T> cells = arena.values(handles.cells);
  cells(0, 2) = static_cast<T>(voxel_size);
  cells(0, 3) = static_cast<T>(voxel_size - static_cast<double>(cells(0, 2)));
  choose_context_gs_cells(arena, handles, position);
}

}  // namespace compmark
