// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The pixel loop's common ground: blocks of 4 x 4 pixels (the lanes), cells of 16 blocks (16 x 16 pixels), chunks of 256 splats, and the
// one function that says what alpha a splat has at a pixel (numerics case BF6: forward and backward call it, so they cannot disagree).
//
// A splat is evaluated in whitened coordinates, w = wx dx + wy dy and b = bx dx + by dy, where sigma = w^2 + b^2 whatever its pivot axis
// (numerics case CV2; one of bx, by is zero). When the exponential is a polynomial, sigma is kept in units of ln 2.
// Why 4 x 4 and not 16 x 1: an ellipse of 30 x 30 pixels touches 22 % fewer blocks, one of 15 x 15 30 % fewer (docs/concepts/TileRasterizer.md).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/raster/accuracy.hpp"
#include "compmark/raster/projected.hpp"
#include "compmark/raster/splat.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark::inline v0::detail {

inline constexpr int cell_side = 16;              ///< pixels
inline constexpr int block_side = 4;              ///< pixels
inline constexpr int cell_blocks = 16;            ///< row-major in the cell
inline constexpr int block_pixels = 16;           ///< row-major in the block
inline constexpr std::size_t chunk_splats = 256;  ///< splats of a tile's list that are worked on together
inline constexpr std::size_t chunk_words = chunk_splats / 64;
inline constexpr std::size_t record_ahead = 8;  ///< splats between asking for a record and writing it

/// Widest pack a block can be cut into.
template <class T>
inline constexpr int block_width = native_width<T> < block_pixels ? native_width<T> : block_pixels;

/// Pixel centres of a cell relative to its corner: at[axis][block][lane], axis 0 is x; and per block its first pixel and its middle.
template <class T>
struct CellTable {
  alignas(64) T at[2][cell_blocks][block_pixels];
  alignas(64) T first[2][cell_blocks];
  alignas(64) T middle[2][cell_blocks];
  alignas(64) T lane[2][block_pixels];  ///< pixel centre relative to the block's middle
};

template <class T>
inline constexpr CellTable<T> cell_table = [] {
  CellTable<T> table{};
  for (int b = 0; b < cell_blocks; ++b) {
    const int origin[2] = {b % 4 * block_side, b / 4 * block_side};
    for (int axis = 0; axis < 2; ++axis) {
      table.first[axis][b] = static_cast<T>(origin[axis]) + pixel_center<T>;
      table.middle[axis][b] = static_cast<T>(origin[axis]) + T(2);
    }
    for (int lane = 0; lane < block_pixels; ++lane) {
      const int inside[2] = {lane % 4, lane / 4};
      for (int axis = 0; axis < 2; ++axis) {
        table.at[axis][b][lane] = static_cast<T>(origin[axis] + inside[axis]) + pixel_center<T>;
        table.lane[axis][lane] = static_cast<T>(inside[axis]) + pixel_center<T> - T(2);
      }
    }
  }
  return table;
}();

/// Units of sigma: 1 with std::exp, 1 / ln 2 with a polynomial of 2^f.
template <Accuracy accuracy, class T>
inline constexpr T sigma_unit = accuracy.exp_degree == 0 ? T(1) : static_cast<T>(1.44269504088896340736L);

/// A splat in whitened coordinates: one cache line of floats, made once a view.
template <class T>
struct alignas(16 * sizeof(T)) WhiteSplat {
  T u, v;
  T wx, wy, bx, by;  // w = wx dx + wy dy, b = bx dx + by dy
  T reach;           // sigma beyond which alpha is cut off, with the margin of numerics case TB3
  T opacity;
  T y_per_x, x_per_y;  // along a line of constant dx, sigma is least at dy = y_per_x dx; and the other way round
  T red, green, blue;
  T depth;
  T unused[2];
};

template <Accuracy accuracy, class T>
[[nodiscard]] inline WhiteSplat<T> whiten(const Splat<T>& splat) {
  using std::sqrt;
  constexpr T unit = sigma_unit<accuracy, T>;
  const T w = sqrt(splat.major * unit), b = sqrt(splat.minor * unit);
  const bool pivot_x = splat.pivot_x != T(0);
  const T across = -w * splat.slope;
  const T other = splat.slope * splat.major / (splat.major * splat.slope * splat.slope + splat.minor);
  WhiteSplat<T> white{};
  white.u = splat.u;
  white.v = splat.v;
  white.wx = pivot_x ? across : w;
  white.wy = pivot_x ? w : across;
  white.bx = pivot_x ? b : T(0);
  white.by = pivot_x ? T(0) : b;
  white.reach = splat.sigma_max * unit * T(1.0001) + T(1e-5);
  white.opacity = splat.opacity;
  white.y_per_x = pivot_x ? splat.slope : other;
  white.x_per_y = pivot_x ? other : splat.slope;
  white.red = splat.red;
  white.green = splat.green;
  white.blue = splat.blue;
  white.depth = splat.depth;
  return white;
}

