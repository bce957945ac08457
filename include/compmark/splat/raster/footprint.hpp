// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The footprint of one Gaussian on the screen (docs/spec/method.md, 2.1, in the robust form of docs/spec/numerics.md,
// CV1 and CV2): from V = J W R(q) diag(s), 2 x 3, without ever forming a 3D covariance, a conic or a difference that
// cancels (cases CV1, CV2). Written on packs, one Gaussian a lane, ~190 flop; projection and its backward call the same
// functions.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/lens_view.hpp"

namespace compmark {

/// Run-time numbers of projection.
template <class T, class Lens = PinholeLens>
struct ProjectionSettings {
  T near_plane = T(0.2);              ///< world units; a Gaussian is kept where camera z > near_plane
  T blur_variance = T(0.3);           ///< low-pass filter: added to both variances, pixels^2
  [[no_unique_address]] Lens lens{};  ///< nothing for a pinhole
};

namespace detail {

/// Largest element of V: sqrt of what keeps det = |V0 x V1|^2 finite in float (docs/spec/numerics.md, PR2).
inline constexpr double footprint_limit = 1e9;
/// Scales above are taken as this, so that V itself cannot overflow before it is limited.
inline constexpr double scale_limit = 1e25;
/// Colours are scrubbed to this magnitude (docs/spec/numerics.md, BF9).
inline constexpr double color_limit = 100;
/// Smaller colours are blended as 0: times a weight and a gradient they would be denormal (docs/spec/numerics.md, SY4).
/// Their own gradient passes.
inline constexpr double color_floor = 1e-20;

/// ln x for positive normal x: Cephes' split at sqrt(1/2) and degree 8 in float, 1 ulp; std::log for the other scalars.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> log_positive(Pack<T, W> x) {
  using P = Pack<T, W>;
  if constexpr (std::is_same_v<T, float> && W > 1) {
    using Integers = typename LaneStorage<std::int32_t, W>::type;
    const Integers bits = (Integers)x.native;
    const Integers shifted =
        bits - 0x3F3504F3;  // the bits of sqrt(1/2): the mantissa then lies in [sqrt(1/2), sqrt(2))
    const Integers exponent = shifted >> 23;
    const P e = P::from_native(__builtin_convertvector(exponent, typename P::Native));
    const P f = P::from_native((typename P::Native)(bits - (exponent << 23))) - P(1.0f);
    const P z = f * f;
    P r = fma(P(7.0376836292e-2f), f, P(-1.1514610310e-1f));
    r = fma(r, f, P(1.1676998740e-1f));
    r = fma(r, f, P(-1.2420140846e-1f));
    r = fma(r, f, P(1.4249322787e-1f));
    r = fma(r, f, P(-1.6668057665e-1f));
    r = fma(r, f, P(2.0000714765e-1f));
    r = fma(r, f, P(-2.4999993993e-1f));
    r = fma(r, f, P(3.3333331174e-1f));
    r = fma(r * f, z, e * P(-2.12194440e-4f));
    r = fma(P(-0.5f), z, r);
    return fma(e, P(0.693359375f), f + r);
  } else {
    P result;
    for (int i = 0; i < W; ++i) result.set(i, std::log(x.lane(i)));
    return result;
  }
}

/// Row-major rotation of the quaternion (w, x, y, z), used as given (it must be a unit quaternion).
template <class P>
[[nodiscard]] COMPMARK_INLINE std::array<P, 9> quaternion_matrix(const std::array<P, 4>& q) {
  using T = typename P::Scalar;
  const P one(T(1)), two(T(2));
  const P x2 = two * q[1], y2 = two * q[2], z2 = two * q[3];
  const P wx = q[0] * x2, wy = q[0] * y2, wz = q[0] * z2, xx = q[1] * x2, xy = q[1] * y2, xz = q[1] * z2,
          yy = q[2] * y2, yz = q[2] * z2, zz = q[3] * z2;
  return {one - (yy + zz), xy - wz, xz + wy, xy + wz, one - (xx + zz), yz - wx, xz - wy, yz + wx, one - (xx + yy)};
}

/// B = M R(q) and V = B diag(s), both 2 x 3 row-major. V is limited in size; `shrink` is the factor that did it (1
/// nearly always).
template <class P>
struct ScreenAxes {
  std::array<P, 6> unit, v;
  P shrink;
};

template <class P>
[[nodiscard]] COMPMARK_INLINE ScreenAxes<P> screen_axes(const std::array<P, 6>& m, const std::array<P, 9>& r,
                                                        const std::array<P, 3>& scale) {
  using T = typename P::Scalar;
  ScreenAxes<P> axes;
  P largest(T(0));
  for (std::size_t row = 0; row < 2; ++row) {
    for (std::size_t j = 0; j < 3; ++j) {
      const P b = fma(m[3 * row], r[j], fma(m[3 * row + 1], r[3 + j], m[3 * row + 2] * r[6 + j]));
      axes.unit[3 * row + j] = b;
      axes.v[3 * row + j] = b * min(scale[j], P(static_cast<T>(scale_limit)));
      largest = max(abs(axes.v[3 * row + j]), largest);
    }
  }
  const P limit(static_cast<T>(footprint_limit));
  axes.shrink = P(T(1));
  if (any(largest > limit)) {
    axes.shrink = select(largest > limit, limit / largest, P(T(1)));
    for (P& v : axes.v) v *= axes.shrink;
  }
  return axes;
}

/// The screen covariance V V^T + e I in conditional form (see splat.hpp).
template <class P>
struct Footprint {
  P variance_x, covariance, variance_y;
  // > 0 always: a sum of squares and products of positives (Cauchy and Binet, docs/spec/numerics.md, CV1)
  P determinant;
  typename P::MaskType pivot_x;
  P slope, major, minor;
};

/// Fills slope, major and minor for the pivot axis that `pivot_x` names.
template <class P>
COMPMARK_INLINE void conditional_form(Footprint<P>& f) {
  using T = typename P::Scalar;
  const P pivot = select(f.pivot_x, f.variance_x, f.variance_y);
  const P inverse = P(T(1)) / pivot;
  f.slope = f.covariance * inverse;
  f.minor = P(T(0.5)) * inverse;
  f.major = P(T(0.5)) * pivot / f.determinant;
}

template <class P>
[[nodiscard]] COMPMARK_INLINE Footprint<P> footprint_of(const std::array<P, 6>& v, typename P::Scalar blur_variance) {
  const P e(blur_variance);
  const P m0 = v[1] * v[5] - v[2] * v[4], m1 = v[2] * v[3] - v[0] * v[5], m2 = v[0] * v[4] - v[1] * v[3];
  const P xx = fma(v[0], v[0], fma(v[1], v[1], v[2] * v[2]));
  const P yy = fma(v[3], v[3], fma(v[4], v[4], v[5] * v[5]));
  Footprint<P> f;
  f.covariance = fma(v[0], v[3], fma(v[1], v[4], v[2] * v[5]));
  f.variance_x = xx + e;
  f.variance_y = yy + e;
  f.determinant = fma(m0, m0, fma(m1, m1, m2 * m2)) + e * (xx + yy) + e * e;
  f.pivot_x = f.variance_x > f.variance_y;
  conditional_form(f);
  return f;
}

/// x as an index in [0, limit]; NaN goes to 0. The only cast from float to int of the rasterizer
/// (docs/spec/numerics.md, TB1).
template <class T>
[[nodiscard]] inline int clamp_to_index(T x, int limit) {
  const T above = x > T(0) ? x : T(0);  // two steps without a branch
  const T top = static_cast<T>(limit);
  return static_cast<int>(above < top ? above : top);
}

/// Half-open rectangle of tiles.
struct TileRectangle {
  int x_begin, y_begin, x_end, y_end;
  [[nodiscard]] bool empty() const { return x_begin >= x_end || y_begin >= y_end; }
};

/// Tiles with a pixel centre in the box (u +- half_width, v +- half_height); under the published rule the square's
/// whole tiles, with the published rounding (docs/spec/method.md, 2.1, step 8; its pixel centres are integers, hence
/// the half).
template <FootprintRule rule, int tile_size, class T>
[[nodiscard]] inline TileRectangle tile_rectangle(T u, T v, T half_width, T half_height, int width, int height) {
  const int tiles_x = (width + tile_size - 1) / tile_size, tiles_y = (height + tile_size - 1) / tile_size;
  if constexpr (rule == FootprintRule::square_three_sigma) {
    const T x = u - pixel_center<T>, y = v - pixel_center<T>;
    const TileRectangle r{clamp_to_index((x - half_width) / tile_size, tiles_x),
                          clamp_to_index((y - half_height) / tile_size, tiles_y),
                          clamp_to_index((x + half_width + (tile_size - 1)) / tile_size, tiles_x),
                          clamp_to_index((y + half_height + (tile_size - 1)) / tile_size, tiles_y)};
    return r.empty() ? TileRectangle{0, 0, 0, 0} : r;
  } else {
    // First and one past the last pixel whose centre is inside, then whole tiles. Empty when no centre is inside.
    const int x0 = clamp_to_index(std::ceil(u - half_width - pixel_center<T>), width),
              x1 = clamp_to_index(std::floor(u + half_width + pixel_center<T>), width);
    const int y0 = clamp_to_index(std::ceil(v - half_height - pixel_center<T>), height),
              y1 = clamp_to_index(std::floor(v + half_height + pixel_center<T>), height);
    if (x0 >= x1 || y0 >= y1) return {0, 0, 0, 0};
    return {x0 / tile_size, y0 / tile_size, (x1 + tile_size - 1) / tile_size, (y1 + tile_size - 1) / tile_size};
  }
}

}  // namespace detail
}  // namespace compmark
