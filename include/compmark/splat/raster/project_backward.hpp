// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Backward of projection: from the eight sums a splat collected over its pixels to the 14 columns of its Gaussian.
// Nothing is inverted (docs/spec/numerics.md, CV3): with v = dsigma/dd and g = -dL/dsigma, dL/dmean2D = sum g v and
// dL/dV = [sum g v v^T] V. What forward knew is computed again (~190 flop) rather than stored. Cost: ~450 flop; reads
// 44 + 64 bytes, reads and writes 56 bytes a Gaussian.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/gradient_mode.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/footprint.hpp"
#include "compmark/splat/raster/lens_view.hpp"
#include "compmark/splat/raster/project.hpp"
#include "compmark/splat/raster/projected.hpp"
#include "compmark/splat/raster/splat.hpp"
#include "compmark/splat/raster/transpose.hpp"

namespace compmark {

namespace detail {

/// Gradients of u, v and of the three distinct entries of [sum g v v^T], from the sums in the (a, b) frame of the
/// conditional form.
template <class P>
struct ScreenGradient {
  P u, v, xx, xy, yy;
};

template <class P>
[[nodiscard]] COMPMARK_INLINE ScreenGradient<P> screen_gradient(const Footprint<P>& f, P g_w, P g_b, P g_ww, P g_wb,
                                                                P g_bb) {
  using T = typename P::Scalar;
  const P across = P(T(2)) * f.major, along = P(T(2)) * f.minor, k = f.slope;
  const P a = across * g_w, b = along * g_b - k * a;
  const P aa = across * across * g_ww, cross = across * along * g_wb;
  const P ab = cross - k * aa, bb = along * along * g_bb - k * (cross + ab);
  return {select(f.pivot_x, b, a), select(f.pivot_x, a, b), select(f.pivot_x, bb, aa), ab, select(f.pivot_x, aa, bb)};
}

/// dL/dM (2 x 3) to the camera point, through M = J W. `clamped` lanes: the Jacobian saw the limit instead of x/z
/// (docs/spec/numerics.md, PR3); the published backward keeps the factor 2 of the unclamped term there.
template <bool published, class T, int W>
COMPMARK_INLINE void add_jacobian_gradient(const PinholeView<T>& view, const CameraPoint<Pack<T, W>>& at,
                                           const std::array<Pack<T, W>, 6>& d_m, std::array<Pack<T, W>, 3>& d_point) {
  using P = Pack<T, W>;
  const auto row = [&](std::size_t axis, T focal, P clamped, P unclamped) {
    P d_diagonal(T(0)), d_third(T(0));
    for (std::size_t k = 0; k < 3; ++k) {
      d_diagonal = fma(d_m[3 * axis + k], P(view.rotation[3 * axis + k]), d_diagonal);
      d_third = fma(d_m[3 * axis + k], P(view.rotation[6 + k]), d_third);
    }
    const P scale = P(focal) * at.inverse_z * at.inverse_z;
    const auto free = clamped == unclamped;
    const P factor = published ? P(T(2)) : select(free, P(T(2)), P(T(1)));
    d_point[axis] -= keep(free, scale * d_third);
    d_point[2] += scale * (factor * clamped * d_third - d_diagonal);
  };
  row(0, view.fx, at.clamped_x, at.x_over_z);
  row(1, view.fy, at.clamped_y, at.y_over_z);
}

/// The same with a lens, M = diag(fx, fy)/z K [1 0 -a; 0 1 -b] W at the clamped ray (a, b), and through the mean on the
/// screen. There is no published backward with a lens.
template <class T, int W, class Lens>
COMPMARK_INLINE void add_lens_gradient(const LensView<T, Lens>& view, const CameraPoint<Pack<T, W>>& at,
                                       const LensPoint<Pack<T, W>>& bent, Pack<T, W> d_u, Pack<T, W> d_v,
                                       const std::array<Pack<T, W>, 6>& d_m, std::array<Pack<T, W>, 3>& d_point) {
  using P = Pack<T, W>;
  std::array<P, 6> g;  // dL/dJ without the focal length, J = M W^T
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const P focal(axis == 0 ? view.fx : view.fy);
    for (std::size_t j = 0; j < 3; ++j) {
      P sum(T(0));
      for (std::size_t k = 0; k < 3; ++k) sum = fma(d_m[3 * axis + k], P(view.rotation[3 * j + k]), sum);
      g[3 * axis + j] = focal * sum;
    }
  }
  const LensPlane<P>& c = bent.clamped;
  const P m00 = g[0] - g[2] * at.clamped_x, m11 = g[4] - g[5] * at.clamped_y;
  const P mixed = g[1] - g[2] * at.clamped_y + (g[3] - g[5] * at.clamped_x);
  const P d_x = at.inverse_z *
                (m00 * c.u_aa + mixed * c.u_ab + m11 * c.u_bb - fma(g[2], c.u_a, g[5] * c.u_b));  // of the clamped ray
  const P d_y = at.inverse_z * (m00 * c.u_ab + mixed * c.u_bb + m11 * c.v_bb - fma(g[2], c.u_b, g[5] * c.v_b));
  const P d_inverse_z = m00 * c.u_a + mixed * c.u_b + m11 * c.v_b;
  const P pixel_u = P(view.fx) * d_u, pixel_v = P(view.fy) * d_v;
  const P d_a = fma(pixel_u, bent.ray.u_a, pixel_v * bent.ray.u_b) + keep(at.clamped_x == at.x_over_z, d_x);
  const P d_b = fma(pixel_u, bent.ray.u_b, pixel_v * bent.ray.v_b) + keep(at.clamped_y == at.y_over_z, d_y);
  d_point[0] += at.inverse_z * d_a;
  d_point[1] += at.inverse_z * d_b;
  d_point[2] -= at.inverse_z * fma(d_a, at.x_over_z, fma(d_b, at.y_over_z, d_inverse_z * at.inverse_z));
}

/// dL/dR (3 x 3) to the components of the quaternion as used (docs/spec/method.md, 2.4; no normalisation is
/// differentiated here).
template <class P>
[[nodiscard]] COMPMARK_INLINE std::array<P, 4> quaternion_gradient(const std::array<P, 4>& q,
                                                                   const std::array<P, 9>& d) {
  using T = typename P::Scalar;
  const P two(T(2));
  const P w = q[0], x = q[1], y = q[2], z = q[3];
  const P a = d[3] - d[1], b = d[2] - d[6], c = d[7] - d[5];  // D10 - D01, D02 - D20, D21 - D12
  const P e = d[1] + d[3], f = d[2] + d[6], h = d[5] + d[7];
  return {two * (z * a + y * b + x * c), two * (y * e + z * f + w * c - two * x * (d[4] + d[8])),
          two * (x * e + w * b + z * h - two * y * (d[0] + d[8])),
          two * (w * a + x * f + y * h - two * z * (d[0] + d[4]))};
}

template <class P>
COMPMARK_INLINE void set_rows(const GaussianColumns<typename P::Scalar>& to, std::size_t i, P value) {
  for (std::size_t k = 0; k < 3; ++k) {
    value.store(to.mean[k] + i);
    value.store(to.scale[k] + i);
    value.store(to.color[k] + i);
  }
  for (std::size_t k = 0; k < 4; ++k) value.store(to.rotation[k] + i);
  value.store(to.opacity + i);
}

inline constexpr std::size_t sums_ahead = 48;  // Gaussians

template <Accuracy accuracy, GradientMode mode, class T, int W, class Effects>
void project_backward_chunk(const GaussianColumns<const T>& gaussians, const LensView<T, typename Effects::Lens>& view,
                            const ProjectionSettings<T, typename Effects::Lens>& settings,
                            const ProjectedSplats<T>& projected, std::span<const SplatGradient<T>> sums,
                            const GaussianColumns<T>& d_gaussians, std::span<T> gradient_norm, std::size_t begin,
                            std::size_t end) {
  using P = Pack<T, W>;
  for (std::size_t i = begin; i < end; i += W) {
    const std::size_t lanes = std::min<std::size_t>(W, end - i);
    std::array<const T*, W> record;
    unsigned bits = 0, pivots = 0;
    for (std::size_t lane = 0; lane < W; ++lane) {
      const std::size_t source = lane < lanes ? i + lane : i;
      const std::uint32_t place = lane < lanes ? projected.place[source] : ProjectedSplats<T>::nowhere;
      const bool here = place != ProjectedSplats<T>::nowhere;
      bits |= here ? 1u << lane : 0u;
      pivots |= here && (place & ProjectedSplats<T>::pivot_bit) != 0 ? 1u << lane : 0u;
      record[lane] = reinterpret_cast<const T*>(sums.data() + source);
      __builtin_prefetch(sums.data() + source + sums_ahead);
    }
    const Mask<T, W> live = Mask<T, W>::from_bits(bits), inside = Mask<T, W>::first(static_cast<std::ptrdiff_t>(lanes));
    if (bits == 0) {
      if (!gradient_norm.empty()) P(T(0)).store(gradient_norm.data() + i, inside);
      if constexpr (mode == GradientMode::set) set_rows(d_gaussians, i, P(T(0)));
      continue;
    }
    const LoadedGaussians<P> g = load_gaussians<T, W>(gaussians, i);
    const CameraPoint<P> at = camera_point<T, W>(view, g.mean, settings.near_plane);
    const std::array<P, 9> r = quaternion_matrix(g.rotation);
    const auto bent = lens_point<T, W>(view, at);
    const std::array<P, 6> m = screen_jacobian<T, W>(view, at, bent);
    const ScreenAxes<P> axes = screen_axes(m, r, g.scale);
    Footprint<P> f = footprint_of(axes.v, settings.blur_variance);
    f.pivot_x = Mask<T, W>::from_bits(pivots);  // the axis forward took: the sums are in its frame
    conditional_form(f);
    const std::array<P, 16> sum = load_records<P>(record);
    const ScreenGradient<P> screen = screen_gradient(f, sum[1], sum[2], sum[3], sum[4], sum[5]);

    // dL/dV, then V = B diag(s), B = M R(q), M = J W.
    [[maybe_unused]] std::array<P, 6> filter;
    if constexpr (Effects::Filter::active)
      filter = Effects::Filter::log_gradient(axes.v, f.determinant, settings.blur_variance);
    std::array<P, 6> d_b, d_m;
    std::array<P, 3> d_scale{P(T(0)), P(T(0)), P(T(0))};
    for (std::size_t j = 0; j < 3; ++j) {
      const P scale = min(g.scale[j], P(static_cast<T>(scale_limit)));
      P d_x = axes.shrink * fma(screen.xx, axes.v[j], screen.xy * axes.v[3 + j]);
      P d_y = axes.shrink * fma(screen.xy, axes.v[j], screen.yy * axes.v[3 + j]);
      if constexpr (Effects::Filter::active) {  // sum[0] = dL/d(ln drawn opacity)
        d_x = fma(axes.shrink * sum[0], filter[j], d_x);
        d_y = fma(axes.shrink * sum[0], filter[3 + j], d_y);
      }
      d_scale[j] = fma(d_x, axes.unit[j], d_y * axes.unit[3 + j]);
      d_b[j] = d_x * scale;
      d_b[3 + j] = d_y * scale;
    }
    std::array<P, 9> d_r;
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t j = 0; j < 3; ++j) d_r[3 * k + j] = fma(m[k], d_b[j], m[3 + k] * d_b[3 + j]);
      d_m[k] = fma(d_b[0], r[3 * k], fma(d_b[1], r[3 * k + 1], d_b[2] * r[3 * k + 2]));
      d_m[3 + k] = fma(d_b[3], r[3 * k], fma(d_b[4], r[3 * k + 1], d_b[5] * r[3 * k + 2]));
    }
    const std::array<P, 4> d_q = quaternion_gradient(g.rotation, d_r);

