// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which anchors a view may see (docs/spec/method.md, 1.4; no gradient): each anchor is taken as one Gaussian with
// scales exp(S[0:3]) along the world axes and projected as the rasterizer does; it is visible if it lies beyond the
// near plane and the square of its published radius meets a tile of the image. Opacity plays no role. The projection
// goes through V = J R diag(s), never through the 3-D covariance, and its entries are bounded, so that a giant is
// visible (docs/spec/numerics.md, PR2) and a NaN is not (PR1). Lanes are anchors. Cost: about 110 operations and 36
// bytes an anchor. Through a lens the same test is made where the lens puts the anchor, and errs on the side of seeing
// it: the footprint is the larger of the lens's and the pinhole's, and an anchor beyond the rays that the lens maps
// one-to-one is looked for at the last of them if its footprint reaches there, because its Gaussians may lie inside.
// Cost: 60 operations more, and what scene/lens_policy.hpp says.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/fisheye_pack.hpp"
#include "compmark/scene/lens_policy.hpp"
#include "compmark/scene/lens_rays.hpp"
#include "compmark/splat/anchor/concept.hpp"
#include "compmark/splat/anchor/view_point.hpp"

namespace compmark {

struct VisibilitySettings {
  double near_plane = 0.2;  ///< camera z at or below which nothing is visible, world units
  double blur = 0.3;        ///< variance added to the footprint, square pixels
};

/// Scratch of visible_anchors: grow-only.
struct VisibilityWorkspace {
  Buffer<std::uint32_t> found;  // [chunks * grain]
  Buffer<std::uint32_t> count;  // [chunks + 1], afterwards the first row of each chunk
};

namespace detail {

/// The camera in the form the kernel needs; see the fields' use in visible_lanes.
template <class T, class Lens = PinholeLens>
struct VisibilityCamera {
  ViewPoint<T> from;
  T rotation[9];
  T fx, fy, cx, cy;
  T least_x, most_x, least_y, most_y;  // limits of x/z and y/z in the Jacobian (docs/spec/numerics.md, PR4)
  T tiles_x, tiles_y;
  T near_plane, blur;
  [[no_unique_address]] Lens lens;

  VisibilityCamera(const Camera<T>& camera, const VisibilitySettings& settings, const Lens& lens_policy = {})
      : from(camera.center_world, 0),
        fx(camera.fx),
        fy(camera.fy),
        cx(camera.cx),
        cy(camera.cy),
        tiles_x(static_cast<T>((camera.width + 15) / 16)),
        tiles_y(static_cast<T>((camera.height + 15) / 16)),
        near_plane(static_cast<T>(settings.near_plane)),
        blur(static_cast<T>(settings.blur)),
        lens(lens_policy) {
    for (std::size_t i = 0; i < 9; ++i) rotation[i] = camera.rotation_camera_world[i];
    const T width = static_cast<T>(camera.width), height = static_cast<T>(camera.height);
    const T margin_x = T(0.15) * width / fx,
            margin_y = T(0.15) * height / fy;  // 0.3 of the tangent of half the field of view
    least_x = -cx / fx - margin_x;
    most_x = (width - cx) / fx + margin_x;
    least_y = -cy / fy - margin_y;
    most_y = (height - cy) / fy + margin_y;
    if constexpr (!is_pinhole_policy<Lens>) {
      const RayLimits<T> rays = ray_limits(lens, RayLimits<T>{least_x, most_x, least_y, most_y});
      least_x = rays.x_low;
      most_x = rays.x_high;
      least_y = rays.y_low;
      most_y = rays.y_high;
    }
  }
};

template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> floor_of_positive(Pack<T, W> x) {
  const Pack<T, W> nearest = round_to_even(x);
  return select(nearest > x, nearest - Pack<T, W>(T(1)), nearest);
}

/// Tiles [first, last) of the interval centre +- radius, along one axis; false where there are none.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Mask<T, W> meets_tiles(Pack<T, W> center, Pack<T, W> radius, T tiles) {
  using P = Pack<T, W>;
  // min and max give their second argument where the first is NaN.
  const P low = min(max((center - radius) * P(T(1) / 16), P(T(0))), P(tiles));
  const P high = min(max((center + radius + P(T(15))) * P(T(1) / 16), P(T(0))), P(tiles));
  return floor_of_positive(low) < floor_of_positive(high);
}

/// A footprint's variances: entries are bounded and blurred, the larger eigenvalue never loses digits (0.1 as
/// published).
template <class P>
struct AnchorFootprint {
  P xx{typename P::Scalar(0)}, yy{typename P::Scalar(0)}, xy{typename P::Scalar(0)};

