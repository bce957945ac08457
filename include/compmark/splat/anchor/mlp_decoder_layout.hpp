// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Constants, scratch memory and row movers of the fused decoder: how a block of 16 visible anchors gets from the rows
// of the table into lanes and back. Lanes are anchors in the forward pass and in everything that touches Gaussians;
// lanes are hidden units in the backward pass, because sums over anchors (weight gradients) then need no transposition
// at all.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/views.hpp"
#include "compmark/math/dense.hpp"
#include "compmark/math/functions.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/decoder_parameters.hpp"
#include "compmark/splat/anchor/view_point.hpp"

namespace compmark::detail {

/// Sizes that follow from the shape. A block (16 anchors) is the unit of the order of Gaussians, a panel (64) that of
/// the products.
template <class T, int W, DecoderShape shape>
struct DecoderLayout {
  static_assert(16 % W == 0, "the decoder's blocks have 16 lanes");
  static constexpr int round_up(int n) { return (n + W - 1) / W * W; }
  static constexpr int block = 16;
  static constexpr int panel = 64;
  static constexpr int panel_capacity = panel + block;  // one more block may be appended before a panel is worked off
  /// Gaussians to ask for ahead: 15 columns written and 25 read are more streams than the hardware follows. With the
  /// rows of anchors, 20,000 anchors take 6.8 instead of 7.6 ms both ways (the best of four rounds in turn, two
  /// threads).
  static constexpr std::size_t columns_ahead = 64;
  static constexpr int width = shape.feature_dim;
  static constexpr int offsets = shape.offsets;
  static constexpr int view_inputs = shape.distance ? 4 : 3;
  static constexpr int inputs = shape.head_inputs();
  static constexpr int input_row =
      inputs + 1;  // row-major inputs end with a one, so that biases are a row of the weights
  static constexpr int head_hidden = round_up(width);  // padded with zeros to whole packs
  static constexpr int hidden = 3 * head_hidden;       // the three heads side by side: opacity, covariance, colour
  static constexpr int feature_row = round_up(width);
  static constexpr int outputs = 11 * offsets;  // opacity K, covariance 7 K, colour 3 K
  static constexpr int output_begin(int head) { return head == 0 ? 0 : (head == 1 ? offsets : 8 * offsets); }
  static constexpr int output_count(int head) { return head == 0 ? offsets : (head == 1 ? 7 * offsets : 3 * offsets); }

  // One chunk's gradients of the networks.
  static constexpr int bank_parameters = [] {
    if constexpr (shape.feature_bank) {
      return FeatureBank<T, shape.feature_dim>::parameter_count;
    } else {
      return 0;
    }
  }();
  static constexpr int d_weight2 = 0;                                  // [outputs, head_hidden]
  static constexpr int d_weight1 = d_weight2 + outputs * head_hidden;  // [input_row, hidden], last row: biases
  static constexpr int d_bias2 = d_weight1 + input_row * hidden;       // [outputs]
  static constexpr int d_bank = d_bias2 + outputs;
  static constexpr int gradient_count = (d_bank + bank_parameters + 15) / 16 * 16;

  // The networks' values as the backward pass wants them.
  static constexpr int packed_weight1 = 0;                                    // [input_row, hidden], last row: biases
  static constexpr int packed_feature = packed_weight1 + input_row * hidden;  // [hidden, feature_row]
  static constexpr int packed_view = packed_feature + hidden * feature_row;   // [view_inputs, hidden]
  static constexpr int packed_weight2 = packed_view + view_inputs * hidden;   // [outputs, head_hidden]
  static constexpr int packed_count = packed_weight2 + outputs * head_hidden;
};

/// Unit direction and distance of W anchors seen from the view point; (0, 0, 1) and 0 where the anchor is at the camera
/// (case PR9).
template <class T, int W>
struct ViewLanes {
  Pack<T, W> direction[3];
  Pack<T, W> distance;
  Mask<T, W> regular;

