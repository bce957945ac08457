// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a rasterizer simulates between a Gaussian and its splat, as one compile-time policy: the lens, and the filter of
// what is smaller than a pixel. An effect that is not named has no member, no branch and no instruction. Cost of the
// mip filter (docs/spec/numerics.md, CV6): ~12 flop and a square root a Gaussian forward, ~40 flop backward; nothing
// per pixel.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/math/pack.hpp"
#include "compmark/scene/lens_policy.hpp"

namespace compmark {

/// The blur of the footprint is all there is: a splat below a pixel keeps its opacity over an area that has grown, and
/// is drawn too bright.
struct NoFilter {
  static constexpr bool active = false;
  template <class P>
  [[nodiscard]] static COMPMARK_INLINE P opacity(P opacity, const std::array<P, 6>&, P) {
    return opacity;
  }
};

namespace detail {

/// m = V0 x V1 of the two rows of V; |m|^2 = det(V V^T).
template <class P>
[[nodiscard]] COMPMARK_INLINE std::array<P, 3> rows_cross(const std::array<P, 6>& v) {
  return {v[1] * v[5] - v[2] * v[4], v[2] * v[3] - v[0] * v[5], v[0] * v[4] - v[1] * v[3]};
}
template <class P>
[[nodiscard]] COMPMARK_INLINE P squared_length(P x, P y, P z) {
  return fma(x, x, fma(y, y, z * z));
}

/// rho^2 is not taken below this: a flat splat keeps 1/200 of its opacity, and a gradient there would point nowhere
/// (docs/spec/numerics.md, CV6).
inline constexpr double mip_floor = 2.5e-5;

}  // namespace detail

/// The screen-space part of Mip-Splatting: opacity is multiplied by rho = sqrt(det(V V^T) / det(V V^T + e I)), e the
/// blur variance, so that the blur spreads a splat without adding to it. The published filter takes e = 0.1 pixels^2
/// (Settings::blur_variance); images of a model trained with it look wrong without it. Both determinants are sums of
/// squares, so their ratio has no cancellation and is never negative.
struct MipFilter {
  static constexpr bool active = true;

  /// The opacity that is drawn; `determinant` is that of V V^T + e I.
  template <class P>
  [[nodiscard]] static COMPMARK_INLINE P opacity(P opacity, const std::array<P, 6>& v, P determinant) {
    return opacity * sqrt(ratio(squared(v), determinant));
  }
  /// d(ln rho)/dV = e ((tr + e) / |m|^2 [V1 x m, m x V0] - V) / det, tr = |V0|^2 + |V1|^2; 0 at the floor.
  template <class P>
  [[nodiscard]] static COMPMARK_INLINE std::array<P, 6> log_gradient(const std::array<P, 6>& v, P determinant,
                                                                     typename P::Scalar blur_variance) {
    const P e(blur_variance);
    const std::array<P, 3> m = detail::rows_cross(v);
    const P m2 = squared(v),
            trace = detail::squared_length(v[0], v[1], v[2]) + detail::squared_length(v[3], v[4], v[5]);
    const auto above = m2 / determinant > floor<P>();
    const P factor = keep(above, e / determinant), turn = keep(above, (trace + e) / m2);
    return {factor * (turn * (v[4] * m[2] - v[5] * m[1]) - v[0]), factor * (turn * (v[5] * m[0] - v[3] * m[2]) - v[1]),
            factor * (turn * (v[3] * m[1] - v[4] * m[0]) - v[2]), factor * (turn * (m[1] * v[2] - m[2] * v[1]) - v[3]),
            factor * (turn * (m[2] * v[0] - m[0] * v[2]) - v[4]), factor * (turn * (m[0] * v[1] - m[1] * v[0]) - v[5])};
  }

 private:
  template <class P>
  [[nodiscard]] static COMPMARK_INLINE P floor() {
    return P(static_cast<typename P::Scalar>(detail::mip_floor));
  }
  template <class P>
  [[nodiscard]] static COMPMARK_INLINE P squared(const std::array<P, 6>& v) {
    const std::array<P, 3> m = detail::rows_cross(v);
    return detail::squared_length(m[0], m[1], m[2]);
  }
  template <class P>
  [[nodiscard]] static COMPMARK_INLINE P ratio(P m2, P determinant) {
    const P quotient = m2 / determinant;
    return select(quotient > floor<P>(), quotient, floor<P>());  // 0/0 without blur is the floor as well
  }
};

/// The effects of a rasterizer. `LensPolicy` is a type of scene/lens_policy.hpp, whose numbers are in the rasterizer's
/// Settings; `FilterPolicy` is NoFilter or MipFilter.
template <class LensPolicy = PinholeLens, class FilterPolicy = NoFilter>
struct RasterEffects {
  using Lens = LensPolicy;
  using Filter = FilterPolicy;
};

using NoRasterEffects = RasterEffects<>;

}  // namespace compmark