/// Bit b is set where the splat can reach alpha_min inside block b: the least sigma over the rectangle of the block's pixel centres, exact
/// and without a square root (it lies on one of the two edges that face the mean). ~30 instructions for the 16 blocks at W = 16.
template <int W, class T>
[[nodiscard]] COMPMARK_INLINE unsigned blocks_reached(const WhiteSplat<T>& splat, T cell_x, T cell_y) {
  using P = Pack<T, W>;
  const CellTable<T>& table = cell_table<T>;
  const P x0(cell_x - splat.u), y0(cell_y - splat.v), zero(T(0)), span(T(block_side - 1));
  const P wx(splat.wx), wy(splat.wy), bx(splat.bx), by(splat.by), reach(splat.reach);
  unsigned mask = 0;
  for (int j = 0; j < cell_blocks; j += W) {
    const P x_low = P::load(table.first[0] + j) + x0, x_high = x_low + span;
    const P y_low = P::load(table.first[1] + j) + y0, y_high = y_low + span;
    const P x_near = max(min(x_high, zero), x_low), y_near = max(min(y_high, zero), y_low);
    const P y_best = max(min(P(splat.y_per_x) * x_near, y_high), y_low);
    const P x_best = max(min(P(splat.x_per_y) * y_near, x_high), x_low);
    const P w1 = fma(wx, x_near, wy * y_best), b1 = fma(bx, x_near, by * y_best);
    const P w2 = fma(wx, x_best, wy * y_near), b2 = fma(bx, x_best, by * y_near);
    const P least = min(fma(w1, w1, b1 * b1), fma(w2, w2, b2 * b2));
    mask |= (least <= reach).bits() << j;
  }
  return mask;
}

/// A splat relative to one cell: what the loop over the blocks reads.
template <class T>
struct alignas(16 * sizeof(T)) CellSplat {
  T w0, wx, wy;  // w = w0 + wx x + wy y, x and y from the cell's corner
  T b0, bd;      // b = b0 + bd d, d is x or y
  T opacity;
  T red, green, blue, depth;
  std::uint32_t axis;  // offset of the pivot axis in CellTable::at, in scalars
};

template <class T>
[[nodiscard]] COMPMARK_INLINE CellSplat<T> to_cell(const WhiteSplat<T>& splat, T cell_x, T cell_y) {
  const T x = cell_x - splat.u, y = cell_y - splat.v;
  CellSplat<T> local;
  local.w0 = splat.wx * x + splat.wy * y;
  local.wx = splat.wx;
  local.wy = splat.wy;
  local.b0 = splat.bx * x + splat.by * y;
  local.bd = splat.bx + splat.by;
  local.opacity = splat.opacity;
  local.red = splat.red;
  local.green = splat.green;
  local.blue = splat.blue;
  local.depth = splat.depth;
  local.axis = splat.bx != T(0) ? 0u : static_cast<std::uint32_t>(cell_blocks * block_pixels);
  return local;
}

/// N packs that are computed in step: N independent chains of instructions next to each other, so that the processor waits for none of
/// them. (One chain after the other fills its scheduler with instructions that wait: measured 17.7 cycles a block and splat, in step 13.)
template <class P, int N>
struct InStep {
  using Scalar = typename P::Scalar;
  std::array<P, N> part;

  InStep() = default;
  COMPMARK_INLINE explicit InStep(Scalar value) {
    for (P& p : part) p = P(value);
  }
  template <class F>
  [[nodiscard]] static COMPMARK_INLINE InStep of(const F& f) {
    return [&]<std::size_t... i>(std::index_sequence<i...>) __attribute__((always_inline)) {
      InStep result;
      ((result.part[i] = f(i)), ...);
      return result;
    }
    (std::make_index_sequence<static_cast<std::size_t>(N)>{});
  }
  friend COMPMARK_INLINE InStep operator*(const InStep& a, const InStep& b) {
    return of([&](std::size_t i) __attribute__((always_inline)) { return a.part[i] * b.part[i]; });
  }
  friend COMPMARK_INLINE InStep operator-(const InStep& a, const InStep& b) {
    return of([&](std::size_t i) __attribute__((always_inline)) { return a.part[i] - b.part[i]; });
  }
  friend COMPMARK_INLINE InStep fma(const InStep& a, const InStep& b, const InStep& c) {
    return of([&](std::size_t i) __attribute__((always_inline)) { return fma(a.part[i], b.part[i], c.part[i]); });
  }
};

