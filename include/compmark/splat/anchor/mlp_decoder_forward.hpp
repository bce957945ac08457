// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Forward kernels of the fused decoder (docs/spec/method.md, 1.5). Lanes are anchors. Pass 1 runs the opacity head and
// finds which Gaussians exist; after a prefix sum pass 2 runs the other heads and writes each Gaussian to its final
// row. Cost an anchor: 2 (D + 3) 3 D + 2 D 11 K operations (13.8 k for D = 32, K = 10), 14 K exponentials.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "compmark/core/gaussians.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/mlp_decoder_layout.hpp"

namespace compmark::detail {

/// One worker's memory in the forward pass.
template <class T, int W, DecoderShape shape>
struct DecodeForwardScratch {
  using L = DecoderLayout<T, W, shape>;
  alignas(64) T input[L::inputs * L::panel];
  alignas(64) T hidden[L::width * L::panel];
  alignas(64) T output[10 * L::offsets * L::panel];
  alignas(64) T position[3 * L::block];
  alignas(64) T scaling[6 * L::block];
  alignas(64) T offset[3 * L::offsets * L::block];
  alignas(64) T tail[15 * L::block];  // a pack that would reach into the next chunk's rows
};

/// What the two passes read and write, apart from scratch. Pointers are the beginnings of whole arrays.
template <class T, DecoderShape shape>
struct ForwardArguments {
  AnchorColumns<const T> anchors;
  std::span<const std::uint32_t> visible;
  ViewPoint<T> from;
  DecoderParams<const T, shape> params;
  const T* color_bias1;            // [D], with the view's appearance folded in
  const T* bank;                   // feature bank parameters in one piece; null without it
  T* opacity;                      // [blocks, K, 16] tanh of the opacity head
  std::uint16_t* mask;             // [blocks, K] which lanes are Gaussians
  T* opacity_sum;                  // [blocks, 16]
  std::uint32_t* block_count;      // [blocks] Gaussians of the block (pass 1)
  std::uint32_t* block_bad;        // [blocks] anchors with a non-finite input or a NaN opacity (pass 1)
  const std::uint32_t* block_row;  // [blocks + 1] first row of the block (pass 2)
  GaussianColumns<T> out;          // (pass 2)
  T* inverse_norm;                 // [P] 1 / norm of the quaternion logits, 0 where they have no direction (pass 2)
  std::uint32_t* slot;             // [P] (pass 2)
};

template <class T, int W, DecoderShape shape>
struct ForwardKernels {
  using L = DecoderLayout<T, W, shape>;
  using P = Pack<T, W>;
  using M = Mask<T, W>;
  using Arguments = ForwardArguments<T, shape>;
  using Scratch = DecodeForwardScratch<T, W, shape>;

  static int valid_lanes(std::size_t visible, std::size_t block) {
    const std::size_t left = visible - block * 16;
    return left < 16 ? static_cast<int>(left) : 16;
  }

  /// Inputs of the heads of one block into lanes 16 slot … of the panel.
  static void load_inputs(const Arguments& a, std::size_t block, int slot, Scratch& s) {
    const std::uint32_t* const rows = a.visible.data() + block * 16;
    const int valid = valid_lanes(a.visible.size(), block);
    T* const input = s.input + slot * 16;
    if constexpr (!shape.feature_bank) gather_transposed<L::width, L::panel, W>(a.anchors.feature, rows, valid, input);
    gather_geometry<T>(a.anchors, rows, valid, s.position, nullptr);
    alignas(64) T view[4][16];
    for (int lane = 0; lane < 16; lane += W) {
      const P position[3] = {P::load(s.position + lane), P::load(s.position + 16 + lane),
                             P::load(s.position + 32 + lane)};
      const ViewLanes<T, W> lanes(a.from, position);
      for (int i = 0; i < 3; ++i) lanes.direction[i].store(view[i] + lane);
      lanes.distance.store(view[3] + lane);
    }
    for (int i = 0; i < L::view_inputs; ++i) {
      for (int lane = 0; lane < 16; ++lane) input[(L::width + i) * L::panel + lane] = view[i][lane];
    }
    if constexpr (shape.feature_bank) {
      using Bank = FeatureBank<T, shape.feature_dim>;
      for (int lane = 0; lane < 16; ++lane) {
        T mixed[L::width] = {};
        if (lane < valid) {
          const T direction_distance[4] = {view[0][lane], view[1][lane], view[2][lane], view[3][lane]};
          typename Bank::Record record;
          Bank::forward(a.bank, direction_distance, a.anchors.feature.row(rows[lane]), mixed, record);
        }
        for (int c = 0; c < L::width; ++c) input[c * L::panel + lane] = mixed[c];
      }
    }
  }
  static void clear_inputs(int slot, Scratch& s) {
    for (int i = 0; i < L::inputs; ++i) {
      for (int lane = 0; lane < 16; ++lane) s.input[i * L::panel + slot * 16 + lane] = T(0);
    }
  }

