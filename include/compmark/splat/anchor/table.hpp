// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The anchor table as blocks of a parameter arena: position, offset, scaling (log) and feature, one row an anchor,
// edited together by growing and pruning. Row-major, because a view decodes only the visible rows: one anchor is 9 + 3
// K + D neighbouring scalars in four places (71 floats for K = 10, D = 32), read once a pass. The views below cost
// nothing.
#pragma once

#include <cstddef>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/decoder_shape.hpp"

namespace compmark {

/// The four blocks of one anchor table in its arena; they stay valid through row edits.
struct AnchorHandles {
  BlockHandle
      position;  ///< "anchor.position" [N, 3]    world units; never trained by the published schedule (learning rate 0)
  BlockHandle offset;   ///< "anchor.offset"   [N, 3 K]  in units of exp(scaling[0:3])
  BlockHandle scaling;  ///< "anchor.scaling"  [N, 6]    log
  BlockHandle feature;  ///< "anchor.feature"  [N, D]
};

/// Adds the four blocks with `rows` anchors, all zero. Cost: copies of the arena (once a run).
template <class T>
AnchorHandles add_anchor_blocks(ParameterArena<T>& arena, std::size_t rows, const DecoderShape& shape) {
  COMPMARK_ASSERT(shape.valid(), "add_anchor_blocks: the shape is not valid");
  AnchorHandles handles;
  handles.position =
      arena.add("anchor.position", rows, 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
  handles.offset = arena.add("anchor.offset", rows, 3 * static_cast<std::size_t>(shape.offsets), RowKind::anchor,
                             BlockRole::rendering, {0.01, 0.0001, RateUnit::scene_extent});
  handles.scaling =
      arena.add("anchor.scaling", rows, 6, RowKind::anchor, BlockRole::rendering, LearningSchedule::constant(0.007));
  handles.feature = arena.add("anchor.feature", rows, static_cast<std::size_t>(shape.feature_dim), RowKind::anchor,
                              BlockRole::rendering, LearningSchedule::constant(0.0075));
  return handles;
}

/// The handles of a table that is already in the arena (after reading a checkpoint); invalid handles where a block is
/// missing.
[[nodiscard]] inline AnchorHandles find_anchor_blocks(const ArenaLayout& layout) {
  return {layout.find("anchor.position"), layout.find("anchor.offset"), layout.find("anchor.scaling"),
          layout.find("anchor.feature")};
}

/// Views of the values; valid until the next edit_rows or add of the arena.
template <class T>
[[nodiscard]] AnchorColumns<T> anchor_values(ParameterArena<T>& arena, const AnchorHandles& handles) {
  return {arena.values(handles.position), arena.values(handles.offset), arena.values(handles.scaling),
          arena.values(handles.feature)};
}
template <class T>
[[nodiscard]] AnchorColumns<const T> anchor_values(const ParameterArena<T>& arena, const AnchorHandles& handles) {
  return {arena.values(handles.position), arena.values(handles.offset), arena.values(handles.scaling),
          arena.values(handles.feature)};
}
/// Views of the gradients, in the layout of the values.
template <class T>
[[nodiscard]] AnchorColumns<T> anchor_gradients(ParameterArena<T>& arena, const AnchorHandles& handles) {
  return {arena.gradients(handles.position), arena.gradients(handles.offset), arena.gradients(handles.scaling),
          arena.gradients(handles.feature)};
}

/// Rows of the table.
[[nodiscard]] inline std::size_t anchor_count(const ArenaLayout& layout, const AnchorHandles& handles) {
  return layout.block(handles.position).rows;
}

}  // namespace compmark