    std::array<P, 3> d_point;
    if constexpr (is_pinhole_policy<typename Effects::Lens>) {
      const P pixel_x = P(view.fx) * at.inverse_z, pixel_y = P(view.fy) * at.inverse_z;  // u = fx x/z + cx
      d_point = {pixel_x * screen.u, pixel_y * screen.v, sum[9]};
      d_point[2] -= fma(d_point[0], at.x_over_z, d_point[1] * at.y_over_z);
      add_jacobian_gradient<accuracy.published_backward, T, W>(view, at, d_m, d_point);
    } else {
      d_point = {P(T(0)), P(T(0)), sum[9]};
      add_lens_gradient<T, W>(view, at, bent, screen.u, screen.v, d_m, d_point);
    }

    const auto add = [&](T* column, P value) {
      P result = keep(live, value);
      if constexpr (mode == GradientMode::add) result += P::load(column + i);
      result.store(column + i);
    };
    for (std::size_t k = 0; k < 3; ++k) {
      add(d_gaussians.mean[k], fma(P(view.rotation[k]), d_point[0],
                                   fma(P(view.rotation[3 + k]), d_point[1], P(view.rotation[6 + k]) * d_point[2])));
      add(d_gaussians.scale[k], d_scale[k]);
      const P c = P::load(gaussians.color[k] + i);
      add(d_gaussians.color[k],
          keep(abs(c) <= P(static_cast<T>(color_limit)), sum[6 + k]));  // scrubbed colours do not move
    }
    for (std::size_t k = 0; k < 4; ++k) add(d_gaussians.rotation[k], d_q[k]);
    add(d_gaussians.opacity, sum[0] / g.opacity);
    if (!gradient_norm.empty()) {
      const P x = P(T(0.5)) * P(view.width) * screen.u, y = P(T(0.5)) * P(view.height) * screen.v;
      keep(live, sqrt(fma(x, x, y * y))).store(gradient_norm.data() + i, inside);
    }
  }
}

}  // namespace detail

