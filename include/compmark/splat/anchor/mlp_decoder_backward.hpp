// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Backward kernels of the fused decoder (docs/spec/method.md, 1.6). Per block, lanes are anchors: gradients of
// Gaussians become gradients of the heads' outputs and of offset, scaling and position. Anchors that received any
// gradient are packed into panels of 64 rows (an occluded or culled anchor costs nothing from there on), and per panel,
// lanes are hidden units: five products recompute the hidden layer and give the gradients of weights and inputs. Weight
// gradients belong to a fixed chunk of blocks and are added in chunk order. Cost an anchor with gradient: 2 (2 (D + 4)
// 3 D + D 3 D + 2 D 11 K) operations (33 k for D = 32, K = 10), a fifth of them recomputation of the hidden layer, so
// that no memory of 3 D values an anchor grows with the view (docs/concepts/GaussianDecoder.md has the figures). Longer
// than 300 lines: the five products share one panel and its layout, and are read side by side.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/gaussians.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/mlp_decoder_layout.hpp"

namespace compmark::detail {

/// One worker's memory in the backward pass.
template <class T, int W, DecoderShape shape>
struct DecodeBackwardScratch {
  using L = DecoderLayout<T, W, shape>;
  // Panel, one row an anchor.
  alignas(64) T input[L::panel_capacity * L::input_row];
  alignas(64) T hidden[L::panel * L::hidden];
  alignas(64) T d_hidden[L::panel * L::hidden];
  alignas(64) T d_feature[L::panel * L::feature_row];
  alignas(64) std::uint32_t row[L::panel_capacity];
  // Panel, lanes are anchors.
  alignas(64) T d_output[L::outputs * L::panel_capacity];
  alignas(64) T view[5 * L::panel_capacity];  // direction 3, distance, 1 / distance (0 at the camera)
  alignas(64) T d_view[4 * L::panel];
  alignas(64) T d_bias2[L::outputs * W];  // partial sums of the chunk
  // Block, lanes are anchors.
  alignas(64) T position[3 * L::block];
  alignas(64) T scaling[6 * L::block];
  alignas(64) T inverse_base[3 * L::block];  // exp(-scaling[3:6])
  alignas(64) T offset[3 * L::offsets * L::block];
  alignas(64) T d_offset[3 * L::offsets * L::block];
  alignas(64) T d_geometry[9 * L::block];  // position 3, log scaling 6
  alignas(64) T block_output[L::outputs * L::block];
};

template <class T, DecoderShape shape>
struct BackwardArguments {
  AnchorColumns<const T> anchors;
  std::span<const std::uint32_t> visible;
  ViewPoint<T> from;
  const T* packed;                     // DecoderLayout::packed_…
  const T* bank;                       // feature bank parameters in one piece; null without it
  const T* opacity;                    // [blocks, K, 16]
  const std::uint16_t* mask;           // [blocks, K]
  const std::uint32_t* block_row;      // [blocks + 1]
  GaussianColumns<const T> gaussians;  // what forward wrote
  const T* inverse_norm;               // [P]
  GaussianColumns<const T> d_gaussians;
  AnchorColumns<T> d_anchors;
};

template <class T, int W, DecoderShape shape>
struct BackwardKernels {
  using L = DecoderLayout<T, W, shape>;
  using P = Pack<T, W>;
  using M = Mask<T, W>;
  using Arguments = BackwardArguments<T, shape>;
  using Scratch = DecodeBackwardScratch<T, W, shape>;

  /// Blocks [begin, end) into `gradients`, one chunk's DecoderLayout::gradient_count values.
  static void run_chunk(const Arguments& a, std::size_t begin, std::size_t end, T* gradients, Scratch& s) {
    for (int i = 0; i < L::gradient_count; ++i) gradients[i] = T(0);
    for (T& value : s.d_bias2) value = T(0);
    int filled = 0;
    for (std::size_t block = begin; block < end; ++block) {
      if (a.block_row[block] == a.block_row[block + 1]) continue;
      ask_for_rows<false>(a.anchors.offset, a.visible, block + 1);
      ask_for_rows<false>(a.anchors.scaling, a.visible, block + 1);
      ask_for_rows<false>(a.anchors.feature, a.visible, block + 1);
      ask_for_rows<true>(a.d_anchors.offset, a.visible, block + 1);
      ask_for_rows<true>(a.d_anchors.feature, a.visible, block + 1);
      filled = append_block(a, block, filled, s);
      if (filled >= L::panel) {
        run_panel(a, L::panel, gradients, s);
        filled -= L::panel;
        move_rest(filled, s);
      }
    }
    if (filled > 0) {
      clear_rest(filled, s);
      run_panel(a, filled, gradients, s);
    }
    for (int o = 0; o < L::outputs; ++o) gradients[L::d_bias2 + o] = reduce_add(P::load(s.d_bias2 + o * W));
  }

