// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Binning: for each tile the splats that can reach one of its pixel centres, front to back. The tile test runs once a
// splat and its answer is kept as bits (docs/spec/numerics.md, TB2: a count and a write pass that decide twice may
// decide differently); boxes of more than 64 tiles ask the same out-of-line function again. Counting sort over fixed
// chunks of the depth order; the lists do not depend on the chunks. Cost: that of tile_hits.hpp, then 8 bytes written a
// pair.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/result.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/footprint.hpp"
#include "compmark/splat/raster/projected.hpp"
#include "compmark/splat/raster/splat.hpp"
#include "compmark/splat/raster/tile_hits.hpp"

namespace compmark {

struct BinSettings {
  /// Most (splat, tile) pairs one view may have; beyond it bin() reports an error instead of running out of memory
  /// (docs/spec/numerics.md, TB6).
  std::size_t pair_budget = std::size_t{1} << 28;
};

/// Scratch of bin(); grow-only.
struct BinWorkspace {
  Buffer<detail::TileBox> box;      // [count]
  Buffer<std::uint64_t> mask;       // [count] tiles of the box that are hit, row-major; small boxes only
  Buffer<std::uint32_t> histogram;  // [chunks, tiles] pairs, later write positions within the tile
  Buffer<std::size_t> chunk_pairs;  // [chunks]
  Buffer<std::uint32_t> next;       // [tiles] next position to hand out
  Buffer<std::uint32_t> offset;     // [W + 1, 64] from the corner of a small box to its tile k
};

namespace detail {

/// Exclusive prefix sums in std::size_t. Returns the total.
template <class Count>
[[nodiscard]] inline std::size_t exclusive_sums(Count* counts, std::size_t n) {
  std::size_t sum = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const auto count = static_cast<std::size_t>(counts[i]);
    counts[i] = static_cast<Count>(sum);
    sum += count;
  }
  return sum;
}

/// The error of a view with more pairs than the budget, as a value: nothing has been allocated for them.
[[nodiscard]] inline Result<Done> check_pair_budget(std::size_t pairs, std::size_t budget) {
  const std::size_t limit = std::min<std::size_t>(budget, std::numeric_limits<std::uint32_t>::max());
  if (pairs <= limit) return Done{};
  return Error{
      ErrorKind::exhausted, "", "raster.pair_budget",
      "one view needs " + std::to_string(pairs) + " (splat, tile) pairs, the budget is " + std::to_string(limit),
      "render a smaller image, use fewer or smaller Gaussians, or raise the budget"};
}

}  // namespace detail

