// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Blending front to back (docs/spec/method.md, 2.3), one cell of 16 x 16 pixels at a time. The list is worked on in
// chunks of 256 splats: first every splat is tested against the 16 blocks of the cell, then each block walks the splats
// that reach it with transmittance and colour in registers: ~22 instructions per block and splat, no branch but the
// loop's. A block stops when all its pixels are finished.
//
// Backward finds in the context the transmittance at the start of each chunk (4 bytes a pair) and which splats did
// blend in which block (2 bits a pair): it neither tests nor searches again.
#pragma once

#include <array>
#include <span>

#include "compmark/splat/raster/outputs.hpp"
#include "compmark/splat/raster/tile_block.hpp"
#include "compmark/splat/raster/tile_cell.hpp"
#include "compmark/splat/raster/tile_reach.hpp"

namespace compmark::detail {

/// Scratch of one worker, ~40 KB in float.
template <class T>
struct ForwardScratch {
  CellSplat<T> splats[chunk_splats + 1];  // the last one is the padding of BlockList
  ReachBits reach;
  alignas(64) T transmittance[cell_blocks][block_pixels];
  alignas(64) T color[3][cell_blocks][block_pixels];
  alignas(64) T depth[cell_blocks][block_pixels];
};

/// What forward keeps for backward, chunk by chunk of one cell.
template <class T>
struct ChunkRecord {
  alignas(64) T transmittance[cell_blocks][block_pixels];       // before the chunk
  alignas(64) std::uint64_t blended[cell_blocks][chunk_words];  // as ReachBits::word, until the block was finished
};

inline constexpr std::size_t splats_in_flight = 16;

/// Localises the splats of one chunk and finds the blocks they reach, of those in `open`.
template <int W, class T>
inline void open_chunk(std::span<const WhiteSplat<T>> splats, std::span<const std::uint32_t> list,
                       const CellPlace& place, unsigned open, CellSplat<T>* local, ReachBits& reach) {
  const T cell_x = static_cast<T>(place.x), cell_y = static_cast<T>(place.y);
  for (std::size_t k = 0; k < list.size(); ++k) {
    // Of use for the first tile of a worker's run; the others were asked for by prefetch_share.
    if (k + splats_in_flight < list.size()) __builtin_prefetch(&splats[list[k + splats_in_flight]]);
    const WhiteSplat<T>& splat = splats[list[k]];
    const unsigned mask = blocks_reached<W>(splat, cell_x, cell_y) & open;
    reach.low[k] = static_cast<std::uint8_t>(mask);
    reach.high[k] = static_cast<std::uint8_t>(mask >> 8);
    to_cell(splat, cell_x, cell_y, local[k]);
  }
}

/// Asks for a sixteenth of the splats that this worker takes next, while the present ones are computed. They lie all
/// over the memory, and waiting for them was a third of the time at 500,000 splats.
template <class T>
COMPMARK_INLINE void prefetch_share(std::span<const WhiteSplat<T>> splats, std::span<const std::uint32_t> upcoming,
                                    int block) {
  const std::size_t count = std::min(upcoming.size(), chunk_splats), share = (count + cell_blocks - 1) / cell_blocks;
  const std::size_t start = static_cast<std::size_t>(block) * share;
  for (std::size_t k = start; k < std::min(start + share, count); ++k) __builtin_prefetch(&splats[upcoming[k]]);
}

/// One block through one chunk. `blended` gets the bits of the splats that were met before the block was finished.
/// Returns whether it was.
template <Accuracy accuracy, RasterOutputs outputs, int W, class T>
inline bool forward_block(const CellSplat<T>* splats, const std::uint64_t (&reached)[chunk_words], std::size_t words,
                          int block, ForwardScratch<T>& scratch, std::uint64_t (&blended)[chunk_words]) {
  using P = Pack<T, W>;
  constexpr int packs = block_pixels / W;
  const T* x_at = cell_table<T>.at[0][block];
  const T* y_at = cell_table<T>.at[1][block];
  const BlockList list(reached, words);
  std::array<P, packs> x, y, transmittance, red, green, blue, depth;
  for (int j = 0; j < packs; ++j) {
    const auto at = static_cast<std::size_t>(j);
    x[at] = P::load(x_at + j * W);
    y[at] = P::load(y_at + j * W);
    transmittance[at] = P::load(scratch.transmittance[block] + j * W);
    red[at] = P::load(scratch.color[0][block] + j * W);
    green[at] = P::load(scratch.color[1][block] + j * W);
    blue[at] = P::load(scratch.color[2][block] + j * W);
    if constexpr (outputs.depth) depth[at] = P::load(scratch.depth[block] + j * W);
  }
  std::size_t next = 0;
  bool open = true;
  while (open && next < list.size) {
    std::array<const CellSplat<T>*, step_splats> splat;
    for (std::size_t i = 0; i < step_splats; ++i) splat[i] = splats + list.index[next + i];
    next += step_splats;
    open = false;
    for (int j = 0; j < packs; ++j) {
      const auto at = static_cast<std::size_t>(j);
      const InStep<P, step_splats> raw = raw_alpha<accuracy, step_splats, T, W>(splat, x[at], y[at], x_at + j * W);
      for (std::size_t i = 0; i < step_splats; ++i) {
        const P weight = blend<accuracy, false>(raw.part[i], transmittance[at]).weight;
        red[at] = fma(weight, P(splat[i]->red), red[at]);
        green[at] = fma(weight, P(splat[i]->green), green[at]);
        blue[at] = fma(weight, P(splat[i]->blue), blue[at]);
        if constexpr (outputs.depth) depth[at] = fma(weight, P(splat[i]->depth), depth[at]);
      }
      open = open | any(unfinished<accuracy>(transmittance[at]));
    }
  }
  for (int j = 0; j < packs; ++j) {
    const auto at = static_cast<std::size_t>(j);
    transmittance[at].store(scratch.transmittance[block] + j * W);
    red[at].store(scratch.color[0][block] + j * W);
    green[at].store(scratch.color[1][block] + j * W);
    blue[at].store(scratch.color[2][block] + j * W);
    if constexpr (outputs.depth) depth[at].store(scratch.depth[block] + j * W);
  }
  std::memcpy(blended, reached, sizeof(blended));
  if (next < list.size) {  // finished early: drop the splats from list[next] on
    const std::size_t cut = list.index[next];
    for (std::size_t i = 0; i < words; ++i) {
      if (64 * i >= cut) {
        blended[i] = 0;
      } else if (64 * i + 64 > cut) {
        blended[i] &= (std::uint64_t{1} << (cut - 64 * i)) - 1;
      }
    }
  }
  return !open;
}

/// The planes a cell is written to; alpha and depth may be null when `outputs` does not ask for them.
template <class T>
struct ForwardPlanes {
  ImageView<T> image;
  T* alpha = nullptr;
  T* depth = nullptr;
};

/// One cell: overwrites its pixels, fills `records` (one per chunk of the list) and returns how many chunks were
/// opened.
template <Accuracy accuracy, RasterOutputs outputs, int W, class T>
inline std::size_t forward_cell(std::span<const WhiteSplat<T>> splats, std::span<const std::uint32_t> list,
                                std::span<const std::uint32_t> upcoming, const CellPlace& place,
                                const std::array<T, 3>& background, const ForwardPlanes<T>& planes,
                                ChunkRecord<T>* records, ForwardScratch<T>& scratch) {
  for (int c = 0; c < 3; ++c) prefetch_cell<true>(planes.image.plane(c), place);
  each_block_row(
      place, [&](int block, int lane, std::size_t /*offset*/, int count) __attribute__((always_inline)) {
        for (int i = 0; i < block_side; ++i) scratch.transmittance[block][lane + i] = i < count ? T(1) : T(0);
      });
  std::memset(scratch.color, 0, sizeof(scratch.color));
  if constexpr (outputs.depth) std::memset(scratch.depth, 0, sizeof(scratch.depth));
  scratch.splats[chunk_splats] = CellSplat<T>{};
  unsigned open = place.blocks();
  std::size_t chunk = 0;
  for (; chunk * chunk_splats < list.size() && open != 0; ++chunk) {
    const std::span<const std::uint32_t> part =
        list.subspan(chunk * chunk_splats, std::min(chunk_splats, list.size() - chunk * chunk_splats));
    const std::span<const std::uint32_t> following = list.subspan(chunk * chunk_splats + part.size());
    const std::size_t words = (part.size() + 63) / 64;
    ChunkRecord<T>& record = records[chunk];
    std::memcpy(record.transmittance, scratch.transmittance, sizeof(record.transmittance));
    open_chunk<W>(splats, part, place, open, scratch.splats, scratch.reach);
    scratch.reach.by_block(part.size());
    for (int b = 0; b < cell_blocks; ++b) {
      if ((open >> b & 1u) == 0) {
        for (std::size_t i = 0; i < words; ++i) record.blended[b][i] = 0;
        continue;
      }
      if (chunk == 0) prefetch_share(splats, upcoming, b);  // now, because the cell may be finished before its list
      prefetch_share(splats, following, b);
      if (forward_block<accuracy, outputs, W>(scratch.splats, scratch.reach.word[b], words, b, scratch,
                                              record.blended[b]))
        open &= ~(1u << b);
    }
  }
  for (int b = 0; b < cell_blocks; ++b) {
    for (int i = 0; i < block_pixels; ++i) {
      const T signed_value = scratch.transmittance[b][i];
      const T transmittance =
          accuracy.stop == StopRule::exclusive && signed_value < T(0) ? -signed_value : signed_value;
      scratch.color[0][b][i] += transmittance * background[0];
      scratch.color[1][b][i] += transmittance * background[1];
      scratch.color[2][b][i] += transmittance * background[2];
      if constexpr (outputs.alpha) scratch.transmittance[b][i] = T(1) - transmittance;
    }
  }
  for (int c = 0; c < 3; ++c) store_cell(scratch.color[c], place, planes.image.plane(c));
  if constexpr (outputs.alpha) store_cell(scratch.transmittance, place, planes.alpha);
  if constexpr (outputs.depth) store_cell(scratch.depth, place, planes.depth);
  return chunk;
}

}  // namespace compmark::detail