/// Splats that a block works on together.
inline constexpr int step_splats = 4;

/// opacity * exp(-sigma) of N splats at W pixels: x, y their centres in the cell, `axis` where the pivot coordinate of the first is.
template <Accuracy accuracy, int N, class T, int W>
[[nodiscard]] COMPMARK_INLINE InStep<Pack<T, W>, N> raw_alpha(const std::array<const CellSplat<T>*, N>& splat,
                                                              Pack<T, W> x, Pack<T, W> y, const T* axis) {
  using P = Pack<T, W>;
  using S = InStep<P, N>;
  const S w1 =
      S::of([&](std::size_t i) __attribute__((always_inline)) { return fma(y, P(splat[i]->wy), P(splat[i]->w0)); });
  const S b = S::of([&](std::size_t i) __attribute__((always_inline)) {
    return fma(P::load(axis + splat[i]->axis), P(splat[i]->bd), P(splat[i]->b0));
  });
  const S w = S::of([&](std::size_t i) __attribute__((always_inline)) { return fma(x, P(splat[i]->wx), w1.part[i]); });
  const S bb = b * b;
  S power =
      S::of([&](std::size_t i) __attribute__((always_inline)) { return fma(-w.part[i], w.part[i], -bb.part[i]); });
  if constexpr (accuracy.exp_degree == 0) {
    return S::of([&](std::size_t i) { return P(splat[i]->opacity) * exp_negative<0>(power.part[i]); });
  } else {
    // Full registers scale by any power; the others add to the exponent field, which must not wrap.
    if constexpr (!uses_mask_register<T, W>) {
      power = S::of([&](std::size_t i) __attribute__((always_inline)) { return max(power.part[i], P(T(-126))); });
    }
    const S n = S::of([&](std::size_t i) __attribute__((always_inline)) { return round_to_even(power.part[i]); });
    const S fraction = exp2_fraction<accuracy.exp_degree>(power - n);
    const S value = S::of([&](std::size_t i) __attribute__((always_inline)) {
      return scale_by_power_of_two(fraction.part[i], n.part[i]);
    });
    return S::of([&](std::size_t i) __attribute__((always_inline)) { return value.part[i] * P(splat[i]->opacity); });
  }
}

/// What one splat does to W pixels.
template <class T, int W>
struct Blend {
  Pack<T, W> alpha;   // 0 where the splat is skipped
  Pack<T, W> weight;  // alpha * transmittance before
  Pack<T, W> chain;   // weight * dln(alpha)/dln(raw alpha); only where `stores_chain`
};

/// Whether backward must keep dln(alpha)/dln(raw): otherwise it is 0 where alpha == alpha_max and 1 elsewhere.
template <Accuracy accuracy>
inline constexpr bool stores_chain = accuracy.published_backward || accuracy.cutoff == CutoffRule::smooth;

/// Pixels that still take light. Under the exclusive rule a finished pixel is marked by the sign of its transmittance.
template <Accuracy accuracy, class T, int W>
[[nodiscard]] COMPMARK_INLINE typename Pack<T, W>::MaskType unfinished(Pack<T, W> transmittance) {
  if constexpr (accuracy.stop == StopRule::exclusive || accuracy.transmittance_stop <= 0)
    return transmittance > Pack<T, W>(T(0));
  return transmittance >= Pack<T, W>(static_cast<T>(accuracy.transmittance_stop));
}