  template <int Inputs, int Outputs>
  static void head(const HeadViews<const T>& head, const T* bias1, const Scratch& s, T* hidden, T* output) {
    constexpr ProductShape first{L::width, L::panel, L::inputs, Inputs, 1, L::panel, L::panel};
    constexpr ProductShape second{Outputs, L::panel, L::width, L::width, 1, L::panel, L::panel};
    product<T, W, first>(head.weight1.data, s.input, hidden, StartBias<T, W>{bias1}, FinishRelu<T, W>{});
    product<T, W, second>(head.weight2.data, hidden, output, StartBias<T, W>{head.bias2.data}, FinishLinear<T, W>{});
  }

  /// Pass 1 over blocks [begin, end).
  static void find_gaussians(const Arguments& a, std::size_t begin, std::size_t end, Scratch& s) {
    for (std::size_t first = begin; first < end; first += 4) {
      for (int slot = 0; slot < 4; ++slot) {
        if (first + static_cast<std::size_t>(slot) < end) {
          ask_for_rows<false>(a.anchors.feature, a.visible, first + static_cast<std::size_t>(slot) + 4);
          ask_for_rows<false>(a.anchors.position, a.visible, first + static_cast<std::size_t>(slot) + 4);
          load_inputs(a, first + static_cast<std::size_t>(slot), slot, s);
        } else {
          clear_inputs(slot, s);
        }
      }
      head<shape.head_inputs(), L::offsets>(a.params.opacity, a.params.opacity.bias1.data, s, s.hidden, s.output);
      for (int slot = 0; slot < 4 && first + static_cast<std::size_t>(slot) < end; ++slot) {
        write_opacity(a, first + static_cast<std::size_t>(slot), slot, s);
      }
    }
  }

  static void write_opacity(const Arguments& a, std::size_t block, int slot, const Scratch& s) {
    const int valid = valid_lanes(a.visible.size(), block);
    std::uint16_t* const mask = a.mask + block * L::offsets;
    for (int k = 0; k < L::offsets; ++k) mask[k] = 0;
    std::uint32_t gaussians = 0;
    std::uint32_t bad = 0;
    for (int lane = 0; lane < 16; lane += W) {
      // An input that is not finite gives no Gaussians and is counted (docs/spec/numerics.md, ML4).
      P zero(T{});
      for (int i = 0; i < L::inputs; ++i) zero = fma(P::load(s.input + i * L::panel + slot * 16 + lane), P(T{}), zero);
      const M real = M::first(valid - lane);
      const M finite = (zero == P(T{})) & real;
      M decoded = finite;  // and no opacity is NaN: a NaN of the networks drops Gaussians, which must not go unseen
      P sum(T{});
      for (int k = 0; k < L::offsets; ++k) {
        const P opacity = tanh(P::load(s.output + k * L::panel + slot * 16 + lane));
        const M positive = (opacity > P(T{})) & finite;
        decoded = decoded & (opacity == opacity);
        opacity.store(a.opacity + (block * L::offsets + static_cast<std::size_t>(k)) * 16 + lane);
        sum += keep(positive, opacity);
        mask[k] = static_cast<std::uint16_t>(mask[k] | positive.bits() << lane);
        gaussians += static_cast<std::uint32_t>(count(positive));
      }
      bad += static_cast<std::uint32_t>(count(real) - count(decoded));
      sum.store(a.opacity_sum + block * 16 + lane);
    }
    a.block_count[block] = gaussians;
    a.block_bad[block] = bad;
  }