  /// Everything of a block that stays in lanes; its anchors with gradient are appended to the panel. Returns the
  /// panel's new fill.
  static int append_block(const Arguments& a, std::size_t block, int filled, Scratch& s) {
    const std::uint32_t* const rows = a.visible.data() + block * 16;
    const std::size_t left = a.visible.size() - block * 16;
    const int valid = left < 16 ? static_cast<int>(left) : 16;
    gather_geometry<T>(a.anchors, rows, valid, s.position, s.scaling);
    gather_transposed<3 * L::offsets, 16, W>(a.anchors.offset, rows, valid, s.offset);
    for (int i = 0; i < 6 * 16; i += W) exp(P::load(s.scaling + i)).store(s.scaling + i);
    for (int i = 0; i < 3 * 16; i += W) (P(T(1)) / P::load(s.scaling + 3 * 16 + i)).store(s.inverse_base + i);
    for (T& value : s.d_geometry) value = T(0);
    unsigned touched = 0;
    std::size_t row = a.block_row[block];
    for (int k = 0; k < L::offsets; ++k) {
      const unsigned lanes = a.mask[block * L::offsets + static_cast<std::size_t>(k)];
      for (int lane = 0; lane < 16; lane += W) {
        const unsigned bits = lanes >> lane & ((1u << W) - 1u);
        if (bits == 0) {
          clear_pack(k, lane, s);
          continue;
        }
        touched |= chain_pack(a, block, k, lane, M::from_bits(bits), row, s).bits() << lane;
        row += static_cast<std::size_t>(__builtin_popcount(bits));
      }
    }
    if (touched == 0) return filled;
    // position: d mean; log scaling: d l * l, l = exp(scaling), and the sum of d scale * scale (already complete)
    for (int i = 0; i < 3; ++i) {
      for (int lane = 0; lane < 16; lane += W) {
        T* const target = s.d_geometry + (3 + i) * 16 + lane;
        (P::load(target) * P::load(s.scaling + i * 16 + lane)).store(target);
      }
    }
    scatter_add_transposed<3 * L::offsets, W>(s.d_offset, rows, touched, a.d_anchors.offset);
    for (unsigned lanes = touched; lanes != 0; lanes &= lanes - 1) {
      const int lane = __builtin_ctz(lanes);
      T* const d_position = a.d_anchors.position.row(rows[lane]);
      T* const d_scaling = a.d_anchors.scaling.row(rows[lane]);
      for (int i = 0; i < 3; ++i) d_position[i] += s.d_geometry[i * 16 + lane];
      for (int i = 0; i < 6; ++i) d_scaling[i] += s.d_geometry[(3 + i) * 16 + lane];
    }
    return append_rows(a, rows, touched, filled, s);
  }

  static COMPMARK_INLINE void clear_pack(int k, int lane, Scratch& s) {
    const P zero(T{});
    zero.store(s.block_output + k * 16 + lane);
    for (int i = 0; i < 7; ++i) zero.store(s.block_output + (L::offsets + 7 * k + i) * 16 + lane);
    for (int i = 0; i < 3; ++i) {
      zero.store(s.block_output + (8 * L::offsets + 3 * k + i) * 16 + lane);
      zero.store(s.d_offset + (3 * k + i) * 16 + lane);
    }
  }