/// Blends front to back. The transmittance is 0 at pixels outside the image.
template <Accuracy accuracy, bool want_chain, class T, int W>
[[nodiscard]] COMPMARK_INLINE Blend<T, W> blend(Pack<T, W> raw, Pack<T, W>& transmittance) {
  using P = Pack<T, W>;
  constexpr T alpha_min = static_cast<T>(accuracy.alpha_min), alpha_max = static_cast<T>(accuracy.alpha_max);
  constexpr T stop = static_cast<T>(accuracy.transmittance_stop);
  Blend<T, W> result;
  P alpha = min(raw, P(alpha_max));
  P derivative(T(1));
  typename P::MaskType met;
  if constexpr (accuracy.cutoff == CutoffRule::smooth) {
    for (int i = 0; i < W; ++i) {
      const SmoothCutoff<T> cut = smooth_cutoff(alpha.lane(i), alpha_min);
      // dln(alpha)/dln(raw) = raw * derivative / value; the product with value is taken below.
      derivative.set(i, cut.value > T(0) ? alpha.lane(i) * cut.derivative / cut.value : T(0));
      alpha.set(i, cut.value);
    }
    met = alpha > P(T(0));
  } else {
    met = raw >= P(alpha_min);
  }
  // Skipped lanes get alpha 0 before the transmittance comes in: the chain from splat to splat is one comparison and one multiply-add.
  alpha = keep(met, alpha);
  const P before = transmittance;
  const P after = fma(-alpha, before, before);  // one rounding (numerics case BF2)
  typename P::MaskType blended;
  if constexpr (accuracy.stop == StopRule::exclusive) {
    const typename P::MaskType open = unfinished<accuracy>(before);
    blended = open & (after >= P(stop));
    transmittance = select(blended, after, select(open & met, -before, before));
    result.weight = keep(blended, alpha * before);
    result.alpha = keep(blended, alpha);
  } else if constexpr (accuracy.transmittance_stop > 0) {
    blended = unfinished<accuracy>(before);
    transmittance = select(blended, after, before);
    result.weight = keep(blended, alpha * before);
    result.alpha = keep(blended, alpha);
  } else {
    blended = met;
    transmittance = after;
    result.weight = alpha * before;
    result.alpha = alpha;
  }
  if constexpr (want_chain) {
    if constexpr (accuracy.published_backward) {
      result.chain = keep(blended & met, raw * before);
    } else {
      result.chain = keep(raw < P(alpha_max), result.weight * derivative);
    }
  }
  return result;
}

/// Transposes 8 rows of 8 bits.
[[nodiscard]] constexpr std::uint64_t transpose_bits(std::uint64_t x) {
  std::uint64_t t = (x ^ (x >> 7)) & 0x00AA00AA00AA00AAull;
  x ^= t ^ (t << 7);
  t = (x ^ (x >> 14)) & 0x0000CCCC0000CCCCull;
  x ^= t ^ (t << 14);
  t = (x ^ (x >> 28)) & 0x00000000F0F0F0F0ull;
  return x ^ t ^ (t << 28);
}

/// The blocks each splat of a chunk reaches, as bits, both ways round.
struct ReachBits {
  alignas(64) std::uint8_t low[chunk_splats], high[chunk_splats];  // splat by splat: blocks 0 … 7 and 8 … 15
  alignas(64) std::uint64_t word[cell_blocks][chunk_words];        // block by block: bit k of word k / 64 is splat k

  /// Fills `word` from the first `count` splats.
  void by_block(std::size_t count) {
    static_assert(std::endian::native == std::endian::little, "ReachBits reads eight bytes as one little-endian word");
    for (std::size_t k = count; k < (count + 63) / 64 * 64; ++k) low[k] = high[k] = 0;
    for (std::size_t i = 0; i < (count + 63) / 64; ++i) {
      for (int half = 0; half < 2; ++half) {
        std::uint64_t words[8] = {};
        for (std::size_t group = 0; group < 8; ++group) {
          std::uint64_t bits;
          std::memcpy(&bits, (half == 0 ? low : high) + 64 * i + 8 * group, 8);
          bits = transpose_bits(bits);
          for (std::size_t b = 0; b < 8; ++b) words[b] |= (bits >> (8 * b) & 0xFFu) << (8 * group);
        }
        for (std::size_t b = 0; b < 8; ++b) word[static_cast<std::size_t>(8 * half) + b][i] = words[b];
      }
    }
  }
  /// Fills `low` and `high` from `word`.
  void by_splat(std::size_t count) {
    for (std::size_t i = 0; i < (count + 63) / 64; ++i) {
      for (int half = 0; half < 2; ++half) {
        for (std::size_t group = 0; group < 8; ++group) {
          std::uint64_t bits = 0;
          for (std::size_t b = 0; b < 8; ++b)
            bits |= (word[static_cast<std::size_t>(8 * half) + b][i] >> (8 * group) & 0xFFu) << (8 * b);
          bits = transpose_bits(bits);
          std::memcpy((half == 0 ? low : high) + 64 * i + 8 * group, &bits, 8);
        }
      }
    }
  }
};

