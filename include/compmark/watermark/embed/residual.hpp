// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Embedder: the watermark lives in a bounded residual that is added to one attribute of the anchors, x^w = x + tanh x'
// (docs/spec/method.md, 5.1, eq. "watermarked feature"; the ablation over attributes is the paper's). x' is a block of
// its own, zero in the beginning, and receives gradients from every loss; its slope is taken from x'
// (math/functions.hpp, tanh_slope), so that a saturated residual comes back. Baking adds tanh x' to the attribute and
// is exact: a baked model renders the same bits. Cost: one tanh and one addition an element of a visible anchor; 4
// bytes an element, and as much again for the gradient and Adam's moments.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/watermark/decoder/concept.hpp"

namespace compmark {

template <class T, AnchorAttribute attribute = AnchorAttribute::feature>
struct BoundedResidual {
  static constexpr bool is_absent = false;
  using Scalar = T;
  static constexpr AnchorAttribute target = attribute;
  struct Settings {};
  struct Handles {
    BlockHandle residual;  ///< "anchor.residual" [N, C], as wide as the attribute
  };
  /// The slope of tanh at x' of the listed rows, compact: what backward needs.
  struct Context {
    Buffer<T> slope;
  };

  [[nodiscard]] static Handles add_parameters(ParameterArena<T>& arena, std::size_t rows, std::size_t columns) {
    return {arena.add("anchor.residual", rows, columns, RowKind::anchor, BlockRole::rendering,
                      LearningSchedule::constant(0.0015))};
  }

  /// marked(row) = plain(row) + tanh residual(row) for the listed rows; other rows of `marked` are left alone. Both
  /// tables may be the same.
  template <Executor E>
  static void forward(MatrixView<const T> plain, MatrixView<const T> residual, std::span<const std::uint32_t> rows,
                      MatrixView<T> marked, Context& context, E& executor) {
    const std::size_t columns = residual.columns;
    COMPMARK_ASSERT(plain.columns == columns && marked.columns == columns, "BoundedResidual: columns");
    context.slope.resize(rows.size() * columns);
    executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        const T* const x = plain.row(rows[i]);
        const T* const r = residual.row(rows[i]);
        T* const out = marked.row(rows[i]);
        T* const kept = context.slope.data() + i * columns;
        for (std::size_t c = 0; c < columns; c += P::width) {
          const auto inside = P::MaskType::first(static_cast<std::ptrdiff_t>(columns - c));
          const P raw = P::load(r + c, inside);
          tanh_slope(raw).store(kept + c, inside);
          (P::load(x + c, inside) + tanh(raw)).store(out + c, inside);
        }
      }
    });
  }

  /// ADDS d_marked (1 - tanh^2 x') into d_residual for the listed rows. The gradient of the attribute itself is
  /// d_marked.
  template <Executor E>
  static void backward(MatrixView<const T> d_marked, std::span<const std::uint32_t> rows, MatrixView<T> d_residual,
                       const Context& context, E& executor) {
    const std::size_t columns = d_residual.columns;
    executor.for_chunks(rows.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        const T* const d = d_marked.row(rows[i]);
        T* const target = d_residual.row(rows[i]);
        const T* const kept = context.slope.data() + i * columns;
        for (std::size_t c = 0; c < columns; c += P::width) {
          const auto inside = P::MaskType::first(static_cast<std::ptrdiff_t>(columns - c));
          fma(P::load(d + c, inside), P::load(kept + c, inside), P::load(target + c, inside)).store(target + c, inside);
        }
      }
    });
  }

  /// Adds tanh x' to every row of the attribute and clears x': the model that is stored, compressed and shown.
  static void bake(MatrixView<T> plain, MatrixView<T> residual) {
    for (std::size_t row = 0; row < plain.rows; ++row) {
      for (std::size_t c = 0; c < plain.columns; c += P::width) {
        const auto inside = P::MaskType::first(static_cast<std::ptrdiff_t>(plain.columns - c));
        const P bounded = tanh(P::load(residual.row(row) + c, inside));
        (P::load(plain.row(row) + c, inside) + bounded).store(plain.row(row) + c, inside);
        P(T(0)).store(residual.row(row) + c, inside);
      }
    }
  }

 private:
  using P = Pack<T, native_width<T>>;
  static constexpr std::size_t grain = 512;  // rows
};

/// f^w = f + tanh f', the embedder of CompMarkGS.
template <class T>
using ResidualFeature = BoundedResidual<T, AnchorAttribute::feature>;

}  // namespace compmark