  /// Gaussians (k, W anchors): gradients of the heads' outputs, of offset and of geometry. Returns the lanes with any
  /// gradient at all (a NaN counts as gradient: it must arrive where it is reported).
  static COMPMARK_INLINE M chain_pack(const Arguments& a, std::size_t block, int k, int lane, M mask, std::size_t row,
                                      Scratch& s) {
    const auto take = [&](const T* column) __attribute__((always_inline)) {
      ask_ahead<false>(column + row, L::columns_ahead);
      return P::expand_load(column + row, mask);
    };
    const P d_opacity = take(a.d_gaussians.opacity);
    P size = magnitude(d_opacity);
    const P opacity = P::load(a.opacity + (block * L::offsets + static_cast<std::size_t>(k)) * 16 + lane);
    keep(mask, d_opacity * ((P(T(1)) - opacity) * (P(T(1)) + opacity))).store(s.block_output + k * 16 + lane);
    for (int i = 0; i < 3; ++i) {
      const std::size_t axis = static_cast<std::size_t>(i);
      const P d_color = take(a.d_gaussians.color[axis]);
      const P color = take(a.gaussians.color[axis]);
      (d_color * (color * (P(T(1)) - color))).store(s.block_output + (8 * L::offsets + 3 * k + i) * 16 + lane);

      const P d_scale = take(a.d_gaussians.scale[axis]);
      const P scale = take(a.gaussians.scale[axis]);  // base * fraction, fraction = sigmoid(logit)
      const P fraction = scale * P::load(s.inverse_base + i * 16 + lane);
      const P d_log_scale = d_scale * scale;
      (d_log_scale * (P(T(1)) - fraction)).store(s.block_output + (L::offsets + 7 * k + i) * 16 + lane);
      add(s.d_geometry + (6 + i) * 16 + lane, d_log_scale);

      const P d_mean = take(a.d_gaussians.mean[axis]);
      add(s.d_geometry + i * 16 + lane, d_mean);
      add(s.d_geometry + (3 + i) * 16 + lane, d_mean * P::load(s.offset + (3 * k + i) * 16 + lane));
      (d_mean * P::load(s.scaling + i * 16 + lane)).store(s.d_offset + (3 * k + i) * 16 + lane);
      size += magnitude(d_color) + magnitude(d_scale) + magnitude(d_mean);
    }
    P q[4], d_q[4];
    P radial(T{});
    for (int i = 0; i < 4; ++i) {
      q[i] = take(a.gaussians.rotation[static_cast<std::size_t>(i)]);
      d_q[i] = take(a.d_gaussians.rotation[static_cast<std::size_t>(i)]);
      radial = fma(q[i], d_q[i], radial);
      size += magnitude(d_q[i]);
    }
    const P inverse_norm = take(a.inverse_norm);
    for (int i = 0; i < 4; ++i) {  // only the tangential part passes the normalisation (case QU2)
      (fnma(q[i], radial, d_q[i]) * inverse_norm).store(s.block_output + (L::offsets + 7 * k + 3 + i) * 16 + lane);
    }
    return !(size == P(T{}));
  }
  static COMPMARK_INLINE P magnitude(P x) { return max(x, -x); }  // NaN for NaN
  static COMPMARK_INLINE void add(T* target, P value) { (P::load(target) + value).store(target); }