  COMPMARK_INLINE void add(P x, P y) {
    xx = fma(x, x, xx);
    yy = fma(y, y, yy);
    xy = fma(x, y, xy);
  }
  [[nodiscard]] COMPMARK_INLINE P largest(P blur) const {
    using T = typename P::Scalar;
    const P bound(T(1e18));  // its square is finite in float
    const P x = min(xx, bound) + blur, y = min(yy, bound) + blur;
    const P mixed = max(min(xy, bound), -bound);
    const P half = P(T(0.5)) * (x - y);
    const P spread = max(fma(half, half, mixed * mixed), P(T(0.1)));  // mid^2 - det without the cancellation
    return P(T(0.5)) * (x + y) + sqrt(spread);
  }
};

/// Three standard deviations, rounded up to whole pixels.
template <class P>
[[nodiscard]] COMPMARK_INLINE P published_radius(P largest) {
  using T = typename P::Scalar;
  const P reach = P(T(3)) * sqrt(largest), below = floor_of_positive(reach);
  return select(below < reach, below + P(T(1)), below);
}

/// The ray nearest to (a, b) that the lens maps one-to-one, a hair inside; (a, b) itself where it does.
template <class P, class Lens>
[[nodiscard]] COMPMARK_INLINE std::array<P, 2> ray_within(const Lens& lens, P a, P b) {
  using T = typename P::Scalar;
  const P far(T(1e9));  // its square is finite in float
  a = max(min(a, far), -far);
  b = max(min(b, far), -far);
  const P q = fma(a, a, b * b), limit2(lens.limit2 * T(0.9999));
  const P factor = select(q > limit2, sqrt(limit2 / max(q, P(T(1e-30)))), P(T(1)));
  return {a * factor, b * factor};
}

template <class T, int W, class Lens>
[[nodiscard]] COMPMARK_INLINE Mask<T, W> visible_lanes(const VisibilityCamera<T, Lens>& camera,
                                                       const Pack<T, W> (&position)[3],
                                                       const Pack<T, W> (&log_scale)[3]) {
  using P = Pack<T, W>;
  P world[3], view[3];
  for (int i = 0; i < 3; ++i) world[i] = (position[i] - P(camera.from.high[i])) - P(camera.from.low[i]);
  for (int i = 0; i < 3; ++i) {
    const T* const row = camera.rotation + 3 * i;
    view[i] = fma(P(row[0]), world[0], fma(P(row[1]), world[1], P(row[2]) * world[2]));
  }
  Mask<T, W> visible = view[2] > P(camera.near_plane);
  const P finite = (view[0] + view[1] + view[2] + log_scale[0] + log_scale[1] + log_scale[2]) * P(T(0));
  visible = visible & (finite == P(T(0)));
  if (!any(visible)) return visible;

  const P inverse_z = P(T(1)) / view[2];
  const P tangent_x = view[0] * inverse_z, tangent_y = view[1] * inverse_z;
  const P slope_x = min(max(tangent_x, P(camera.least_x)), P(camera.most_x));
  const P slope_y = min(max(tangent_y, P(camera.least_y)), P(camera.most_y));
  if constexpr (is_pinhole_policy<Lens>) {
    const P scale_x = P(camera.fx) * inverse_z, scale_y = P(camera.fy) * inverse_z;
    AnchorFootprint<P> footprint;
    for (int axis = 0; axis < 3; ++axis) {
      const P s = exp(log_scale[axis]);
      const P depth(camera.rotation[6 + axis]);
      footprint.add(scale_x * fnma(slope_x, depth, P(camera.rotation[axis])) * s,
                    scale_y * fnma(slope_y, depth, P(camera.rotation[3 + axis])) * s);
    }
    const P radius = published_radius(footprint.largest(P(camera.blur)));
    // The published pixel centres are at integers: pixel = u - 1/2.
    const P pixel_x = fma(P(camera.fx), tangent_x, P(camera.cx - pixel_center<T>));
    const P pixel_y = fma(P(camera.fy), tangent_y, P(camera.cy - pixel_center<T>));
    return visible & meets_tiles(pixel_x, radius, camera.tiles_x) & meets_tiles(pixel_y, radius, camera.tiles_y);
  } else {
    const std::array<P, 2> ray = ray_within(camera.lens, tangent_x, tangent_y);
    // As the rasterizer does: in a crop beside the axis the nearest ray of the box can lie outside the lens, the
    // anchor's own then serves.
    const auto usable = camera.lens.inside(slope_x, slope_y);
    const LensPlane<P> at = plane_of(camera.lens, ray[0], ray[1]);
    const P x = select(usable, slope_x, ray[0]), y = select(usable, slope_y, ray[1]);
    const LensPlane<P> bent = plane_of(camera.lens, x, y);
    AnchorFootprint<P> straight, through;
    for (int axis = 0; axis < 3; ++axis) {
      const P s = exp(log_scale[axis]) * inverse_z;
      const P depth(camera.rotation[6 + axis]);
      const P vx = fnma(x, depth, P(camera.rotation[axis])) * s, vy = fnma(y, depth, P(camera.rotation[3 + axis])) * s;
      straight.add(P(camera.fx) * vx, P(camera.fy) * vy);
      through.add(P(camera.fx) * fma(bent.u_a, vx, bent.u_b * vy), P(camera.fy) * fma(bent.u_b, vx, bent.v_b * vy));
    }
    const P blur(camera.blur);
    // The published count of tiles misses the first row and column of pixels by up to one: it is given that pixel here.
    const P radius = published_radius(max(straight.largest(blur), through.largest(blur))) + P(T(1));
    const P beyond_x = (tangent_x - ray[0]) * P(camera.fx), beyond_y = (tangent_y - ray[1]) * P(camera.fy);
    visible = visible & (fma(beyond_x, beyond_x, beyond_y * beyond_y) <= radius * radius);
    const P pixel_x = fma(P(camera.fx), at.u, P(camera.cx - pixel_center<T>));
    const P pixel_y = fma(P(camera.fy), at.v, P(camera.cy - pixel_center<T>));
    return visible & meets_tiles(pixel_x, radius, camera.tiles_x) & meets_tiles(pixel_y, radius, camera.tiles_y);
  }
}

}  // namespace detail

