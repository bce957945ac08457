// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Small dense products whose shape the compiler knows: C = start + A B, rows of C in registers, elements of A
// broadcast, rows of B in packs. The networks of this library are tens of columns wide, so that a general matrix
// product spends its time on packing and edges; here every stride is a constant, and the caller's `start` and `finish`
// fuse bias, activation and accumulation into the registers. Sums run over `steps` in ascending order with one fused
// multiply-add each: the bits do not depend on the width of the packs. Cost: rows * columns * steps multiply-adds; per
// step a tile loads Packs + Rows values for Packs * Rows packs of multiply-adds.
#pragma once

#include <cstddef>
#include <type_traits>
#include <utility>

#include "compmark/math/pack.hpp"
#include "compmark/math/unroll.hpp"

#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(undefined_behavior_sanitizer)
#define COMPMARK_DETAIL_SANITIZED 1
#endif
#endif

namespace compmark {

/// C[rows, columns] += sum over steps of A[row, step] B[step, column]; columns is a multiple of the pack width.
///   A(row, step) = a[row * a_row + step * a_step],  B(step, column) = b[step * b_step + column],  C(row, column) =
///     c[row * c_row + column]
struct ProductShape {
  int rows = 0;
  int columns = 0;
  int steps = 0;
  int a_row = 0;
  int a_step = 1;
  int b_step = 0;
  int c_row = 0;
};

namespace detail {

/// Accumulators that fit the register file beside B and one element of A: 24 of 32 registers with AVX-512, 12 of 16
/// otherwise. Builds for debugging take small tiles, because instrumented unrolled code compiles for minutes; the sums
/// are the same bits at any tile.
template <class T, int W>
inline constexpr int product_accumulators = [] {
#if !defined(__OPTIMIZE__) || defined(__SANITIZE_ADDRESS__) || defined(COMPMARK_DETAIL_SANITIZED)
  return 2;
#else
  return uses_mask_register<T, W> ? 24 : 12;
#endif
}();

/// Rows x Packs accumulators. The loops have constant lengths and are unrolled completely (clang does so unasked, g++
/// at -O2 when told).
template <class T, int W, ProductShape shape, int Rows, int Packs, class Start, class Finish>
inline void product_tile(const T* a, const T* b, T* c, int row, int column, const Start& start, const Finish& finish) {
  using P = Pack<T, W>;
  P sum[Rows][Packs];
  COMPMARK_GCC_UNROLL(24)
  for (int r = 0; r < Rows; ++r) {
    COMPMARK_GCC_UNROLL(3)
    for (int p = 0; p < Packs; ++p) {
      sum[r][p] = start(row + r, column + p * W, c + (row + r) * shape.c_row + column + p * W);
    }
  }
  const T* a_tile = a + row * shape.a_row;
  const T* b_tile = b + column;
  COMPMARK_GCC_UNROLL(1)
  for (int step = 0; step < shape.steps; ++step) {
    P row_of_b[Packs];
    COMPMARK_GCC_UNROLL(3)
    for (int p = 0; p < Packs; ++p) row_of_b[p] = P::load(b_tile + p * W);
    COMPMARK_GCC_UNROLL(24)
    for (int r = 0; r < Rows; ++r) {
      const P element(a_tile[r * shape.a_row]);
      COMPMARK_GCC_UNROLL(3)
      for (int p = 0; p < Packs; ++p) sum[r][p] = fma(element, row_of_b[p], sum[r][p]);
    }
    a_tile += shape.a_step;
    b_tile += shape.b_step;
  }
  COMPMARK_GCC_UNROLL(24)
  for (int r = 0; r < Rows; ++r) {
    COMPMARK_GCC_UNROLL(3)
    for (int p = 0; p < Packs; ++p) {
      finish(row + r, column + p * W, sum[r][p]).store(c + (row + r) * shape.c_row + column + p * W);
    }
  }
}

/// Rows in tiles of nearly equal height, at most `accumulators / Packs`: at most two tile kernels a product.
template <class T, int W, ProductShape shape, int Packs, class Start, class Finish>
COMPMARK_INLINE void product_strip(const T* a, const T* b, T* c, int column, const Start& start, const Finish& finish) {
  constexpr int most = product_accumulators<T, W> < Packs ? 1 : product_accumulators<T, W> / Packs;
  constexpr int tiles = (shape.rows + most - 1) / most;
  constexpr int small = shape.rows / tiles;
  constexpr int larger_tiles = shape.rows - small * tiles;  // these have small + 1 rows
  int row = 0;
  if constexpr (larger_tiles > 0) {
    for (int tile = 0; tile < larger_tiles; ++tile, row += small + 1) {
      product_tile<T, W, shape, small + 1, Packs>(a, b, c, row, column, start, finish);
    }
  }
  for (int tile = larger_tiles; tile < tiles; ++tile, row += small) {
    product_tile<T, W, shape, small, Packs>(a, b, c, row, column, start, finish);
  }
}

}  // namespace detail

/// The product of ProductShape. start(row, column, c) gives the first value of a pack of C, finish(row, column, sum)
/// the stored one.
template <class T, int W, ProductShape shape, class Start, class Finish>
inline void product(const T* a, const T* b, T* c, const Start& start, const Finish& finish) {
  static_assert(shape.columns % W == 0, "product: pad the columns to whole packs");
  constexpr int packs = shape.columns / W;
  constexpr int strip = packs % 2 == 0 ? 2 : (packs == 3 ? 3 : 1);
  for (int column = 0; column < shape.columns; column += strip * W) {
    detail::product_strip<T, W, shape, strip>(a, b, c, column, start, finish);
  }
}

/// Usual starts and finishes.
template <class T, int W>
struct StartZero {
  COMPMARK_INLINE Pack<T, W> operator()(int /*row*/, int /*column*/, const T* /*c*/) const { return Pack<T, W>(T{}); }
};
template <class T, int W>
struct StartAccumulate {
  COMPMARK_INLINE Pack<T, W> operator()(int /*row*/, int /*column*/, const T* c) const { return Pack<T, W>::load(c); }
};
/// One bias a row.
template <class T, int W>
struct StartBias {
  const T* bias;
  COMPMARK_INLINE Pack<T, W> operator()(int row, int /*column*/, const T* /*c*/) const { return Pack<T, W>(bias[row]); }
};
template <class T, int W>
struct FinishLinear {
  COMPMARK_INLINE Pack<T, W> operator()(int /*row*/, int /*column*/, Pack<T, W> sum) const { return sum; }
};
/// x < 0 ? 0 : x. A NaN stays a NaN (docs/spec/numerics.md, ML4).
template <class T, int W>
struct FinishRelu {
  COMPMARK_INLINE Pack<T, W> operator()(int /*row*/, int /*column*/, Pack<T, W> sum) const {
    return select(sum < Pack<T, W>(T{}), Pack<T, W>(T{}), sum);
  }
};

/// W packs, each a row of a W x W matrix, transposed in registers: log2(W) rounds of two-source shuffles.
template <class T, int W>
COMPMARK_INLINE void transpose(Pack<T, W> (&rows)[W]) {
  if constexpr (W > 1) {
    using P = Pack<T, W>;
    const auto round = [&]<int Distance, int... Lane>(
        std::integral_constant<int, Distance>, std::integer_sequence<int, Lane...>) __attribute__((always_inline)) {
      detail::unroll<W>([&](auto i) __attribute__((always_inline)) {
        if constexpr ((i & Distance) == 0) {
          const auto x = rows[i].native;
          const auto y = rows[i + Distance].native;
          rows[i] =
              P::from_native(__builtin_shufflevector(x, y, ((Lane & Distance) == 0 ? Lane : W + Lane - Distance)...));
          rows[i + Distance] =
              P::from_native(__builtin_shufflevector(x, y, ((Lane & Distance) == 0 ? Lane + Distance : W + Lane)...));
        }
      });
    };
    constexpr auto lanes = std::make_integer_sequence<int, W>{};
    if constexpr (W > 8) round(std::integral_constant<int, 8>{}, lanes);
    if constexpr (W > 4) round(std::integral_constant<int, 4>{}, lanes);
    if constexpr (W > 2) round(std::integral_constant<int, 2>{}, lanes);
    round(std::integral_constant<int, 1>{}, lanes);
  }
}

}  // namespace compmark
