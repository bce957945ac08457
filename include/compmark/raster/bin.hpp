// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Binning: for each tile the splats that can reach one of its pixel centres, front to back. The tile test runs once a splat and its answer
// is kept as bits (numerics case TB2: a count and a write pass that decide twice may decide differently); boxes of more than 64 tiles ask
// the same out-of-line function again. Counting sort over fixed chunks of the depth order; the lists do not depend on the chunks.
// Cost: one pack evaluation (~40 flop) per W tiles of a splat's box, then 8 bytes written a pair.
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
#include "compmark/raster/accuracy.hpp"
#include "compmark/raster/footprint.hpp"
#include "compmark/raster/projected.hpp"
#include "compmark/raster/splat.hpp"

namespace compmark::inline v0 {

struct BinSettings {
  /// Most (splat, tile) pairs one view may have; beyond it bin() reports an error instead of running out of memory (numerics case TB6).
  std::size_t pair_budget = std::size_t{1} << 28;
};

/// Scratch of bin(); grow-only.
struct BinWorkspace {
  struct Box {
    std::uint16_t x, y, width, height;  // in tiles
  };
  Buffer<Box> box;                  // [count]
  Buffer<std::uint64_t> mask;       // [count] tiles of the box that are hit, row-major; small boxes only
  Buffer<std::uint32_t> histogram;  // [chunks, tiles] pairs, later write positions within the tile
  Buffer<std::size_t> chunk_pairs;  // [chunks]
  Buffer<std::uint32_t> next;       // [tiles] next position to hand out
  Buffer<std::uint32_t> offset;     // [W + 1, 64] from the corner of a small box to its tile k
};

namespace detail {

/// lane -> column and row within a group of 16 / width rows of a box that is `width` tiles wide.
template <class T, int W>
struct LaneGrid {
  std::array<std::array<T, W>, W + 1> column{}, row{};
  std::array<int, W + 1> rows{};  // W / width
  constexpr LaneGrid() {
    for (std::size_t width = 1; width <= W; ++width) {
      rows[width] = static_cast<int>(W / width);
      for (std::size_t lane = 0; lane < W; ++lane) {
        column[width][lane] = static_cast<T>(lane % width);
        row[width][lane] = static_cast<T>(lane / width);
      }
    }
  }
};
template <class T, int W>
inline constexpr LaneGrid<T, W> lane_grid{};

/// Tests the tiles (first_column + column, first_row + row) of the grid that the lanes stand for: bit i is set if the smallest sigma over
/// the tile's pixel centres, a convex minimum over a rectangle, is within sigma_max plus a slack for rounding (numerics case TB3).
/// No square root, no false negative. `columns` <= W tiles wide.
template <int tile_size, class T, int W>
[[gnu::noinline]] inline unsigned tiles_hit(const Splat<T>& splat, int first_column, int first_row, int columns,
                                            int width, int height) {
  using P = Pack<T, W>;
  const P tile(static_cast<T>(tile_size)), half(pixel_center<T>), zero(T(0));
  const auto group = static_cast<std::size_t>(columns);
  const P x0 = fma(P::load(lane_grid<T, W>.column[group].data()) + P(static_cast<T>(first_column)), tile, half);
  const P y0 = fma(P::load(lane_grid<T, W>.row[group].data()) + P(static_cast<T>(first_row)), tile, half);
  const P x_low = x0 - P(splat.u), x_high = min(x0 + tile - P(T(1)), P(static_cast<T>(width)) - half) - P(splat.u);
  const P y_low = y0 - P(splat.v), y_high = min(y0 + tile - P(T(1)), P(static_cast<T>(height)) - half) - P(splat.v);
  const bool pivot_x = splat.pivot_x != T(0);
  const P a_low = pivot_x ? y_low : x_low, a_high = pivot_x ? y_high : x_high;
  const P b_low = pivot_x ? x_low : y_low, b_high = pivot_x ? x_high : y_high;
  const P slope(splat.slope), major(splat.major), minor(splat.minor);
  const auto sigma = [&](P a, P b) {
    const P w = a - slope * b;
    return major * w * w + minor * b * b;
  };
  const auto clamp = [](P x, P low, P high) { return min(max(x, low), high); };
  // The minimum lies on an edge that faces the mean: b fixed at its value nearest the mean and a free, or the other way round.
  const P b_near = clamp(zero, b_low, b_high), a_near = clamp(zero, a_low, a_high);
  const P first = sigma(clamp(slope * b_near, a_low, a_high), b_near);
  const T back = splat.major * splat.slope / (splat.major * splat.slope * splat.slope + splat.minor);
  const P second = sigma(a_near, clamp(P(back) * a_near, b_low, b_high));
  const P bound(splat.sigma_max * T(1.0001) + T(1e-5));
  return (min(first, second) <= bound).bits();
}

/// Whether the answer for a box is kept as 64 bits; else it is asked for twice, of the same function.
template <int W>
[[nodiscard]] COMPMARK_INLINE bool is_small(const BinWorkspace::Box& box) {
  return box.width <= W && box.width * box.height <= 64;
}

/// Calls visit(row, column, columns, bits) for groups of at most W tiles of a splat's box: whole rows where the box is at most W wide, else
/// parts of one row. Bit k of a group is its tile (k / columns, k % columns).
template <Accuracy accuracy, class T, int W, class Visit>
COMPMARK_INLINE void each_tile_group(const Splat<T>& splat, const BinWorkspace::Box& box, int width, int height,
                                     const Visit& visit) {
  for (int row = 0; row < box.height;) {
    const int columns = std::min<int>(box.width, W);
    const int rows = box.width <= W ? std::min<int>(lane_grid<T, W>.rows[box.width], box.height - row) : 1;
    for (int column = 0; column < box.width; column += columns) {
      const int here = std::min<int>(columns, box.width - column);
      const int lanes = here * rows;
      unsigned bits = lanes >= 32 ? ~0u : (1u << lanes) - 1u;
      if constexpr (accuracy.footprint == FootprintRule::exact_tiles) {
        bits &= tiles_hit<accuracy.tile_size, T, W>(splat, box.x + column, box.y + row, here, width, height);
      }
      visit(row, column, here, bits);
    }
    row += rows;
  }
}

/// Splats asked for in advance: projection wrote them past the caches (measured: the wait for them was half of the time of binning).
inline constexpr std::size_t splats_ahead = 32;

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

/// Fills `lists`. On error the lists are empty (every tile shows the background) and nothing was allocated for the pairs.
/// Images up to 65535 tiles on a side.
template <Accuracy accuracy, class T, int W = native_width<T>, Executor E>
Result<Done> bin(const ProjectedSplats<T>& projected, int width, int height, const BinSettings& settings,
                 TileLists& lists, BinWorkspace& workspace, E& executor) {
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
  const auto each_large = [&](const Splat<T>& splat, const BinWorkspace::Box& box, std::uint32_t* corner,
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
    // Three loops, not one: a branch on the bits of a mask that is still being computed would be mispredicted late (measured: 2x).
    for (std::size_t i = begin; i < end; ++i) {
      const Splat<T>& splat = projected.splats[i];
      __builtin_prefetch(&splat + detail::splats_ahead);
      const detail::TileRectangle r = detail::tile_rectangle<accuracy.footprint, tile_size>(
          splat.u, splat.v, splat.extent_x, splat.extent_y, width, height);
      workspace.box[i] = {static_cast<std::uint16_t>(r.x_begin), static_cast<std::uint16_t>(r.y_begin),
                          static_cast<std::uint16_t>(std::max(0, r.x_end - r.x_begin)),
                          static_cast<std::uint16_t>(std::max(0, r.y_end - r.y_begin))};
    }
    for (std::size_t i = begin; i < end; ++i) {
      const BinWorkspace::Box box = workspace.box[i];
      if (!detail::is_small<W>(box)) continue;
      std::uint64_t mask = 0;
      detail::each_tile_group<accuracy, T, W>(
          projected.splats[i], box, width, height,
          [&](int row, int, int, unsigned bits) { mask |= static_cast<std::uint64_t>(bits) << (row * box.width); });
      workspace.mask[i] = mask;
    }
    std::size_t sum = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const BinWorkspace::Box box = workspace.box[i];
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
      const BinWorkspace::Box box = workspace.box[i];
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

}  // namespace compmark::inline v0
