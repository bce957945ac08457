// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Embedder: a free offset beside a frozen attribute, f^w = f + d. It is how GuardSplat marks (Chen et al., CVPR 2025,
// "SH-aware Watermark Embedding": offsets beside frozen spherical harmonics); on anchors the attribute is the feature.
// d is a block of its own, zero in the beginning. Differs from BoundedResidual in that nothing bounds it: what holds it
// small is a loss (offset_penalty.hpp). Baking adds d and is exact. Cost: one addition an element of a visible anchor;
// 4 bytes an element, and as much again for the gradient and Adam's moments.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/watermark/decoder/concept.hpp"

namespace compmark {

template <class T>
struct FeatureOffset {
  static constexpr bool is_absent = false;
  using Scalar = T;
  static constexpr AnchorAttribute target = AnchorAttribute::feature;
  struct Settings {};
  struct Handles {
    BlockHandle residual;  ///< "anchor.residual" [N, C], as wide as the feature
  };
  /// Empty: the slope of a sum is 1.
  struct Context {};

  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& arena, std::size_t rows, std::size_t columns) {
    return {arena.add("anchor.residual", rows, columns, RowKind::anchor, BlockRole::rendering,
                      LearningSchedule::constant(0.005))};
  }

  /// marked(row) = plain(row) + offset(row) for the listed rows; other rows of `marked` are left alone. Both tables may
  /// be the same.
  template <Executor E>
  static void forward(MatrixView<const T> plain, MatrixView<const T> offset, std::span<const std::uint32_t> rows,
                      MatrixView<T> marked, Context& /*context*/, E& executor) {
    COMPMARK_ASSERT(plain.columns == offset.columns && marked.columns == offset.columns, "FeatureOffset: columns");
    executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        const T* const x = plain.row(rows[i]);
        const T* const d = offset.row(rows[i]);
        T* const out = marked.row(rows[i]);
        for (std::size_t c = 0; c < offset.columns; ++c) out[c] = x[c] + d[c];
      }
    });
  }

  /// ADDS d_marked into d_offset for the listed rows.
  template <Executor E>
  static void backward(MatrixView<const T> d_marked, std::span<const std::uint32_t> rows, MatrixView<T> d_offset,
                       const Context& /*context*/, E& executor) {
    executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        const T* const d = d_marked.row(rows[i]);
        T* const sum = d_offset.row(rows[i]);
        for (std::size_t c = 0; c < d_offset.columns; ++c) sum[c] += d[c];
      }
    });
  }

  /// Adds the offset to every row of the attribute and clears it: the model that is stored, compressed and shown.
  static void bake(MatrixView<T> plain, MatrixView<T> offset) {
    for (std::size_t row = 0; row < plain.rows; ++row) {
      for (std::size_t c = 0; c < plain.columns; ++c) plain.row(row)[c] += offset.row(row)[c];
      std::fill_n(offset.row(row), offset.columns, T(0));
    }
  }

 private:
  static constexpr std::size_t grain = 512;  // rows
};

}  // namespace compmark