/// Rows of the visible anchors in ascending order; `visible` is resized to their count. W lanes, any width gives the
/// same list. `lens` is the lens of the camera.
template <class T, int W = native_width<T>, Executor E, class Lens = PinholeLens>
void visible_anchors(const AnchorColumns<const T>& anchors, const Camera<T>& camera, const VisibilitySettings& settings,
                     Buffer<std::uint32_t>& visible, VisibilityWorkspace& workspace, E& executor,
                     const Lens& lens = {}) {
  using P = Pack<T, W>;
  constexpr std::size_t grain = 2048;
  const std::size_t n = anchors.rows();
  const std::size_t chunks = chunk_count(n, grain);
  workspace.found.resize(chunks * grain);
  workspace.count.resize(chunks + 1);
  const detail::VisibilityCamera<T, Lens> view(camera, settings, lens);
  executor.for_chunks(n, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    std::int32_t row3[W], row6[W];  // offsets of the lanes' rows
    std::uint32_t* const found = workspace.found.data() + begin;
    std::uint32_t count = 0;
    for (std::size_t first = begin; first < end; first += W) {
      const int lanes = end - first < W ? static_cast<int>(end - first) : W;
      for (int lane = 0; lane < W; ++lane) {  // lanes beyond the end read the last row again
        const int used = lane < lanes ? lane : lanes - 1;
        row3[lane] = 3 * used;
        row6[lane] = 6 * used;
      }
      P position[3], scaling[3];
      for (std::size_t i = 0; i < 3; ++i) {
        position[i] = P::gather(anchors.position.row(first) + i, row3);
        scaling[i] = P::gather(anchors.scaling.row(first) + i, row6);
      }
      unsigned bits =
          detail::visible_lanes<T, W, Lens>(view, position, scaling).bits() & Mask<T, W>::first(lanes).bits();
      for (; bits != 0; bits &= bits - 1)
        found[count++] = static_cast<std::uint32_t>(first) + static_cast<std::uint32_t>(__builtin_ctz(bits));
    }
    workspace.count[begin / grain] = count;
  });
  std::uint32_t total = 0;
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    const std::uint32_t count = workspace.count[chunk];
    workspace.count[chunk] = total;
    total += count;
  }
  workspace.count[chunks] = total;
  visible.resize(total);
  executor.for_chunks(chunks, 8, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t chunk = begin; chunk < end; ++chunk) {
      const std::uint32_t row = workspace.count[chunk];
      for (std::uint32_t i = row; i < workspace.count[chunk + 1]; ++i)
        visible[i] = workspace.found[chunk * grain + (i - row)];
    }
  });
}

}  // namespace compmark