  /// Pass 2 over blocks [begin, end): panels of blocks that have Gaussians.
  static void write_gaussians(const Arguments& a, std::size_t begin, std::size_t end, Scratch& s) {
    const std::size_t last_row = a.block_row[end];
    for (std::size_t block = begin; block < end;) {
      std::size_t members[4];
      int count = 0;
      for (; block < end && count < 4; ++block) {
        if (a.block_row[block] == a.block_row[block + 1]) continue;
        load_inputs(a, block, count, s);
        ask_for_rows<false>(a.anchors.offset, a.visible, block);
        ask_for_rows<false>(a.anchors.scaling, a.visible, block);
        members[count++] = block;
      }
      if (count == 0) return;
      for (int slot = count; slot < 4; ++slot) clear_inputs(slot, s);
      head<shape.head_inputs(), 7 * L::offsets>(a.params.covariance, a.params.covariance.bias1.data, s, s.hidden,
                                                s.output);
      head<shape.color_inputs(), 3 * L::offsets>(a.params.color, a.color_bias1, s, s.hidden,
                                                 s.output + 7 * L::offsets * L::panel);
      for (int slot = 0; slot < count; ++slot) write_block(a, members[slot], slot, last_row, s);
    }
  }

  static void write_block(const Arguments& a, std::size_t block, int slot, std::size_t last_row, Scratch& s) {
    const std::uint32_t* const rows = a.visible.data() + block * 16;
    const int valid = valid_lanes(a.visible.size(), block);
    gather_geometry<T>(a.anchors, rows, valid, s.position, s.scaling);
    gather_transposed<3 * L::offsets, 16, W>(a.anchors.offset, rows, valid, s.offset);
    for (int i = 0; i < 6 * 16; i += W) exp(P::load(s.scaling + i)).store(s.scaling + i);
    std::size_t row = a.block_row[block];
    for (int k = 0; k < L::offsets; ++k) {
      const unsigned lanes = a.mask[block * L::offsets + static_cast<std::size_t>(k)];
      if (lanes == 0) continue;
      for (int lane = 0; lane < 16; lane += W) {
        const unsigned bits = lanes >> lane & ((1u << W) - 1u);
        if (bits == 0) continue;
        const int gaussians = __builtin_popcount(bits);
        if (row + W <= last_row) {  // the scratch behind the last value is overwritten by this chunk's next rows
          write_pack(a, block, k, slot, lane, M::from_bits(bits), columns_at(a, row), s);
        } else {
          write_pack(a, block, k, slot, lane, M::from_bits(bits), tail_columns(s), s);
          const Columns from = tail_columns(s), to = columns_at(a, row);
          for (std::size_t column = 0; column < from.size(); ++column) std::copy_n(from[column], gaussians, to[column]);
        }
        std::uint32_t* const slots = a.slot + row;
        int next = 0;
        for (unsigned left = bits; left != 0; left &= left - 1) {
          slots[next++] =
              rows[lane + __builtin_ctz(left)] * static_cast<std::uint32_t>(L::offsets) + static_cast<std::uint32_t>(k);
        }
        row += static_cast<std::size_t>(gaussians);
      }
    }
  }

  /// Where a pack of Gaussians goes: mean 3, scale 3, rotation 4, opacity, color 3, inverse norm.
  using Columns = std::array<T*, 15>;
  static COMPMARK_INLINE Columns columns_at(const Arguments& a, std::size_t row) {
    Columns to;
    for (std::size_t i = 0; i < 3; ++i) {
      to[i] = a.out.mean[i] + row;
      to[3 + i] = a.out.scale[i] + row;
      to[11 + i] = a.out.color[i] + row;
    }
    for (std::size_t i = 0; i < 4; ++i) to[6 + i] = a.out.rotation[i] + row;
    to[10] = a.out.opacity + row;
    to[14] = a.inverse_norm + row;
    return to;
  }
  static Columns tail_columns(Scratch& s) {
    Columns to;
    for (std::size_t i = 0; i < to.size(); ++i) to[i] = s.tail + i * L::block;
    return to;
  }