  /// The touched anchors' output gradients, view and inputs go to rows `filled` … of the panel.
  static int append_rows(const Arguments& a, const std::uint32_t* rows, unsigned touched, int filled, Scratch& s) {
    int next = filled;
    for (int lane = 0; lane < 16; lane += W) {
      const unsigned bits = touched >> lane & ((1u << W) - 1u);
      if (bits == 0) continue;
      const M mask = M::from_bits(bits);
      if (all(mask)) {
        for (int o = 0; o < L::outputs; ++o)
          P::load(s.block_output + o * 16 + lane).store(s.d_output + o * L::panel_capacity + next);
      } else {
        for (int o = 0; o < L::outputs; ++o) {
          P::load(s.block_output + o * 16 + lane).compress_store(s.d_output + o * L::panel_capacity + next, mask);
        }
      }
      const P position[3] = {P::load(s.position + lane), P::load(s.position + 16 + lane),
                             P::load(s.position + 32 + lane)};
      const ViewLanes<T, W> view(a.from, position);
      for (int i = 0; i < 3; ++i) view.direction[i].compress_store(s.view + i * L::panel_capacity + next, mask);
      view.distance.compress_store(s.view + 3 * L::panel_capacity + next, mask);
      const P inverse = P(T(1)) / select(view.regular, view.distance, P(T(1)));
      keep(view.regular, inverse).compress_store(s.view + 4 * L::panel_capacity + next, mask);
      next += __builtin_popcount(bits);
    }
    for (unsigned lanes = touched; lanes != 0; lanes &= lanes - 1) {
      const std::uint32_t anchor = rows[__builtin_ctz(lanes)];
      s.row[filled] = anchor;
      T* const input = s.input + filled * L::input_row;
      const T* const feature = a.anchors.feature.row(anchor);
      if constexpr (shape.feature_bank) {
        typename FeatureBank<T, shape.feature_dim>::Record record;
        FeatureBank<T, shape.feature_dim>::forward(a.bank, bank_view(filled, s).values, feature, input, record);
      } else {
        for (int c = 0; c < L::width; ++c) input[c] = feature[c];
      }
      for (int i = 0; i < L::view_inputs; ++i) input[L::width + i] = s.view[i * L::panel_capacity + filled];
      input[L::inputs] = T(1);
      ++filled;
    }
    return filled;
  }
  struct BankView {
    T values[4];
  };
  static BankView bank_view(int row, const Scratch& s) {
    const auto at = [&](int i) { return s.view[i * L::panel_capacity + row]; };
    return {{at(0), at(1), at(2), at(3)}};
  }

  /// Rows [panel, panel + rest) become rows [0, rest).
  static void move_rest(int rest, Scratch& s) {
    if (rest == 0) return;
    for (int o = 0; o < L::outputs; ++o) {
      T* const line = s.d_output + o * L::panel_capacity;
      for (int i = 0; i < 16; ++i) line[i] = line[L::panel + i];
    }
    for (int o = 0; o < 5; ++o) {
      T* const line = s.view + o * L::panel_capacity;
      for (int i = 0; i < 16; ++i) line[i] = line[L::panel + i];
    }
    for (int i = 0; i < rest; ++i) s.row[i] = s.row[L::panel + i];
    for (int i = 0; i < rest * L::input_row; ++i) s.input[i] = s.input[L::panel * L::input_row + i];
  }
  /// Rows [filled, panel) become zero: they add nothing to any sum.
  static void clear_rest(int filled, Scratch& s) {
    for (int o = 0; o < L::outputs; ++o) {
      for (int i = filled; i < L::panel; ++i) s.d_output[o * L::panel_capacity + i] = T(0);
    }
    for (int i = filled * L::input_row; i < L::panel * L::input_row; ++i) s.input[i] = T(0);
  }

  /// Zero where the hidden unit was not positive.
  struct FinishReluGradient {
    const T* hidden;
    COMPMARK_INLINE P operator()(int row, int column, P sum) const {
      return keep(P::load(hidden + row * L::hidden + column) > P(T{}), sum);
    }
  };

  template <int Head>
  static void run_head(const Arguments& a, T* gradients, Scratch& s) {
    constexpr int first = L::output_begin(Head), count = L::output_count(Head);
    constexpr ProductShape back{L::panel, L::head_hidden, count, 1, L::panel_capacity, L::head_hidden, L::hidden};
    constexpr ProductShape outer{count, L::head_hidden, L::panel, L::panel_capacity, 1, L::hidden, L::head_hidden};
    const T* const d_output = s.d_output + first * L::panel_capacity;
    const T* const hidden = s.hidden + Head * L::head_hidden;
    product<T, W, back>(d_output, a.packed + L::packed_weight2 + first * L::head_hidden,
                        s.d_hidden + Head * L::head_hidden, StartZero<T, W>{}, FinishReluGradient{hidden});
    product<T, W, outer>(d_output, hidden, gradients + L::d_weight2 + first * L::head_hidden, StartAccumulate<T, W>{},
                         FinishLinear<T, W>{});
  }