  COMPMARK_INLINE ViewLanes(const ViewPoint<T>& from, const Pack<T, W> (&position)[3]) {
    using P = Pack<T, W>;
    P v[3];
    for (int i = 0; i < 3; ++i) v[i] = (position[i] - P(from.high[i])) - P(from.low[i]);
    const P largest = max(max(abs(v[0]), abs(v[1])), abs(v[2]));
    const P x = v[0] / largest, y = v[1] / largest, z = v[2] / largest;  // no square overflows or vanishes
    const P norm = sqrt(fma(x, x, fma(y, y, z * z)));
    distance = largest * norm;
    regular = distance > P(from.min_distance);
    direction[0] = keep(regular, x / norm);
    direction[1] = keep(regular, y / norm);
    direction[2] = select(regular, z / norm, P(T(1)));
    distance = keep(regular, distance);
  }
};

/// `Count` columns of W anchors into W rows of lanes (the transposed columns). Row pointers may be null: those lanes
/// become zero.
template <int Count, int Stride, int W, class T>
inline void gather_strip(const T* const (&lines)[W], std::size_t column, T* target) {
  using P = Pack<T, W>;
  P packs[W];
  for (int i = 0; i < W; ++i) {
    packs[i] = P(T{});
    if (lines[i] == nullptr) continue;
    if constexpr (Count == W) {
      packs[i] = P::load(lines[i] + column);
    } else {
      packs[i] = P::load(lines[i] + column, Mask<T, W>::first(Count));
    }
  }
  transpose(packs);
  for (int j = 0; j < Count; ++j) packs[j].store(target + j * Stride);
}

/// target[column * Stride + lane] = table(rows[lane], column); lanes beyond `valid` become zero. Reads inside the rows
/// only.
template <int Columns, int Stride, int W, class T>
inline void gather_transposed(MatrixView<const T> table, const std::uint32_t* rows, int valid, T* target) {
  for (int first = 0; first < 16; first += W) {
    const T* lines[W];
    for (int i = 0; i < W; ++i) lines[i] = first + i < valid ? table.row(rows[first + i]) : nullptr;
    int column = 0;
    for (; column + W <= Columns; column += W) {
      gather_strip<W, Stride, W>(lines, static_cast<std::size_t>(column), target + column * Stride + first);
    }
    if constexpr (Columns % W != 0) {
      gather_strip<Columns % W, Stride, W>(lines, static_cast<std::size_t>(column), target + column * Stride + first);
    }
  }
}

template <int Count, int W, class T>
inline void scatter_strip(const T* source, T* const (&lines)[W], std::size_t column) {
  using P = Pack<T, W>;
  P packs[W];
  for (int j = 0; j < W; ++j) packs[j] = j < Count ? P::load(source + j * 16) : P(T{});
  transpose(packs);
  for (int i = 0; i < W; ++i) {
    if (lines[i] == nullptr) continue;
    T* const target = lines[i] + column;
    if constexpr (Count == W) {
      (P::load(target) + packs[i]).store(target);
    } else {
      const auto mask = Mask<T, W>::first(Count);
      (P::load(target, mask) + packs[i]).store(target, mask);
    }
  }
}

/// table(rows[lane], column) += source[column * 16 + lane] for the lanes whose bit is set. Writes inside the rows only.
template <int Columns, int W, class T>
inline void scatter_add_transposed(const T* source, const std::uint32_t* rows, unsigned lanes, MatrixView<T> table) {
  for (int first = 0; first < 16; first += W) {
    T* lines[W];
    for (int i = 0; i < W; ++i) lines[i] = (lanes >> (first + i) & 1u) != 0 ? table.row(rows[first + i]) : nullptr;
    int column = 0;
    for (; column + W <= Columns; column += W)
      scatter_strip<W, W>(source + column * 16 + first, lines, static_cast<std::size_t>(column));
    if constexpr (Columns % W != 0) {
      scatter_strip<Columns % W, W>(source + column * 16 + first, lines, static_cast<std::size_t>(column));
    }
  }
}

/// Asks for what lies `ahead` values on. That may be behind the end of the column, so the address is an integer.
template <bool write, class T>
COMPMARK_INLINE void ask_ahead(const T* place, std::size_t ahead) {
  const std::uintptr_t address = reinterpret_cast<std::uintptr_t>(place) + ahead * sizeof(T);
  __builtin_prefetch(reinterpret_cast<const void*>(address),
                     write ? 1 : 0);  // NOLINT(performance-no-int-to-ptr): never read
}

/// Asks for the rows of a block of visible anchors, if there is one. They lie anywhere, so that no hardware foresees
/// them.
template <bool write, class T>
COMPMARK_INLINE void ask_for_rows(MatrixView<T> table, std::span<const std::uint32_t> visible, std::size_t block) {
  const std::size_t begin = std::min(block * 16, visible.size()), end = std::min(begin + 16, visible.size());
  for (std::size_t i = begin; i < end; ++i) {
    const T* const row = table.row(visible[i]);
    for (std::size_t c = 0; c < table.columns; c += 64 / sizeof(T)) __builtin_prefetch(row + c, write ? 1 : 0);
    __builtin_prefetch(row + table.columns - 1, write ? 1 : 0);
  }
}

/// Position (3 rows) and log scaling (6 rows) of a block as lanes, target[column * 16 + lane]; too narrow for register
/// transposition.
template <class T>
inline void gather_geometry(const AnchorColumns<const T>& anchors, const std::uint32_t* rows, int valid, T* position,
                            T* scaling) {
  for (int lane = 0; lane < 16; ++lane) {
    const bool real = lane < valid;
    const T* const x = real ? anchors.position.row(rows[lane]) : nullptr;
    for (int i = 0; i < 3; ++i) position[i * 16 + lane] = real ? x[i] : T(0);
    if (scaling == nullptr) continue;
    const T* const s = real ? anchors.scaling.row(rows[lane]) : nullptr;
    for (int i = 0; i < 6; ++i) scaling[i * 16 + lane] = real ? s[i] : T(0);
  }
}

}  // namespace compmark::detail
