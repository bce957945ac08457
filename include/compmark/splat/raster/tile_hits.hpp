// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which tiles a splat can reach, in two forms of one test: the least sigma over the rectangle of a tile's pixel
// centres, with the slack of docs/spec/numerics.md, TB3. Small boxes are tested with the splats as lanes, because most
// are two or three tiles wide and a test whose lanes are the tiles of one splat leaves most lanes idle; larger ones
// with their tiles as lanes. Cost: ~22 instructions a pack and tile of its largest box; ~40 flop a splat and group of W
// tiles.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/splat.hpp"
#include "compmark/splat/raster/transpose.hpp"

namespace compmark::detail {

/// A rectangle of tiles.
struct TileBox {
  std::uint16_t x, y, width, height;
};

/// The fields of W splats, in the order of Splat.
template <class P>
using PackedSplats = std::array<P, 16>;

/// Splats asked for in advance: projection wrote them past the caches (measured: the wait for them was half of the time
/// of binning).
inline constexpr std::size_t splats_ahead = 32;

/// A pack of splats from memory; the lanes from `count` on hold the first of them again.
template <class P>
[[nodiscard]] COMPMARK_INLINE PackedSplats<P> load_splats(const Splat<typename P::Scalar>* splats, std::size_t count) {
  std::array<const typename P::Scalar*, P::width> record;
  for (std::size_t lane = 0; lane < P::width; ++lane) {
    record[lane] = reinterpret_cast<const typename P::Scalar*>(splats + (lane < count ? lane : 0));
    __builtin_prefetch(splats + lane + splats_ahead);
  }
  return load_records<P>(record);
}

/// Boxes of W splats in tiles, whole numbers; all 0 where no pixel centre is inside.
template <class P>
struct PackedBoxes {
  P x, y, width, height;
};

/// Boxes of at most this many tiles on a side are tested as packs. Their masks are whole numbers below 2^16, exact in a
/// lane.
inline constexpr int packed_side = 4;

/// tile_rectangle of footprint.hpp for W splats, all rules but the published square.
template <int tile_size, class P>
[[nodiscard]] COMPMARK_INLINE PackedBoxes<P> tile_boxes(const PackedSplats<P>& splats, int width, int height) {
  using T = typename P::Scalar;
  const P zero(T(0)), one(T(1)), half(pixel_center<T>), inverse(T(1) / T(tile_size));
  const auto floor = [&](P x) {
    const P nearest = round_to_even(x);
    return select(nearest > x, nearest - one, nearest);
  };
  const auto clamp = [](P x, P low, P high) { return min(max(x, low), high); };  // NaN becomes `low`
  const auto along = [&](P middle, P reach, int size, P& begin, P& length) {
    const P limit(static_cast<T>(size));
    const P first = clamp(-floor(-clamp(middle - reach - half, -one, limit + one)), zero, limit);
    const P last = clamp(floor(clamp(middle + reach + half, -one, limit + one)), zero, limit);
    begin = floor((first + half) * inverse);
    length = floor((last + (P(T(tile_size)) - half)) * inverse) - begin;
    return first < last;
  };
  PackedBoxes<P> box;
  const auto some =
      along(splats[0], splats[12], width, box.x, box.width) & along(splats[1], splats[13], height, box.y, box.height);
  return {keep(some, box.x), keep(some, box.y), keep(some, box.width), keep(some, box.height)};
}

/// For boxes of at most packed_side x packed_side tiles the mask of those that are hit, bit row * width + column, as a
/// whole number.
template <int tile_size, class P>
[[nodiscard]] COMPMARK_INLINE P packed_hits(const PackedSplats<P>& splats, const PackedBoxes<P>& box,
                                            typename P::MaskType lanes, int width, int height) {
  using T = typename P::Scalar;
  const P zero(T(0)), one(T(1)), half(pixel_center<T>), tile(static_cast<T>(tile_size));
  const P right = P(static_cast<T>(width)) - half, bottom = P(static_cast<T>(height)) - half;
  const P u = splats[0], v = splats[1], slope = splats[2], major = splats[3], minor = splats[4];
  const auto pivot_x = splats[5] > zero;
  const P back = major * slope / fma(major * slope, slope, minor);
  const P x_in_w = select(pivot_x, -slope, one), y_in_w = select(pivot_x, one, -slope);  // w = a - slope b
  const P y_per_x = select(pivot_x, slope, back), x_per_y = select(pivot_x, back, slope);
  const P bound = fma(splats[11], P(T(1.0001)), P(T(1e-5)));
  const auto clamp = [](P x, P low, P high) { return min(max(x, low), high); };
  const auto sigma = [&](P x, P y) {
    const P w = fma(x_in_w, x, y_in_w * y), b = select(pivot_x, x, y);
    return fma(major * w, w, minor * b * b);
  };
  std::array<P, packed_side> x_low, x_high;
  for (std::size_t column = 0; column < packed_side; ++column) {
    const P corner = fma(box.x + P(static_cast<T>(column)), tile, half);
    x_low[column] = corner - u;
    x_high[column] = min(corner + (tile - one), right) - u;
  }
  const P step = scale_by_power_of_two(one, box.width);
  P mask = zero, first_of_row = one;
  for (std::size_t row = 0; row < packed_side; ++row) {
    const auto in_row = lanes & (box.height > P(static_cast<T>(row)));
    if (!any(in_row)) break;
    const P corner = fma(box.y + P(static_cast<T>(row)), tile, half);
    const P y_low = corner - v, y_high = min(corner + (tile - one), bottom) - v;
    const P y_near = clamp(zero, y_low, y_high), x_best = x_per_y * y_near;
    P bit = first_of_row;
    for (std::size_t column = 0; column < packed_side; ++column) {
      const auto inside = in_row & (box.width > P(static_cast<T>(column)));
      if (!any(inside)) break;
      const P x_near = clamp(zero, x_low[column], x_high[column]);
      const P first = sigma(x_near, clamp(y_per_x * x_near, y_low, y_high));
      const P second = sigma(clamp(x_best, x_low[column], x_high[column]), y_near);
      mask += keep(inside & (min(first, second) <= bound), bit);
      bit += bit;
    }
    first_of_row = first_of_row * step;
  }
  return mask;
}

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

/// Tests the tiles (first_column + column, first_row + row) of the grid that the lanes stand for: bit i is set if the
/// smallest sigma over the tile's pixel centres, a convex minimum over a rectangle, is within sigma_max plus a slack
/// for rounding (docs/spec/numerics.md, TB3). No square root, no false negative. `columns` <= W tiles wide.
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
  // The minimum lies on an edge that faces the mean: b fixed at its value nearest the mean and a free, or the other way
  // round.
  const P b_near = clamp(zero, b_low, b_high), a_near = clamp(zero, a_low, a_high);
  const P first = sigma(clamp(slope * b_near, a_low, a_high), b_near);
  const T back = splat.major * splat.slope / (splat.major * splat.slope * splat.slope + splat.minor);
  const P second = sigma(a_near, clamp(P(back) * a_near, b_low, b_high));
  const P bound(splat.sigma_max * T(1.0001) + T(1e-5));
  return (min(first, second) <= bound).bits();
}

/// Whether the answer for a box is kept as 64 bits; else it is asked for twice, of the same function.
template <int W>
[[nodiscard]] COMPMARK_INLINE bool is_small(const TileBox& box) {
  return box.width <= W && box.width * box.height <= 64;
}

/// Calls visit(row, column, columns, bits) for groups of at most W tiles of a splat's box: whole rows where the box is
/// at most W wide, else parts of one row. Bit k of a group is its tile (k / columns, k % columns).
template <Accuracy accuracy, class T, int W, class Visit>
COMPMARK_INLINE void each_tile_group(const Splat<T>& splat, const TileBox& box, int width, int height,
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

/// The default of bin's `each_pack`.
struct NoPackVisitor {
  template <class P>
  COMPMARK_INLINE void operator()(std::size_t /*first*/, std::size_t /*lanes*/,
                                  const PackedSplats<P>& /*splats*/) const {}
};

}  // namespace compmark::detail
