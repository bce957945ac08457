// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An overlay: tables beside the model's own, into which stages write changed attributes of the anchors before they are
// decoded (x + tanh x' of a mark, the noise of a quantizer). The model's tables stay as they are. Rows that are not
// listed stay unwritten, and unchanged attributes are read from the model. In the backward pass the decoder adds its
// gradients to such tables, the stages turn them into gradients of their own inputs, and the rest is added to the
// model's. Cost: one copy of a visible anchor's changed attributes, forward and backward; where a stage writes all
// anchors, of all.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/table.hpp"

namespace compmark {

/// The columns of one attribute.
template <class Columns>
[[nodiscard]] auto& attribute(Columns&& columns, AnchorAttribute which) {
  switch (which) {
    case AnchorAttribute::position:
      return columns.position;
    case AnchorAttribute::scaling:
      return columns.scaling;
    case AnchorAttribute::offset:
      return columns.offset;
    case AnchorAttribute::feature:
      break;
  }
  return columns.feature;
}

/// Which rows of an attribute an overlay has.
enum class OverlaidRows : std::uint8_t { none, visible, all };

template <class T>
class AnchorOverlay {
 public:
  /// Nothing is changed.
  void begin() { overlaid_ = {}; }

  [[nodiscard]] OverlaidRows overlaid(AnchorAttribute which) const { return overlaid_[index(which)]; }
  /// Their numbers, which are `visible`'s where not all rows were written.
  [[nodiscard]] std::span<const std::uint32_t> rows(AnchorAttribute which,
                                                    std::span<const std::uint32_t> visible) const {
    return overlaid(which) == OverlaidRows::all ? all_rows_.span() : visible;
  }

  /// Returns the table for a stage that fills rows of an attribute from those of `columns`; it has the same shape.
  [[nodiscard]] MatrixView<T> write(AnchorAttribute which, OverlaidRows rows, const AnchorColumns<const T>& columns) {
    overlaid_[index(which)] = rows;
    if (rows == OverlaidRows::all) {
      all_rows_.resize(columns.rows());
      for (std::size_t i = 0; i < all_rows_.size(); ++i) all_rows_[i] = static_cast<std::uint32_t>(i);
    }
    return table(which, columns);
  }
  /// The table of an attribute that a stage changes in place: visible rows are copied first, unless they were written,
  /// and `columns` reads it.
  template <Executor E>
  MatrixView<T> change(AnchorAttribute which, std::span<const std::uint32_t> visible, AnchorColumns<const T>& columns,
                       E& executor) {
    const MatrixView<T> changed = table(which, columns);
    if (overlaid(which) != OverlaidRows::none) return changed;
    MatrixView<const T>& plain = attribute(columns, which);
    executor.for_chunks(visible.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i)
        std::copy_n(plain.row(visible[i]), plain.columns, changed.row(visible[i]));
    });
    plain = changed;
    overlaid_[index(which)] = OverlaidRows::visible;
    return changed;
  }

  /// The same for what a codec rounds: features, scales (exp of the scaling) and offsets, in this order.
  template <Executor E>
  std::array<MatrixView<T>, 3> change_coded(std::span<const std::uint32_t> visible, AnchorColumns<const T>& columns,
                                            E& executor) {
    std::array<MatrixView<T>, 3> tables;
    for (std::size_t i = 0; i < 3; ++i) tables[i] = change(coded[i], visible, columns, executor);
    return tables;
  }

  /// Where the decoder's backward adds: the arena's gradients, or cleared tables for what was changed.
  template <Executor E>
  [[nodiscard]] AnchorColumns<T> gradients(ParameterArena<T>& arena, const AnchorHandles& anchors,
                                           std::span<const std::uint32_t> visible, E& executor) {
    AnchorColumns<T> columns = anchor_gradients(arena, anchors);
    for (const AnchorAttribute which : attributes) {
      if (overlaid(which) == OverlaidRows::none) continue;
      MatrixView<T>& cleared = attribute(columns, which);
      gradients_[index(which)].resize(cleared.size());
      cleared.data = gradients_[index(which)].data();
      const std::span<const std::uint32_t> rows = this->rows(which, visible);
      executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) std::fill_n(cleared.row(rows[i]), cleared.columns, T(0));
      });
    }
    return columns;
  }
  /// The gradients of a changed attribute, for a stage to turn into those of what it read.
  [[nodiscard]] MatrixView<T> gradient(AnchorAttribute which, ParameterArena<T>& arena, const AnchorHandles& anchors) {
    AnchorColumns<T> columns = anchor_gradients(arena, anchors);
    MatrixView<T> table = attribute(columns, which);
    table.data = gradients_[index(which)].data();
    return table;
  }
  /// … of features, scales and offsets.
  [[nodiscard]] std::array<MatrixView<T>, 3> coded_gradients(ParameterArena<T>& arena, const AnchorHandles& anchors) {
    std::array<MatrixView<T>, 3> tables;
    for (std::size_t i = 0; i < 3; ++i) tables[i] = gradient(coded[i], arena, anchors);
    return tables;
  }
  /// After all stages: adds what is left to the arena's gradients.
  template <Executor E>
  void add_to(ParameterArena<T>& arena, const AnchorHandles& anchors, std::span<const std::uint32_t> visible,
              E& executor) {
    AnchorColumns<T> target = anchor_gradients(arena, anchors);
    for (const AnchorAttribute which : attributes) {
      if (overlaid(which) == OverlaidRows::none) continue;
      const MatrixView<const T> source = gradient(which, arena, anchors);
      const MatrixView<T> into = attribute(target, which);
      const std::span<const std::uint32_t> rows = this->rows(which, visible);
      executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) {
          const T* const from = source.row(rows[i]);
          T* const to = into.row(rows[i]);
          for (std::size_t c = 0; c < source.columns; ++c) to[c] += from[c];
        }
      });
    }
  }

 private:
  static constexpr std::size_t grain = 1024;  // rows
  static constexpr std::array<AnchorAttribute, 4> attributes{AnchorAttribute::feature, AnchorAttribute::position,
                                                             AnchorAttribute::scaling, AnchorAttribute::offset};
  static constexpr std::array<AnchorAttribute, 3> coded{AnchorAttribute::feature, AnchorAttribute::scaling,
                                                        AnchorAttribute::offset};
  [[nodiscard]] static constexpr std::size_t index(AnchorAttribute which) { return static_cast<std::size_t>(which); }
  /// The overlay's table of an attribute, shaped like `columns`'.
  [[nodiscard]] MatrixView<T> table(AnchorAttribute which, const AnchorColumns<const T>& columns) {
    const MatrixView<const T>& shape = attribute(columns, which);
    Buffer<T>& storage = values_[index(which)];
    storage.resize(shape.size());
    return {storage.data(), shape.rows, shape.columns};
  }

  std::array<Buffer<T>, 4> values_, gradients_;  // [N, C] each, by AnchorAttribute; only listed rows have a meaning
  std::array<OverlaidRows, 4> overlaid_{};
  Buffer<std::uint32_t> all_rows_;
};

/// Replaces the overlay where no stage changes an anchor.
struct NoOverlay {
  static void begin() {}
};

}  // namespace compmark