  static void run_panel(const Arguments& a, int filled, T* gradients, Scratch& s) {
    constexpr ProductShape recompute{L::panel, L::hidden, L::input_row, L::input_row, 1, L::hidden, L::hidden};
    constexpr ProductShape outer{L::input_row, L::hidden, L::panel, 1, L::input_row, L::hidden, L::hidden};
    constexpr ProductShape back{L::panel, L::feature_row, L::hidden, L::hidden, 1, L::feature_row, L::feature_row};
    product<T, W, recompute>(s.input, a.packed + L::packed_weight1, s.hidden, StartZero<T, W>{}, FinishRelu<T, W>{});
    run_head<0>(a, gradients, s);
    run_head<1>(a, gradients, s);
    run_head<2>(a, gradients, s);
    product<T, W, outer>(s.input, s.d_hidden, gradients + L::d_weight1, StartAccumulate<T, W>{}, FinishLinear<T, W>{});
    product<T, W, back>(s.d_hidden, a.packed + L::packed_feature, s.d_feature, StartZero<T, W>{}, FinishLinear<T, W>{});
    for (int o = 0; o < L::outputs; ++o) {
      P sum = P::load(s.d_bias2 + o * W);
      for (int i = 0; i < L::panel; i += W) sum += P::load(s.d_output + o * L::panel_capacity + i);
      sum.store(s.d_bias2 + o * W);
    }
    view_gradient(a, filled, s);
    if constexpr (shape.feature_bank)
      bank_gradient(a, filled, gradients, s);
    else
      feature_gradient(a, filled, s);
    direction_gradient(a, filled, s);
  }

  /// d_view[i, row] = sum over hidden of d_hidden weight1[hidden, D + i].
  static void view_gradient(const Arguments& a, int filled, Scratch& s) {
    for (int i = 0; i < 4 * L::panel; ++i) s.d_view[i] = T(0);
    for (int row = 0; row < filled; ++row) {
      for (int i = 0; i < L::view_inputs; ++i) {
        P sum(T{});
        for (int h = 0; h < L::hidden; h += W) {
          sum = fma(P::load(s.d_hidden + row * L::hidden + h), P::load(a.packed + L::packed_view + i * L::hidden + h),
                    sum);
        }
        s.d_view[i * L::panel + row] = reduce_add(sum);
      }
    }
  }

  static void feature_gradient(const Arguments& a, int filled, const Scratch& s) {
    for (int row = 0; row < filled; ++row) {
      T* const target = a.d_anchors.feature.row(s.row[row]);
      for (int c = 0; c < L::width; ++c) target[c] += s.d_feature[row * L::feature_row + c];
    }
  }

  static void bank_gradient(const Arguments& a, int filled, T* gradients, Scratch& s) {
    using Bank = FeatureBank<T, shape.feature_dim>;
    for (int row = 0; row < filled; ++row) {
      const BankView view = bank_view(row, s);
      const T* const feature = a.anchors.feature.row(s.row[row]);
      T mixed[L::width];
      T d_view[4] = {};
      typename Bank::Record record;
      Bank::forward(a.bank, view.values, feature, mixed, record);
      Bank::backward(a.bank, view.values, feature, record, s.d_feature + row * L::feature_row, gradients + L::d_bank,
                     d_view, a.d_anchors.feature.row(s.row[row]));
      for (int i = 0; i < 4; ++i) s.d_view[i * L::panel + row] += d_view[i];
    }
  }

  /// Through direction = v / |v| and distance = |v|: (g - d (d g)) / |v| + g_distance d; nothing at the camera (case
  /// PR9).
  static void direction_gradient(const Arguments& a, int filled, Scratch& s) {
    for (int first = 0; first < L::panel; first += W) {
      const auto view = [&](int i) __attribute__((always_inline)) {
        return P::load(s.view + i * L::panel_capacity + first);
      };
      const auto slope = [&](int i) __attribute__((always_inline)) { return P::load(s.d_view + i * L::panel + first); };
      const P inverse = view(4);
      P radial(T{});
      for (int i = 0; i < 3; ++i) radial = fma(view(i), slope(i), radial);
      const P along = keep(inverse > P(T{}), slope(3));
      for (int i = 0; i < 3; ++i) {
        fma(fnma(view(i), radial, slope(i)), inverse, along * view(i)).store(s.d_view + i * L::panel + first);
      }
    }
    for (int row = 0; row < filled; ++row) {
      T* const target = a.d_anchors.position.row(s.row[row]);
      for (int i = 0; i < 3; ++i) target[i] += s.d_view[i * L::panel + row];
    }
  }
};

}  // namespace compmark::detail