  static COMPMARK_INLINE void write_pack(const Arguments& a, std::size_t block, int k, int slot, int lane, M mask,
                                         const Columns& to, const Scratch& s) {
    const auto put = [&](int column, P value) __attribute__((always_inline)) {
      ask_ahead<true>(to[static_cast<std::size_t>(column)], L::columns_ahead);
      value.compress_store(to[static_cast<std::size_t>(column)], mask);
    };
    const T* const covariance = s.output + 7 * k * L::panel + slot * 16 + lane;
    const T* const color = s.output + (7 * L::offsets + 3 * k) * L::panel + slot * 16 + lane;
    put(10, P::load(a.opacity + (block * L::offsets + static_cast<std::size_t>(k)) * 16 + lane));
    P logistic[6];
    for (int i = 0; i < 3; ++i) {
      logistic[i] = P::load(covariance + i * L::panel);
      logistic[3 + i] = P::load(color + i * L::panel);
    }
    sigmoid_of_six(logistic);
    for (int i = 0; i < 3; ++i) {
      const P scale = P::load(s.scaling + i * 16 + lane);
      const P base = P::load(s.scaling + (3 + i) * 16 + lane);
      put(i, fma(P::load(s.offset + (3 * k + i) * 16 + lane), scale, P::load(s.position + i * 16 + lane)));
      put(3 + i, base * logistic[i]);
      put(11 + i, logistic[3 + i]);
    }
    // Unit quaternion of any finite vector: scaled by its largest component; identity without a direction (case QU1).
    P q[4];
    for (int i = 0; i < 4; ++i) q[i] = P::load(covariance + (3 + i) * L::panel);
    const P largest = max(max(magnitude(q[0]), magnitude(q[1])), max(magnitude(q[2]), magnitude(q[3])));
    const M directed = !(largest < P(quaternion_floor));  // a NaN passes and is culled by the rasterizer
    const P shrink = P(T(1)) / select(directed, largest, P(T(1)));
    for (P& x : q) x = x * shrink;
    const P norm = select(directed, sqrt(fma(q[0], q[0], fma(q[1], q[1], fma(q[2], q[2], q[3] * q[3])))), P(T(1)));
    const P inverse = P(T(1)) / norm;
    for (int i = 0; i < 4; ++i) {
      put(6 + i, select(directed, q[i] * inverse, P(T(i == 0 ? 1 : 0))));
    }
    put(14, keep(directed, inverse * shrink));
  }

  static COMPMARK_INLINE P magnitude(P x) { return max(x, -x); }

  /// 1 / (1 + exp(-x)) of six packs with one division: every denominator is in [1, 2], their product in [1, 64].
  /// Divisions were a fifth of the time of this pass. Relative error 4e-7 in float.
  static COMPMARK_INLINE void sigmoid_of_six(P (&x)[6]) {
    P denominator[6], product_before[6];
    P numerator[6];
    P all(T(1));
    for (int i = 0; i < 6; ++i) {
      const P e = exp(-magnitude(x[i]));
      numerator[i] = select(x[i] < P(T{}), e, P(T(1)));
      denominator[i] = P(T(1)) + e;
      product_before[i] = all;
      all = all * denominator[i];
    }
    P inverse = P(T(1)) / all;  // of the product of the first i + 1 denominators, walking down
    for (int i = 5; i >= 0; --i) {
      x[i] = numerator[i] * (inverse * product_before[i]);
      inverse = inverse * denominator[i];
    }
  }

  /// Below it a quaternion has no direction: the smallest normal number, doubled so that its reciprocal is finite.
  static constexpr T quaternion_floor = T(2) * std::numeric_limits<T>::min();
};

}  // namespace compmark::detail