/// The splats of one block in order, as indices into the chunk, padded to whole steps with `chunk_splats` (a splat of opacity 0).
struct BlockList {
  std::uint16_t index[chunk_splats + step_splats];
  std::size_t size = 0;

  COMPMARK_INLINE BlockList(const std::uint64_t (&words)[chunk_words], std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      for (std::uint64_t bits = words[i]; bits != 0; bits &= bits - 1) {
        index[size++] = static_cast<std::uint16_t>(64 * i + static_cast<std::size_t>(std::countr_zero(bits)));
      }
    }
    for (std::size_t i = size; i < size + step_splats; ++i) index[i] = static_cast<std::uint16_t>(chunk_splats);
  }
};

/// Number of chunks of a list.
[[nodiscard]] constexpr std::size_t list_chunks(std::size_t length) {
  return (length + chunk_splats - 1) / chunk_splats;
}

/// Where a cell lies in the image.
struct CellPlace {
  int x, y;           // pixels
  int width, height;  // of the image
  /// Bit b is set where block b has a pixel in the image.
  [[nodiscard]] unsigned blocks() const {
    if (x + cell_side <= width && y + cell_side <= height) return 0xFFFFu;
    unsigned mask = 0;
    for (int b = 0; b < cell_blocks; ++b) {
      if (x + b % 4 * block_side < width && y + b / 4 * block_side < height) mask |= 1u << b;
    }
    return mask;
  }
};

/// Calls row(block, lane, offset, count) for each row of four pixels of a cell: block and lane of its first pixel, the offset of that pixel
/// in a plane, and how many of the four are in the image (0 to 4; the offset is valid if there are any).
template <class Row>
COMPMARK_INLINE void each_block_row(const CellPlace& place, const Row& row) {
  const bool whole = place.x + cell_side <= place.width && place.y + cell_side <= place.height;
  const auto stride = static_cast<std::size_t>(place.width);
  for (int y = 0; y < cell_side; ++y) {
    const bool in_rows = whole || place.y + y < place.height;
    const std::size_t start = static_cast<std::size_t>(place.y + y) * stride + static_cast<std::size_t>(place.x);
    for (int x = 0; x < cell_side; x += block_side) {
      const int block = y / block_side * 4 + x / block_side, lane = y % block_side * block_side;
      if (whole) {
        row(block, lane, start + static_cast<std::size_t>(x), block_side);
      } else {
        row(block, lane, start + static_cast<std::size_t>(x),
            in_rows ? std::clamp(place.width - place.x - x, 0, block_side) : 0);
      }
    }
  }
}

/// Asks for the cache lines of a cell in one plane, long before load_cell or store_cell needs them.
template <bool write, class T>
COMPMARK_INLINE void prefetch_cell(const T* plane, const CellPlace& place) {
  const int rows = std::min(cell_side, place.height - place.y), columns = std::min(cell_side, place.width - place.x);
  for (int y = 0; y < rows; ++y) {
    const T* row = plane + static_cast<std::size_t>(place.y + y) * static_cast<std::size_t>(place.width) +
                   static_cast<std::size_t>(place.x);
    __builtin_prefetch(row, write ? 1 : 0);
    __builtin_prefetch(row + columns - 1, write ? 1 : 0);
  }
}

/// Copies a plane's pixels of one cell into blocks: to[block][lane]; pixels outside the image become 0.
template <class T>
inline void load_cell(const T* plane, const CellPlace& place, T (&to)[cell_blocks][block_pixels]) {
  each_block_row(
      place, [&](int block, int lane, std::size_t offset, int count) __attribute__((always_inline)) {
        T* const target = to[block] + lane;
        if (count == block_side) {
          std::memcpy(target, plane + offset, block_side * sizeof(T));
        } else {
          for (int i = 0; i < block_side; ++i)
            target[i] = i < count ? plane[offset + static_cast<std::size_t>(i)] : T(0);
        }
      });
}

/// The inverse of load_cell; pixels outside the image are dropped.
template <class T>
inline void store_cell(const T (&from)[cell_blocks][block_pixels], const CellPlace& place, T* plane) {
  each_block_row(
      place, [&](int block, int lane, std::size_t offset, int count) __attribute__((always_inline)) {
        const T* const source = from[block] + lane;
        if (count == block_side) {
          std::memcpy(plane + offset, source, block_side * sizeof(T));
        } else {
          for (int i = 0; i < count; ++i) plane[offset + static_cast<std::size_t>(i)] = source[i];
        }
      });
}

}  // namespace compmark::inline v0::detail
