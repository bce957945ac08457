// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What projection and binning hand to the pixel loop: the splats in depth order, and for each tile the splats that can
// reach it. 64 bytes a splat; 8 bytes a (splat, tile) pair.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/splat.hpp"

namespace compmark {

/// The visible splats of one view. `splats[0 .. count)` is in depth order, front to back, ties by index of the input
/// Gaussian.
template <class T>
struct ProjectedSplats {
  Buffer<Splat<T>> splats;       ///< [count]
  Buffer<std::uint32_t> source;  ///< [count] input Gaussian of splat i
  Buffer<std::uint8_t> visible;  ///< [gaussians] 1 where the footprint overlaps the image
  Buffer<std::uint32_t>
      place;  ///< [gaussians] index into splats, bit 31 set when the pivot axis is x; `nowhere` when not visible
  std::size_t count = 0;
  std::size_t gaussians = 0;

  static constexpr std::uint32_t nowhere = 0xFFFFFFFFu;
  static constexpr std::uint32_t pivot_bit = 0x80000000u;
};

/// Per tile (row-major over the grid) the splats that reach it, front to back: the pairs. They are also numbered splat
/// by splat (tiles row-major within a splat), and `position` says where pair number s lies in `splat`, so that a sum
/// over the pairs of splat i is a walk over position[first_slot[i]] ... position[first_slot[i + 1] - 1], in the same
/// order at any thread count.
struct TileLists {
  int tiles_x = 0, tiles_y = 0;
  Buffer<std::size_t> begin;       ///< [tiles + 1] range of each tile in `splat`
  Buffer<std::uint32_t> splat;     ///< [pairs] index into ProjectedSplats::splats, ascending in each tile
  Buffer<std::uint32_t> position;  ///< [pairs] index into `splat`
  Buffer<std::size_t> first_slot;  ///< [count + 1]
  std::size_t pairs = 0;
};

/// Width of the C1 ramp of CutoffRule::smooth, centred on alpha_min.
inline constexpr double smooth_cutoff_width = 1e-3;

/// The smallest alpha that contributes: alpha_min, or the foot of the ramp under CutoffRule::smooth. 0 means that
/// nothing is cut.
template <class T>
[[nodiscard]] constexpr T cutoff_floor(const Accuracy& accuracy) {
  const double floor =
      static_cast<double>(accuracy.alpha_min) - (accuracy.cutoff == CutoffRule::smooth ? smooth_cutoff_width / 2 : 0);
  return floor > 0 ? static_cast<T>(floor) : T(0);
}

/// alpha after the smooth cut-off, and its derivative by alpha: alpha * s(x), s(x) = x^2 (3 - 2 x), x = (alpha - floor)
/// / width in [0, 1]. Scalars only: finite-difference tests (docs/spec/numerics.md, BF4). Identity where alpha_min is
/// 0.
template <class T>
struct SmoothCutoff {
  T value, derivative;
};
template <class T>
[[nodiscard]] constexpr SmoothCutoff<T> smooth_cutoff(T alpha, T alpha_min) {
  if (!(alpha_min > T(0))) return {alpha, T(1)};
  const T width = static_cast<T>(smooth_cutoff_width);
  const T x = (alpha - (alpha_min - width / 2)) / width;
  if (!(x > T(0))) return {T(0), T(0)};
  if (x >= T(1)) return {alpha, T(1)};
  return {alpha * x * x * (3 - 2 * x), x * x * (3 - 2 * x) + alpha * 6 * x * (1 - x) / width};
}

}  // namespace compmark
