// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The gradient of blending (docs/spec/numerics.md, BB1), one cell of 16 x 16 pixels at a time, chunks of 256 splats
// from the back:
//   1. front to back, each block recomputes alpha and the blend weight w of the splats that blended in it and keeps
//     both in scratch;
//   2. back to front, splat by splat: with d = dot(colour, dL/dC) and A = dot(what lies behind, dL/dC), one scalar a
//     pixel,
//        dL/dalpha = T (d - A),  dlnalpha: g = w (d - A),  A <- A + alpha (d - A),  A starts with the background.
// No division, no separate background term; where all colours equal the background d - A is exactly 0. Because the dot
// product is linear, carrying dot(behind, dL/dC) instead of the colour behind saves six instructions of nine.
//
// The sums of SplatGradient are kept in registers over the blocks of a cell: relative to the middle of the block, where
// w and d_b are scalars, so six multiply-adds do; the offsets inside the block are added once a cell. Then one
// transposing reduction writes the record.
#pragma once

#include <array>
#include <span>
#include <utility>

#include "compmark/splat/raster/tile_forward.hpp"

namespace compmark::detail {

/// Scratch of one worker, ~0.6 MB in float: stays in the second-level cache.
template <Accuracy accuracy, class T>
struct BackwardScratch {
  static constexpr int kept = stores_chain<accuracy> ? 3 : 2;
  CellSplat<T> splats[chunk_splats + 1];  // the last one is the padding of BlockList
  ReachBits reach;
  alignas(64) T image_gradient[3][cell_blocks][block_pixels];
  alignas(64) T alpha_gradient[cell_blocks][block_pixels];
  alignas(64) T depth_gradient[cell_blocks][block_pixels];
  alignas(64) T behind[cell_blocks][block_pixels];
  alignas(64) T pixel[cell_blocks][chunk_splats + 1][kept][block_pixels];  // weight, alpha and, where needed, chain
};

/// Step 1 for one block.
template <Accuracy accuracy, int W, class T>
inline void recompute_block(const std::uint64_t (&blended)[chunk_words], std::size_t words, int block,
                            const T (&start)[block_pixels], BackwardScratch<accuracy, T>& scratch) {
  using P = Pack<T, W>;
  constexpr int packs = block_pixels / W;
  const T* x_at = cell_table<T>.at[0][block];
  const T* y_at = cell_table<T>.at[1][block];
  std::array<P, packs> x, y, transmittance;
  for (int j = 0; j < packs; ++j) {
    const auto at = static_cast<std::size_t>(j);
    x[at] = P::load(x_at + j * W);
    y[at] = P::load(y_at + j * W);
    transmittance[at] = P::load(start + j * W);
  }
  const BlockList list(blended, words);
  for (std::size_t next = 0; next < list.size; next += step_splats) {
    std::array<const CellSplat<T>*, step_splats> splat;
    for (std::size_t i = 0; i < step_splats; ++i) splat[i] = scratch.splats + list.index[next + i];
    for (int j = 0; j < packs; ++j) {
      const auto at = static_cast<std::size_t>(j);
      const InStep<P, step_splats> raw = raw_alpha<accuracy, step_splats, T, W>(splat, x[at], y[at], x_at + j * W);
      for (std::size_t i = 0; i < step_splats; ++i) {
        auto& pixel = scratch.pixel[block][list.index[next + i]];
        const Blend<T, W> result = blend<accuracy, stores_chain<accuracy>>(raw.part[i], transmittance[at]);
        result.weight.store(pixel[0] + j * W);
        result.alpha.store(pixel[1] + j * W);
        if constexpr (stores_chain<accuracy>) result.chain.store(pixel[2] + j * W);
      }
    }
  }
}

/// Lane of a pair's record that holds sum i, in the order of SplatGradient: what the reduction below leaves.
inline constexpr std::array<std::size_t, 10> record_lane{0, 8, 4, 12, 2, 10, 6, 14, 1, 9};

/// Half a step of the reduction: lanes without `bit` hold the sums of a over pairs of lanes that differ in that bit,
/// lanes with it those of b.
template <std::size_t bit, class P, std::size_t... lane>
[[nodiscard]] COMPMARK_INLINE P fold_two(P a, P b, std::index_sequence<lane...> /*lanes*/) {
  constexpr std::size_t W = P::width;
  const auto straight = __builtin_shufflevector(a.native, b.native, ((lane & bit) == 0 ? lane : W + lane)...);
  const auto crossed =
      __builtin_shufflevector(a.native, b.native, ((lane & bit) == 0 ? lane + bit : W + lane - bit)...);
  return P::from_native(straight + crossed);
}
template <std::size_t bit, class P, std::size_t... lane>
[[nodiscard]] COMPMARK_INLINE P fold_one(P a, std::index_sequence<lane...> /*lanes*/) {
  return P::from_native(a.native + __builtin_shufflevector(a.native, a.native, (lane ^ bit)...));
}

/// More bytes of records than this are written past the caches: they are next read, in another order, when all of them
/// are written.
inline constexpr std::size_t streaming_records = (std::size_t{8} << 20) / 64;

/// Sums over all lanes of ten packs: record[record_lane[i]] = the sum of sums[i], other elements are of no use. At W =
/// 16 the packs are folded into one: 11 additions and 19 shuffles in place of 40 and 40.
/// `streaming`: see Pack::store_streaming.
template <class T, int W>
COMPMARK_INLINE void reduce_columns(const std::array<Pack<T, W>, 10>& sums, T* record, bool streaming) {
  if constexpr (W == 16) {
    using Lanes = std::make_index_sequence<16>;
    using P = Pack<T, W>;
    const P a = fold_two<8>(sums[0], sums[1], Lanes{}), b = fold_two<8>(sums[2], sums[3], Lanes{}),
            c = fold_two<8>(sums[4], sums[5], Lanes{}), d = fold_two<8>(sums[6], sums[7], Lanes{}),
            e = fold_two<8>(sums[8], sums[9], Lanes{});
    const P ab = fold_two<4>(a, b, Lanes{}), cd = fold_two<4>(c, d, Lanes{}), ee = fold_one<4>(e, Lanes{});
    const P all = fold_two<1>(fold_two<2>(ab, cd, Lanes{}), fold_one<2>(ee, Lanes{}), Lanes{});
    if (streaming) {
      all.store_streaming(record);
    } else {
      all.store(record);
    }
  } else {
    for (std::size_t i = 0; i < 16; ++i) record[i] = T(0);
    for (std::size_t i = 0; i < 10; ++i) record[record_lane[i]] = reduce_add(sums[i]);
  }
}

/// Step 2 for one splat: adds into nothing, overwrites `record` with the sums over the blocks of `mask` (in whitened
/// units).
template <Accuracy accuracy, RasterOutputs outputs, int W, class T>
COMPMARK_INLINE void gradient_of_splat(std::size_t k, unsigned mask, BackwardScratch<accuracy, T>& scratch, T* record,
                                       bool streaming) {
  using P = Pack<T, W>;
  constexpr int packs = block_pixels / W;
  const CellTable<T>& table = cell_table<T>;
  const CellSplat<T>& splat = scratch.splats[k];
  const int pivot = splat.axis == 0 ? 0 : 1;
  // w and b at the middle of each block, and their products.
  alignas(64) T middle[5][cell_blocks];
  for (int j = 0; j < cell_blocks; j += W) {
    const P w =
        fma(P::load(table.middle[0] + j), P(splat.wx), fma(P::load(table.middle[1] + j), P(splat.wy), P(splat.w0)));
    const P b = fma(P::load(table.middle[pivot] + j), P(splat.bd), P(splat.b0));
    w.store(middle[0] + j);
    b.store(middle[1] + j);
    (w * w).store(middle[2] + j);
    (w * b).store(middle[3] + j);
    (b * b).store(middle[4] + j);
  }
  const P zero(T(0)), red(splat.red), green(splat.green), blue(splat.blue), depth(splat.depth);
  std::array<P, packs> g0, gw, gb, gww, gwb, gbb;
  g0.fill(zero);
  gw.fill(zero);
  gb.fill(zero);
  gww.fill(zero);
  gwb.fill(zero);
  gbb.fill(zero);
  P sum_red(zero), sum_green(zero), sum_blue(zero), sum_depth(zero);
  for (unsigned bits = mask; bits != 0; bits &= bits - 1) {
    const int block = std::countr_zero(bits);
    for (int j = 0; j < packs; ++j) {
      const auto at = static_cast<std::size_t>(j);
      const P weight = P::load(scratch.pixel[block][k][0] + j * W), alpha = P::load(scratch.pixel[block][k][1] + j * W);
      const P d_red = P::load(scratch.image_gradient[0][block] + j * W),
              d_green = P::load(scratch.image_gradient[1][block] + j * W),
              d_blue = P::load(scratch.image_gradient[2][block] + j * W);
      P here = fma(red, d_red, fma(green, d_green, blue * d_blue));
      if constexpr (outputs.depth) {
        const P d_depth = P::load(scratch.depth_gradient[block] + j * W);
        here = fma(depth, d_depth, here);
        sum_depth = fma(weight, d_depth, sum_depth);
      }
      if constexpr (outputs.alpha) here += P::load(scratch.alpha_gradient[block] + j * W);
      const P behind = P::load(scratch.behind[block] + j * W);
      const P difference = here - behind;
      fma(alpha, difference, behind).store(scratch.behind[block] + j * W);
      P g;
      if constexpr (stores_chain<accuracy>) {
        g = P::load(scratch.pixel[block][k][2] + j * W) * difference;
      } else {
        g = keep(alpha < P(static_cast<T>(accuracy.alpha_max)),
                 weight * difference);  // the clamp stops the gradient (case BF3)
      }
      g0[at] += g;
      gw[at] = fma(g, P(middle[0][block]), gw[at]);
      gb[at] = fma(g, P(middle[1][block]), gb[at]);
      gww[at] = fma(g, P(middle[2][block]), gww[at]);
      gwb[at] = fma(g, P(middle[3][block]), gwb[at]);
      gbb[at] = fma(g, P(middle[4][block]), gbb[at]);
      sum_red = fma(weight, d_red, sum_red);
      sum_green = fma(weight, d_green, sum_green);
      sum_blue = fma(weight, d_blue, sum_blue);
    }
  }
  // From the middles of the blocks to the pixels: w = middle + w_in, b = middle + b_in, the same for every block.
  std::array<P, 10> sums{zero, zero, zero, zero, zero, zero, sum_red, sum_green, sum_blue, sum_depth};
  for (int j = 0; j < packs; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const P w_in = fma(P::load(table.lane[0] + j * W), P(splat.wx), P::load(table.lane[1] + j * W) * P(splat.wy));
    const P b_in = P::load(table.lane[pivot] + j * W) * P(splat.bd);
    const P w = fma(w_in, g0[at], gw[at]), b = fma(b_in, g0[at], gb[at]);
    sums[0] += g0[at];
    sums[1] += w;
    sums[2] += b;
    sums[3] += fma(w_in, gw[at] + w, gww[at]);
    sums[4] += fma(w_in, b, fma(b_in, gw[at], gwb[at]));
    sums[5] += fma(b_in, gb[at] + b, gbb[at]);
  }
  reduce_columns<T, W>(sums, record, streaming);
}

/// Gradients of the planes; alpha and depth may be null (zero).
template <class T>
struct BackwardPlanes {
  ImageView<const T> image;
  const T* alpha = nullptr;
  const T* depth = nullptr;
};

/// Gradients of one cell's pixels, and the background seen through them.
template <Accuracy accuracy, RasterOutputs outputs, int W, class T>
inline void load_gradients(const CellPlace& place, const std::array<T, 3>& background, const BackwardPlanes<T>& planes,
                           BackwardScratch<accuracy, T>& scratch) {
  for (int c = 0; c < 3; ++c) load_cell(planes.image.plane(c), place, scratch.image_gradient[c]);
  if constexpr (outputs.alpha) {
    if (planes.alpha != nullptr) {
      load_cell(planes.alpha, place, scratch.alpha_gradient);
    } else {
      std::memset(scratch.alpha_gradient, 0, sizeof(scratch.alpha_gradient));
    }
  }
  if constexpr (outputs.depth) {
    if (planes.depth != nullptr) {
      load_cell(planes.depth, place, scratch.depth_gradient);
    } else {
      std::memset(scratch.depth_gradient, 0, sizeof(scratch.depth_gradient));
    }
  }
  for (int b = 0; b < cell_blocks; ++b) {
    for (int j = 0; j < block_pixels; j += W) {
      using P = Pack<T, W>;
      const P d_red = P::load(scratch.image_gradient[0][b] + j), d_green = P::load(scratch.image_gradient[1][b] + j),
              d_blue = P::load(scratch.image_gradient[2][b] + j);
      // The same operations in the same order as `here` in gradient_of_splat, so that equal colours cancel exactly.
      fma(P(background[0]), d_red, fma(P(background[1]), d_green, P(background[2]) * d_blue))
          .store(scratch.behind[b] + j);
    }
  }
}

/// One cell: for each entry of the list, the sums of its pixels go to the entry's record (added to it when `add`), in
/// the order and the units of the pixel loop: see record_lane. `streaming`: the records are written past the caches
/// (only where the tile is one cell).
template <Accuracy accuracy, RasterOutputs outputs, int W, class T>
inline void backward_cell(std::span<const WhiteSplat<T>> splats, std::span<const std::uint32_t> list,
                          std::span<const std::uint32_t> upcoming, const CellPlace& place,
                          const std::array<T, 3>& background, const BackwardPlanes<T>& planes,
                          const ChunkRecord<T>* chunks, std::size_t opened, bool add, bool streaming,
                          SplatGradient<T>* records, BackwardScratch<accuracy, T>& scratch) {
  for (int c = 0; c < 3; ++c) prefetch_cell<false>(planes.image.plane(c), place);
  scratch.splats[chunk_splats] = CellSplat<T>{};
  const T cell_x = static_cast<T>(place.x), cell_y = static_cast<T>(place.y);
  const auto clear = [&](std::size_t entry) {
    if (!add) records[entry] = SplatGradient<T>{};
  };
  for (std::size_t entry = opened * chunk_splats; entry < list.size(); ++entry) clear(entry);
  for (std::size_t chunk = opened; chunk-- > 0;) {
    const std::size_t first = chunk * chunk_splats, count = std::min(chunk_splats, list.size() - first),
                      words = (count + 63) / 64;
    const ChunkRecord<T>& record = chunks[chunk];
    std::memcpy(scratch.reach.word, record.blended, sizeof(record.blended));
    scratch.reach.by_splat(count);
    for (std::size_t k = 0; k < count; ++k) {
      if (k + splats_in_flight < count) __builtin_prefetch(&splats[list[first + k + splats_in_flight]]);
      if ((scratch.reach.low[k] | scratch.reach.high[k]) != 0)
        to_cell(splats[list[first + k]], cell_x, cell_y, scratch.splats[k]);
    }
    const std::span<const std::uint32_t> following =
        chunk > 0 ? list.subspan(first - chunk_splats, chunk_splats) : upcoming;
    for (int b = 0; b < cell_blocks; ++b) {
      prefetch_share(splats, following, b);
      recompute_block<accuracy, W>(record.blended[b], words, b, record.transmittance[b], scratch);
    }
    if (chunk + 1 == opened) load_gradients<accuracy, outputs, W>(place, background, planes, scratch);
    for (std::size_t k = count; k-- > 0;) {
      const unsigned mask = scratch.reach.low[k] | static_cast<unsigned>(scratch.reach.high[k]) << 8;
      if (mask == 0) {
        clear(first + k);
        continue;
      }
      T* const target = &records[first + k].g;
      if (add) {
        alignas(64) T sums[16];
        gradient_of_splat<accuracy, outputs, W>(k, mask, scratch, sums, false);
        for (std::size_t i = 0; i < 16; ++i) target[i] += sums[i];
      } else {
        gradient_of_splat<accuracy, outputs, W>(k, mask, scratch, target, streaming);
      }
    }
  }
  if (streaming) streaming_fence();
}

}  // namespace compmark::detail