/// Fills `lists`. `each_pack(first, lanes, fields)` gets every pack of splats while it is in registers. On error the
/// lists are empty (every tile shows the background) and nothing was allocated for the pairs. Images up to 65535 tiles
/// on a side.
template <Accuracy accuracy, class T, int W = native_width<T>, Executor E, class EachPack = detail::NoPackVisitor>
Result<Done> bin(const ProjectedSplats<T>& projected, int width, int height, const BinSettings& settings,
                 TileLists& lists, BinWorkspace& workspace, E& executor, const EachPack& each_pack = {}) {
  using P = Pack<T, W>;
  constexpr int tile_size = accuracy.tile_size;
  lists.tiles_x = (width + tile_size - 1) / tile_size;
  lists.tiles_y = (height + tile_size - 1) / tile_size;
  const std::size_t tiles = static_cast<std::size_t>(lists.tiles_x) * static_cast<std::size_t>(lists.tiles_y);
  const auto tiles_x = static_cast<std::size_t>(lists.tiles_x);
  const std::size_t count = projected.count;
  const std::size_t grain = std::max<std::size_t>(2048, (count + 63) / 64);
  const std::size_t chunks = chunk_count(count, grain);
  workspace.box.resize(count);
  workspace.mask.resize(count);
  workspace.histogram.resize(chunks * tiles);
  workspace.chunk_pairs.resize(chunks);
  lists.begin.resize(tiles + 1);
  lists.first_slot.resize(count + 1);

  // Where bit k of a small box that is w tiles wide lies, from the box's corner.
  workspace.offset.resize(std::size_t{64} * (W + 1));
  for (std::size_t w = 1; w <= W; ++w) {
    for (std::size_t k = 0; k < 64; ++k) {
      workspace.offset[64 * w + k] = static_cast<std::uint32_t>(k / w * tiles_x + k % w);
    }
  }
  const auto each_large = [&](const Splat<T>& splat, const detail::TileBox& box, std::uint32_t* corner,
                              const auto& visit) {
    detail::each_tile_group<accuracy, T, W>(
        splat, box, width, height, [&](int row, int column, int columns, unsigned bits) {
          std::uint32_t* line = corner + static_cast<std::size_t>(row) * tiles_x + static_cast<std::size_t>(column);
          const unsigned row_bits = (1u << columns) - 1u;  // columns <= W <= 16
          for (; bits != 0; bits >>= columns, line += tiles_x) {
            for (unsigned hit = bits & row_bits; hit != 0; hit &= hit - 1) visit(line[std::countr_zero(hit)]);
          }
        });
  };

  // 1. Which tiles: bits, counts per splat (in first_slot), histogram per chunk.
  executor.for_chunks(count, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    const std::size_t chunk = begin / grain;
    std::uint32_t* const histogram = workspace.histogram.data() + chunk * tiles;
    std::fill(histogram, histogram + tiles, 0u);
    // Two loops, not one: a branch on the bits of a mask that is still being computed would be mispredicted late
    // (measured: 2x).
    for (std::size_t i = begin; i < end; i += W) {
      const std::size_t lanes = std::min<std::size_t>(W, end - i);
      const detail::PackedSplats<P> splats = detail::load_splats<P>(projected.splats.data() + i, lanes);
      each_pack(i, lanes, splats);
      unsigned rest = (1u << lanes) - 1u;  // lanes without a mask so far
      if constexpr (accuracy.footprint != FootprintRule::square_three_sigma) {
        const detail::PackedBoxes<P> box = detail::tile_boxes<tile_size>(splats, width, height);
        alignas(64) std::array<std::array<T, W>, 5> column;
        box.x.store(column[0].data());
        box.y.store(column[1].data());
        box.width.store(column[2].data());
        box.height.store(column[3].data());
        if constexpr (accuracy.footprint == FootprintRule::exact_tiles) {
          const P side(static_cast<T>(std::min(detail::packed_side, W)));
          const auto packed = (box.width <= side) & (box.height <= side);
          rest &= ~packed.bits();
          detail::packed_hits<tile_size>(splats, box, packed, width, height).store(column[4].data());
        }
        for (std::size_t lane = 0; lane < lanes; ++lane) {
          workspace.box[i + lane] = {
              static_cast<std::uint16_t>(column[0][lane]), static_cast<std::uint16_t>(column[1][lane]),
              static_cast<std::uint16_t>(column[2][lane]), static_cast<std::uint16_t>(column[3][lane])};
          if constexpr (accuracy.footprint == FootprintRule::exact_tiles)
            workspace.mask[i + lane] = static_cast<std::uint64_t>(static_cast<std::uint32_t>(column[4][lane]));
        }
      }
      for (; rest != 0; rest &= rest - 1) {
        const std::size_t k = i + static_cast<std::size_t>(std::countr_zero(rest));
        const Splat<T>& splat = projected.splats[k];
        if constexpr (accuracy.footprint == FootprintRule::square_three_sigma) {
          const detail::TileRectangle r = detail::tile_rectangle<accuracy.footprint, tile_size>(
              splat.u, splat.v, splat.half_width, splat.half_height, width, height);
          workspace.box[k] = {static_cast<std::uint16_t>(r.x_begin), static_cast<std::uint16_t>(r.y_begin),
                              static_cast<std::uint16_t>(std::max(0, r.x_end - r.x_begin)),
                              static_cast<std::uint16_t>(std::max(0, r.y_end - r.y_begin))};
        }
        const detail::TileBox box = workspace.box[k];
        if (!detail::is_small<W>(box)) continue;
        std::uint64_t mask = 0;
        detail::each_tile_group<accuracy, T, W>(splat, box, width, height, [&](int row, int, int, unsigned bits) {
          mask |= static_cast<std::uint64_t>(bits) << (row * box.width);
        });
        workspace.mask[k] = mask;
      }
    }
    std::size_t sum = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const detail::TileBox box = workspace.box[i];
      std::uint32_t* const corner = histogram + static_cast<std::size_t>(box.y) * tiles_x + box.x;
      std::size_t hits = 0;
      if (detail::is_small<W>(box)) {
        std::uint64_t mask = workspace.mask[i];
        hits = static_cast<std::size_t>(std::popcount(mask));
        const std::uint32_t* const offset = workspace.offset.data() + box.width * std::size_t{64};
        for (; mask != 0; mask &= mask - 1) ++corner[offset[std::countr_zero(mask)]];
      } else {
        each_large(projected.splats[i], box, corner, [&](std::uint32_t& at) {
          ++at;
          ++hits;
        });
      }
      lists.first_slot[i] = hits;
      sum += hits;
    }
    workspace.chunk_pairs[chunk] = sum;
  });

  // 2. Where: sums in std::size_t.
  lists.pairs = detail::exclusive_sums(workspace.chunk_pairs.data(), chunks);
  Result<Done> budget = detail::check_pair_budget(lists.pairs, settings.pair_budget);
  if (!budget) {
    lists.pairs = 0;
    std::fill(lists.begin.begin(), lists.begin.end(), std::size_t{0});
    std::fill(lists.first_slot.begin(), lists.first_slot.end(), std::size_t{0});
    return budget;
  }
  lists.splat.resize(lists.pairs);
  lists.position.resize(lists.pairs);
  // Chunk by chunk, so that every loop runs along memory.
  workspace.next.resize(tiles, 0u);
  std::uint32_t* const next = workspace.next.data();
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    const std::uint32_t* const histogram = workspace.histogram.data() + chunk * tiles;
    for (std::size_t tile = 0; tile < tiles; ++tile) next[tile] += histogram[tile];
  }
  const std::size_t written = detail::exclusive_sums(next, tiles);
  for (std::size_t tile = 0; tile < tiles; ++tile) lists.begin[tile] = next[tile];
  lists.begin[tiles] = written;
  COMPMARK_ASSERT(written == lists.pairs, "bin: the two counts of pairs differ");
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    std::uint32_t* const histogram = workspace.histogram.data() + chunk * tiles;
    for (std::size_t tile = 0; tile < tiles; ++tile) {
      const std::uint32_t here = histogram[tile];
      histogram[tile] = next[tile];
      next[tile] += here;
    }
  }

  // 3. Write, each chunk at its own positions.
  executor.for_chunks(count, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    const std::size_t chunk = begin / grain;
    std::uint32_t* const cursor = workspace.histogram.data() + chunk * tiles;
    std::uint32_t* const splat_at = lists.splat.data();
    std::size_t slot = workspace.chunk_pairs[chunk];
    std::uint32_t* position = lists.position.data() + slot;
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t hits = lists.first_slot[i];
      lists.first_slot[i] = slot;
      slot += hits;
      const detail::TileBox box = workspace.box[i];
      std::uint32_t* const corner = cursor + static_cast<std::size_t>(box.y) * tiles_x + box.x;
      const auto write = [&](std::uint32_t& at) {
        const std::uint32_t p = at++;
        splat_at[p] = static_cast<std::uint32_t>(i);
        *position++ = p;
      };
      if (detail::is_small<W>(box)) {
        const std::uint32_t* const offset = workspace.offset.data() + box.width * std::size_t{64};
        for (std::uint64_t mask = workspace.mask[i]; mask != 0; mask &= mask - 1) {
          write(corner[offset[std::countr_zero(mask)]]);
        }
      } else {
        each_large(projected.splats[i], box, corner, write);
      }
    }
  });
  lists.first_slot[count] = lists.pairs;
  return Done{};
}

}  // namespace compmark
