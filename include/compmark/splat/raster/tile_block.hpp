// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A splat on a block of pixels: the one function of its alpha at a pixel, and the one that blends it
// (docs/spec/numerics.md, BF6: forward and backward call both, so they cannot disagree).
//
// A splat is evaluated in whitened coordinates, w = wx dx + wy dy and b = bx dx + by dy, where sigma = w^2 + b^2
// whatever its pivot axis (docs/spec/numerics.md, CV2; one of bx, by is zero). When the exponential is a polynomial,
// sigma is kept in units of ln 2.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/depth_sort.hpp"
#include "compmark/splat/raster/projected.hpp"
#include "compmark/splat/raster/splat.hpp"
#include "compmark/splat/raster/tile_cell.hpp"
#include "compmark/splat/raster/transpose.hpp"

namespace compmark::detail {

/// Units of sigma: 1 with std::exp, 1 / ln 2 with a polynomial of 2^f.
template <Accuracy accuracy, class T>
inline constexpr T sigma_unit = accuracy.exp_degree == 0 ? T(1) : static_cast<T>(1.44269504088896340736L);

/// A splat in whitened coordinates: one cache line of floats, made once a view.
template <class T>
struct alignas(16 * sizeof(T)) WhiteSplat {
  T u, v;
  T wx, wy, bx, by;  // w = wx dx + wy dy, b = bx dx + by dy
  T reach;           // sigma beyond which alpha is cut off, with the margin of docs/spec/numerics.md, TB3
  T opacity;
  T y_per_x, x_per_y;  // along a line of constant dx, sigma is least at dy = y_per_x dx; and the other way round
  T red, green, blue;
  T depth;
  T bd;                // bx or by, whichever is not zero
  std::uint32_t axis;  // offset of the pivot axis in CellTable::at, in scalars
};

/// The fields of W WhiteSplats from those of W Splats, each in the order of its struct.
template <Accuracy accuracy, class P>
[[nodiscard]] COMPMARK_INLINE std::array<P, 16> whiten(const std::array<P, 16>& splats) {
  using T = typename P::Scalar;
  static_assert(sizeof(WhiteSplat<T>) == 16 * sizeof(T));
  const P unit(sigma_unit<accuracy, T>), zero(T(0));
  const P slope = splats[2], major = splats[3], minor = splats[4], sigma_max = splats[11];
  const auto pivot_x = splats[5] > zero;
  const P w = sqrt(major * unit), b = sqrt(minor * unit);
  const P across = -w * slope;
  const P other = slope * major / (slope * major * slope + minor);
  const auto offset = [](std::uint32_t bits) { return P(std::bit_cast<T>(static_cast<DepthKey<T>>(bits))); };
  return {splats[0],
          splats[1],
          select(pivot_x, across, w),
          select(pivot_x, w, across),
          keep(pivot_x, b),
          keep(!pivot_x, b),
          sigma_max * unit * P(T(1.0001)) + P(T(1e-5)),
          splats[6],
          select(pivot_x, slope, other),
          select(pivot_x, other, slope),
          splats[7],
          splats[8],
          splats[9],
          splats[10],
          b,
          select(pivot_x, offset(0), offset(cell_blocks * block_pixels))};
}

template <Accuracy accuracy, class P>
COMPMARK_INLINE void store_white(WhiteSplat<typename P::Scalar>* white, std::size_t lanes,
                                 const std::array<P, 16>& splats) {
  std::array<typename P::Scalar*, P::width> record;
  for (std::size_t lane = 0; lane < P::width; ++lane)
    record[lane] = lane < lanes ? reinterpret_cast<typename P::Scalar*>(white + lane) : nullptr;
  store_records<P>(whiten<accuracy>(splats), record);
}

/// Bit b is set where the splat can reach alpha_min inside block b: the least sigma over the rectangle of the block's
/// pixel centres, exact and without a square root (it lies on one of the two edges that face the mean). ~30
/// instructions for the 16 blocks at W = 16.
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
  T w0, b0;  // w = w0 + wx x + wy y and b = b0 + bd d, x and y from the cell's corner, d one of them
  T wx, wy;
  T unused[3];
  T opacity;
  T unused_too[2];
  T red, green, blue;
  T depth;
  T bd;
  std::uint32_t axis;
};

/// The layouts agree in all that does not depend on the cell: one copy, then two numbers.
template <class T>
COMPMARK_INLINE void to_cell(const WhiteSplat<T>& splat, T cell_x, T cell_y, CellSplat<T>& local) {
  static_assert(sizeof(WhiteSplat<T>) == sizeof(CellSplat<T>));
  const T x = cell_x - splat.u, y = cell_y - splat.v;
  std::memcpy(&local, &splat, sizeof(local));
  local.w0 = splat.wx * x + splat.wy * y;
  local.b0 = splat.bx * x + splat.by * y;
}

/// N packs that are computed in step: N independent chains of instructions next to each other, so that the processor
/// waits for none of them. (One chain after the other fills its scheduler with instructions that wait: measured 17.7
/// cycles a block and splat, in step 13.)
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

/// opacity * exp(-sigma) of N splats at W pixels: x, y their centres in the cell, `axis` where the pivot coordinate of
/// the first is.
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
  // Skipped lanes get alpha 0 before the transmittance comes in: the chain from splat to splat is one comparison and
  // one multiply-add.
  alpha = keep(met, alpha);
  const P before = transmittance;
  const P after = fma(-alpha, before, before);  // one rounding (docs/spec/numerics.md, BF2)
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

}  // namespace compmark::detail
