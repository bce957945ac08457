// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A camera and its lens as the kernels of projection want them, and a point of the world before them: u = fx U(x/z,
// y/z) + cx, v = fy V(x/z, y/z) + cy, where (U, V) is the lens, and M = J W = diag(fx, fy)/z K [1 0 -x/z; 0 1 -y/z] W,
// where K is the lens's Jacobian. A pinhole's is the unit matrix and is not computed. Cost: 25 flop a Gaussian for a
// pinhole, and what scene/lens_policy.hpp says for a lens.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/fisheye_pack.hpp"
#include "compmark/scene/lens_policy.hpp"
#include "compmark/scene/lens_rays.hpp"

namespace compmark {

namespace detail {

template <class T, class LensPolicy>
struct LensView {
  std::array<T, 9> rotation;
  std::array<T, 3> center, center_rest;  // center + center_rest is the centre in double (docs/spec/numerics.md, PR7)
  T fx, fy, cx, cy;
  T x_low, x_high, y_low, y_high;  // of x/z and y/z
  T width, height;
  [[no_unique_address]] LensPolicy lens;

  explicit LensView(const Camera<T>& camera, const LensPolicy& lens_policy = LensPolicy{})
      : rotation(camera.rotation_camera_world),
        center{},
        center_rest{},
        fx(camera.fx),
        fy(camera.fy),
        cx(camera.cx),
        cy(camera.cy),
        width(static_cast<T>(camera.width)),
        height(static_cast<T>(camera.height)),
        lens(lens_policy) {
    for (std::size_t i = 0; i < 3; ++i) {
      center[i] = static_cast<T>(camera.center_world[i]);
      if constexpr (sizeof(T) < sizeof(double))
        center_rest[i] = static_cast<T>(camera.center_world[i] - static_cast<double>(center[i]));
    }
    const T margin_x = T(0.3) * width / (2 * fx), margin_y = T(0.3) * height / (2 * fy);
    x_low = -(cx / fx + margin_x);
    x_high = (width - cx) / fx + margin_x;
    y_low = -(cy / fy + margin_y);
    y_high = (height - cy) / fy + margin_y;
    if constexpr (!is_pinhole_policy<LensPolicy>) {
      const RayLimits<T> rays = ray_limits(lens, RayLimits<T>{x_low, x_high, y_low, y_high});
      x_low = rays.x_low;
      x_high = rays.x_high;
      y_low = rays.y_low;
      y_high = rays.y_high;
    }
  }
};

template <class T>
using PinholeView = LensView<T, PinholeLens>;

/// A point in the camera frame and what perspective makes of it.
template <class P>
struct CameraPoint {
  std::array<P, 3> point;  // x, y, z; z is 1 in lanes that are culled
  typename P::MaskType
      in_front;  // z > near, false for NaN (docs/spec/numerics.md, PR1), and within what the lens maps one-to-one
  P inverse_z, x_over_z, y_over_z;
  P clamped_x, clamped_y;  // x/z and y/z within the limits of the Jacobian
};

template <class T, int W, class Lens>
[[nodiscard]] COMPMARK_INLINE CameraPoint<Pack<T, W>> camera_point(const LensView<T, Lens>& view,
                                                                   const std::array<Pack<T, W>, 3>& mean,
                                                                   T near_plane) {
  using P = Pack<T, W>;
  std::array<P, 3> d;
  for (std::size_t i = 0; i < 3; ++i)
    d[i] = (mean[i] - P(view.center[i])) - P(view.center_rest[i]);  // subtract first, rotate second
  CameraPoint<P> result;
  for (std::size_t i = 0; i < 3; ++i) {
    result.point[i] =
        fma(P(view.rotation[3 * i]), d[0], fma(P(view.rotation[3 * i + 1]), d[1], P(view.rotation[3 * i + 2]) * d[2]));
  }
  result.in_front = result.point[2] > P(near_plane);
  result.point[2] = select(result.in_front, result.point[2], P(T(1)));
  result.inverse_z = P(T(1)) / result.point[2];
  result.x_over_z = result.point[0] * result.inverse_z;
  result.y_over_z = result.point[1] * result.inverse_z;
  result.clamped_x = min(max(result.x_over_z, P(view.x_low)), P(view.x_high));
  result.clamped_y = min(max(result.y_over_z, P(view.y_low)), P(view.y_high));
  if constexpr (!is_pinhole_policy<Lens>) {
    result.in_front = result.in_front & view.lens.inside(result.x_over_z, result.y_over_z);
    // In a crop beside the axis the nearest ray of the box can lie outside the lens; the point's own never does.
    const auto usable = view.lens.inside(result.clamped_x, result.clamped_y);
    result.clamped_x = select(usable, result.clamped_x, result.x_over_z);
    result.clamped_y = select(usable, result.clamped_y, result.y_over_z);
  }
  return result;
}

/// The lens at the ray and at the clamped ray. Nothing for a pinhole.
struct NoLensPoint {};
template <class P>
struct LensPoint {
  LensPlane<P> ray, clamped;
};

template <class T, int W, class Lens>
[[nodiscard]] COMPMARK_INLINE auto lens_point(const LensView<T, Lens>& view, const CameraPoint<Pack<T, W>>& at) {
  if constexpr (is_pinhole_policy<Lens>) {
    return NoLensPoint{};
  } else {
    LensPoint<Pack<T, W>> result;
    result.ray = plane_of(view.lens, at.x_over_z, at.y_over_z);
    result.clamped = result.ray;
    if (any(!((at.clamped_x == at.x_over_z) & (at.clamped_y == at.y_over_z))))
      result.clamped = plane_of(view.lens, at.clamped_x, at.clamped_y);
    return result;
  }
}

template <class P>
struct ScreenPoint {
  P u, v;
};

template <class T, int W, class Lens, class Bent>
[[nodiscard]] COMPMARK_INLINE ScreenPoint<Pack<T, W>> screen_point(const LensView<T, Lens>& view,
                                                                   const CameraPoint<Pack<T, W>>& at,
                                                                   const Bent& bent) {
  using P = Pack<T, W>;
  if constexpr (is_pinhole_policy<Lens>) {
    return {fma(P(view.fx), at.x_over_z, P(view.cx)), fma(P(view.fy), at.y_over_z, P(view.cy))};
  } else {
    return {fma(P(view.fx), bent.ray.u, P(view.cx)), fma(P(view.fy), bent.ray.v, P(view.cy))};
  }
}

/// M = J W, 2 x 3 row-major: from a world displacement to pixels, at the clamped direction.
template <class T, int W, class Lens, class Bent = NoLensPoint>
[[nodiscard]] COMPMARK_INLINE std::array<Pack<T, W>, 6> screen_jacobian(const LensView<T, Lens>& view,
                                                                        const CameraPoint<Pack<T, W>>& at,
                                                                        const Bent& bent = Bent{}) {
  using P = Pack<T, W>;
  const P jx = P(view.fx) * at.inverse_z, jy = P(view.fy) * at.inverse_z;
  std::array<P, 6> m;
  for (std::size_t i = 0; i < 3; ++i) {
    if constexpr (is_pinhole_policy<Lens>) {
      m[i] = jx * fma(-at.clamped_x, P(view.rotation[6 + i]), P(view.rotation[i]));
      m[3 + i] = jy * fma(-at.clamped_y, P(view.rotation[6 + i]), P(view.rotation[3 + i]));
    } else {
      const P x = fma(-at.clamped_x, P(view.rotation[6 + i]), P(view.rotation[i]));
      const P y = fma(-at.clamped_y, P(view.rotation[6 + i]), P(view.rotation[3 + i]));
      m[i] = jx * fma(bent.clamped.u_a, x, bent.clamped.u_b * y);
      m[3 + i] = jy * fma(bent.clamped.u_b, x, bent.clamped.v_b * y);
    }
  }
  return m;
}

}  // namespace detail
}  // namespace compmark