/// ADDS into d_gaussians, or sets it. Takes what project() took and left. `sums`: one per input Gaussian; those of
/// invisible ones are not used. `gradient_norm` is empty, or one per input Gaussian (overwritten): the norm of (W/2
/// dL/du, H/2 dL/dv), 0 where not visible. Columns must be readable and writable up to the next multiple of 16 rows.
/// Rows of invisible Gaussians do not change, or become 0.
template <Accuracy accuracy, class T, int W = native_width<T>, GradientMode mode = GradientMode::add,
          class Effects = NoRasterEffects, Executor E>
void project_backward(GaussianColumns<const T> gaussians, const Camera<T>& camera,
                      const ProjectionSettings<T, typename Effects::Lens>& settings,
                      const ProjectedSplats<T>& projected, std::span<const SplatGradient<T>> sums,
                      GaussianColumns<T> d_gaussians, std::span<T> gradient_norm, E& executor) {
  COMPMARK_ASSERT(gaussians.count == projected.gaussians, "project_backward: not the Gaussians that were projected");
  COMPMARK_ASSERT(sums.size() >= gaussians.count, "project_backward: one sum per Gaussian");
  COMPMARK_ASSERT(gradient_norm.empty() || gradient_norm.size() >= gaussians.count,
                  "project_backward: one norm per Gaussian");
  const detail::LensView<T, typename Effects::Lens> view(camera, settings.lens);
  executor.for_chunks(gaussians.count, detail::project_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    detail::project_backward_chunk<accuracy, mode, T, W, Effects>(gaussians, view, settings, projected, sums,
                                                                  d_gaussians, gradient_norm, begin, end);
  });
}

}  // namespace compmark
