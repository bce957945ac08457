// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Blending front to back (method sheet 2.3), one cell of 16 x 16 pixels at a time. The list is worked on in chunks of 256 splats: first
// every splat is tested against the 16 blocks of the cell, then each block walks the splats that reach it with transmittance and colour in
// registers: ~22 instructions per block and splat, no branch but the loop's. A block stops when all its pixels are finished.
//
// Backward finds in the context the transmittance at the start of each chunk (4 bytes a pair) and which splats did blend in which block
// (2 bits a pair): it neither tests nor searches again.
#pragma once

#include <array>
#include <span>

#include "compmark/raster/outputs.hpp"
#include "compmark/raster/tile_block.hpp"

namespace compmark::inline v0::detail {

/// Scratch of one worker, ~40 KB in float.
template <class T>
struct ForwardScratch {
  CellSplat<T> splats[chunk_splats];
  ReachBits reach;
  alignas(64) T transmittance[cell_blocks][block_pixels];
  alignas(64) T color[3][cell_blocks][block_pixels];
  alignas(64) T depth[cell_blocks][block_pixels];
};

/// What forward keeps for backward, chunk by chunk of one cell.
template <class T>
struct ChunkRecord {
  alignas(64) T transmittance[cell_blocks][block_pixels];       // before the chunk
  alignas(64) std::uint64_t blended[cell_blocks][chunk_words];  // as ReachBits::word
};

/// Localises the splats of one chunk and finds the blocks they reach, of those in `open`.
template <int W, class T>
inline void open_chunk(std::span<const WhiteSplat<T>> splats, std::span<const std::uint32_t> list, const CellPlace& place, unsigned open,
                       CellSplat<T>* local, ReachBits& reach) {
  const T cell_x = static_cast<T>(place.x), cell_y = static_cast<T>(place.y);
  constexpr std::size_t ahead = 8;
  for (std::size_t k = 0; k < list.size(); ++k) {
    if (k + ahead < list.size()) __builtin_prefetch(&splats[list[k + ahead]]);
    const WhiteSplat<T>& splat = splats[list[k]];
    const unsigned mask = blocks_reached<W>(splat, cell_x, cell_y) & open;
    reach.low[k] = static_cast<std::uint8_t>(mask);
    reach.high[k] = static_cast<std::uint8_t>(mask >> 8);
    local[k] = to_cell(splat, cell_x, cell_y);
  }
}

/// One block through one chunk. `blended` gets the bits of the splats that blended anywhere in the block.
template <Accuracy accuracy, RasterOutputs outputs, int W, class T>
inline void forward_block(const CellSplat<T>* splats, const std::uint64_t (&reached)[chunk_words], std::size_t words, int block,
                          ForwardScratch<T>& scratch, std::uint64_t (&blended)[chunk_words]) {
  using P = Pack<T, W>;
  constexpr int packs = block_pixels / W;
  const T* x_at = cell_table<T>.at[0][block];
  const T* y_at = cell_table<T>.at[1][block];
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
  const auto finished = [&] {
    bool open = false;
    for (const P& t : transmittance) open = open || any(unfinished<accuracy>(t));
    return !open;
  };
  bool done = false;
  for (std::size_t i = 0; i < words; ++i) {
    std::uint64_t out = 0;
    unsigned step = 0;
    for (std::uint64_t bits = done ? 0 : reached[i]; bits != 0; bits &= bits - 1) {
      const CellSplat<T>& splat = splats[64 * i + static_cast<std::size_t>(std::countr_zero(bits))];
      bool hit = false;
      for (int j = 0; j < packs; ++j) {
        const auto at = static_cast<std::size_t>(j);
        const P raw = raw_alpha<accuracy, T, W>(splat, x[at], y[at], x_at + j * W);
        const Blend<T, W> step_result = blend<accuracy, false>(raw, transmittance[at]);
        red[at] = fma(step_result.weight, P(splat.red), red[at]);
        green[at] = fma(step_result.weight, P(splat.green), green[at]);
        blue[at] = fma(step_result.weight, P(splat.blue), blue[at]);
        if constexpr (outputs.depth) depth[at] = fma(step_result.weight, P(splat.depth), depth[at]);
        hit = hit | any(step_result.blended);
      }
      out |= hit ? bits & (~bits + 1) : 0;
      if ((++step & 7u) == 0 && finished()) {
        done = true;
        break;
      }
    }
    blended[i] = out;
  }
  for (int j = 0; j < packs; ++j) {
    const auto at = static_cast<std::size_t>(j);
    transmittance[at].store(scratch.transmittance[block] + j * W);
    red[at].store(scratch.color[0][block] + j * W);
    green[at].store(scratch.color[1][block] + j * W);
    blue[at].store(scratch.color[2][block] + j * W);
    if constexpr (outputs.depth) depth[at].store(scratch.depth[block] + j * W);
  }
}

/// The planes a cell is written to; alpha and depth may be null when `outputs` does not ask for them.
template <class T>
struct ForwardPlanes {
  ImageView<T> image;
  T* alpha = nullptr;
  T* depth = nullptr;
};

/// One cell: overwrites its pixels, fills `records` (one per chunk of the list) and returns how many chunks were opened.
template <Accuracy accuracy, RasterOutputs outputs, int W, class T>
inline std::size_t forward_cell(std::span<const WhiteSplat<T>> splats, std::span<const std::uint32_t> list, const CellPlace& place,
                                const std::array<T, 3>& background, const ForwardPlanes<T>& planes, ChunkRecord<T>* records,
                                ForwardScratch<T>& scratch) {
  for (int b = 0; b < cell_blocks; ++b) {
    for (int i = 0; i < block_pixels; ++i) {
      const bool inside = place.x + b % 4 * block_side + i % block_side < place.width && place.y + b / 4 * block_side + i / block_side < place.height;
      scratch.transmittance[b][i] = inside ? T(1) : T(0);
      for (auto& channel : scratch.color) channel[b][i] = T(0);
      if constexpr (outputs.depth) scratch.depth[b][i] = T(0);
    }
  }
  unsigned open = place.blocks();
  std::size_t chunk = 0;
  for (; chunk * chunk_splats < list.size() && open != 0; ++chunk) {
    const std::span<const std::uint32_t> part = list.subspan(chunk * chunk_splats, std::min(chunk_splats, list.size() - chunk * chunk_splats));
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
      forward_block<accuracy, outputs, W>(scratch.splats, scratch.reach.word[b], words, b, scratch, record.blended[b]);
      bool unfinished_pixels = false;
      for (int j = 0; j < block_pixels; j += W) {
        unfinished_pixels = unfinished_pixels || any(unfinished<accuracy>(Pack<T, W>::load(scratch.transmittance[b] + j)));
      }
      if (!unfinished_pixels) open &= ~(1u << b);
    }
  }
  using std::abs;
  for (int b = 0; b < cell_blocks; ++b) {
    for (int i = 0; i < block_pixels; ++i) {
      const T transmittance = accuracy.stop == StopRule::exclusive ? abs(scratch.transmittance[b][i]) : scratch.transmittance[b][i];
      for (std::size_t c = 0; c < 3; ++c) scratch.color[c][b][i] += transmittance * background[c];
      if constexpr (outputs.alpha) scratch.transmittance[b][i] = T(1) - transmittance;
    }
  }
  for (int c = 0; c < 3; ++c) store_cell(scratch.color[c], place, planes.image.plane(c));
  if constexpr (outputs.alpha) store_cell(scratch.transmittance, place, planes.alpha);
  if constexpr (outputs.depth) store_cell(scratch.depth, place, planes.depth);
  return chunk;
}

}  // namespace compmark::inline v0::detail
