// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// ReferenceRasterizer: the specification as code. Every pixel looks at every Gaussian in depth order, in plain scalar
// loops, for any scalar up to long double; nothing is tiled, approximated or vectorised. docs/spec/method.md, 2.1 to
// 2.4, in the robust formulas of docs/spec/numerics.md, CV1 to CV3, BF1 to BF3 and BB1; with accuracy::inria the
// published behaviour: square of whole tiles, exclusive stop, clamps that are not differentiated. (The published conic
// backward divides by det^2 + 1e-7; this bias is not reproduced.) Cost: width * height * Gaussians evaluations of exp,
// each way. Longer than 300 lines: forward and backward pass are meant to be read in one place.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/views.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/concept.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/footprint.hpp"
#include "compmark/splat/raster/lens_view.hpp"
#include "compmark/splat/raster/outputs.hpp"
#include "compmark/splat/raster/projected.hpp"

namespace compmark {

namespace detail {

template <class T>
using Matrix23 = std::array<std::array<T, 3>, 2>;
template <class T>
using Matrix33 = std::array<std::array<T, 3>, 3>;

/// How one Gaussian gets to the screen: point -> camera frame -> pixel, and V = J W R(q) diag(s).
template <class T>
struct ReferenceGeometry {
  std::array<T, 3> point;         // camera frame
  std::array<T, 2> focal, ratio;  // fx, fy and x/z, y/z
  std::array<T, 2> clamped;       // the ratio within the limits of the Jacobian
  Matrix33<T> world;              // W, world to camera
  Matrix33<T> rotation;           // R(q)
  Matrix23<T> m, unit, v;         // J W, J W R, J W R diag(s)
  std::array<T, 3> scale;
  T shrink;  // v was multiplied by this to stay in range (docs/spec/numerics.md, PR2)
};

/// One Gaussian on the screen.
template <class T>
struct ReferenceSplat {
  std::uint32_t source;
  T depth, u, v, opacity;
  std::array<T, 3> color;
  bool pivot_x;  // conditional form of the exponent, see splat.hpp
  T slope, major, minor;
  TileRectangle tiles;  // published rule only
};

/// Sums over pixels with g = -dL/dsigma and (vx, vy) = dsigma/d(pixel - mean).
template <class T>
struct ReferenceSums {
  T g, gx, gy, gxx, gxy, gyy;
  std::array<T, 3> color;
  T depth;
};

/// One splat at one pixel.
template <class T>
struct ReferenceContribution {
  std::size_t splat;
  T alpha, transmittance;  // transmittance in front of it
  T raw, slope;            // opacity exp(-sigma), and dalpha/draw
  T vx, vy;
};

}  // namespace detail

template <class T, Accuracy accuracy = accuracy::spec, class Effects = NoRasterEffects>
class ReferenceRasterizer {
 public:
  using Scalar = T;
  using Settings = ProjectionSettings<T, typename Effects::Lens>;
  using EffectPolicy = Effects;
  static constexpr Accuracy accuracy_policy = accuracy;

  struct Context {
    Buffer<detail::ReferenceSplat<T>> splats;                ///< depth order
    Buffer<T> alpha;                                         ///< [height, width] 1 - final transmittance
    Buffer<T> depth;                                         ///< [height, width] sum of weight * camera z
    Buffer<std::uint8_t> visible;                            ///< [gaussians]
    Buffer<T> gradient_norm;                                 ///< [gaussians]
    Buffer<detail::ReferenceSums<T>> sums;                   // [bands, splats]
    Buffer<detail::ReferenceContribution<T>> contributions;  // [bands, splats]
  };

  ReferenceRasterizer() = default;
  explicit ReferenceRasterizer(const Settings& settings) : settings_(settings) {}
  [[nodiscard]] const Settings& settings() const { return settings_; }

  template <Executor E>
  RasterReport forward(GaussianColumns<const T> gaussians, const Camera<T>& camera, std::array<T, 3> background,
                       ImageView<T> image, Context& ctx, E& executor) const {
    COMPMARK_ASSERT(image.channels == 3 && image.height == camera.height && image.width == camera.width,
                    "ReferenceRasterizer: the image must be [3, camera.height, camera.width]");
    RasterReport report;
    ctx.visible.resize(gaussians.count);
    ctx.splats.resize(gaussians.count);
    for (std::size_t i = 0; i < gaussians.count; ++i) {
      detail::ReferenceSplat<T> splat;
      ctx.visible[i] = project_one(gaussians, camera, i, splat, report) ? 1 : 0;
      if (ctx.visible[i] != 0) ctx.splats[report.visible++] = splat;
    }
    ctx.splats.resize(report.visible);
    std::sort(ctx.splats.begin(), ctx.splats.end(), [](const auto& a, const auto& b) {
      // a total order (docs/spec/numerics.md, TB4)
      return a.depth < b.depth || (a.depth == b.depth && a.source < b.source);
    });
    ctx.alpha.resize(image.plane_size());
    ctx.depth.resize(image.plane_size());
    prepare_bands(ctx);
    each_band(camera, executor, [&](std::size_t band, int y_begin, int y_end) {
      forward_rows(camera, background, image, ctx, band, y_begin, y_end);
    });
    return report;
  }

  template <Executor E>
  void backward(GaussianColumns<const T> gaussians, const Camera<T>& camera, std::array<T, 3> background,
                ImageView<const T> d_image, GaussianColumns<T> d_gaussians, Context& ctx, E& executor) const {
    backward(gaussians, camera, background, d_image, PlaneGradients<T>{}, d_gaussians, ctx, executor);
  }

  /// With gradients of the alpha and depth planes.
  template <Executor E>
  void backward(GaussianColumns<const T> gaussians, const Camera<T>& camera, std::array<T, 3> background,
                ImageView<const T> d_image, const PlaneGradients<T>& d_planes, GaussianColumns<T> d_gaussians,
                Context& ctx, E& executor) const {
    const std::size_t count = ctx.splats.size();
    prepare_bands(ctx);
    each_band(camera, executor, [&](std::size_t band, int y_begin, int y_end) {
      backward_rows(camera, background, d_image, d_planes, ctx, band, y_begin, y_end);
    });
    ctx.gradient_norm.resize(gaussians.count, T(0));
    for (std::size_t i = 0; i < count; ++i) {
      detail::ReferenceSums<T> total{};
      for (std::size_t band = 0; band < band_count(camera); ++band) add(total, ctx.sums[band * count + i]);
      unproject_one(gaussians, camera, ctx.splats[i], total, d_gaussians, ctx);
    }
  }

  [[nodiscard]] ScreenStatistics<T> screen(const Context& ctx) const {
    return {ctx.visible.span(), ctx.gradient_norm.span()};
  }

 private:
  static constexpr bool has_lens = !detail::is_pinhole_policy<typename Effects::Lens>;
  static constexpr bool filtered = std::is_same_v<typename Effects::Filter, MipFilter>;
  static constexpr std::size_t bands = 8;  // of rows, each with sums of its own: same bits at any thread count

  [[nodiscard]] static int band_rows(const Camera<T>& camera) { return std::max(1, (camera.height + 7) / 8); }
  [[nodiscard]] static std::size_t band_count(const Camera<T>& camera) {
    return chunk_count(static_cast<std::size_t>(camera.height), static_cast<std::size_t>(band_rows(camera)));
  }
  static void prepare_bands(Context& ctx) {
    ctx.contributions.resize(bands * ctx.splats.size());
    ctx.sums.resize(bands * ctx.splats.size());
  }
  template <Executor E, class Body>
  static void each_band(const Camera<T>& camera, E& executor, const Body& body) {
    const auto rows = static_cast<std::size_t>(band_rows(camera));
    executor.for_chunks(static_cast<std::size_t>(camera.height), rows,
                        [&](std::size_t begin, std::size_t end, std::size_t) {
                          body(begin / rows, static_cast<int>(begin), static_cast<int>(end));
                        });
  }
  static void add(detail::ReferenceSums<T>& total, const detail::ReferenceSums<T>& part) {
    total.g += part.g;
    total.gx += part.gx;
    total.gy += part.gy;
    total.gxx += part.gxx;
    total.gxy += part.gxy;
    total.gyy += part.gyy;
    for (std::size_t c = 0; c < 3; ++c) total.color[c] += part.color[c];
    total.depth += part.depth;
  }

  // ---- the rows of one band ----

  // Not inlined, so that every executor runs the same instructions: inlined into two executors, g++ -O3 contracts the
  // sums differently and the last bits differ (law R5).

  __attribute__((noinline)) static void forward_rows(const Camera<T>& camera, const std::array<T, 3>& background,
                                                     ImageView<T> image, Context& ctx, std::size_t band, int y_begin,
                                                     int y_end) {
    for (int y = y_begin; y < y_end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        std::array<T, 3> color{};
        T depth = 0;
        const auto [list, left] = blend(ctx, band, x, y);
        for (const detail::ReferenceContribution<T>& item : list) {
          const T weight = item.alpha * item.transmittance;
          for (std::size_t c = 0; c < 3; ++c) color[c] += weight * ctx.splats[item.splat].color[c];
          depth += weight * ctx.splats[item.splat].depth;
        }
        for (int c = 0; c < 3; ++c) {
          const auto k = static_cast<std::size_t>(c);
          image(c, y, x) = color[k] + left * background[k];
        }
        const std::size_t pixel =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
        ctx.alpha[pixel] = T(1) - left;
        ctx.depth[pixel] = depth;
      }
    }
  }

  __attribute__((noinline)) static void backward_rows(const Camera<T>& camera, const std::array<T, 3>& background,
                                                      ImageView<const T> d_image, const PlaneGradients<T>& d_planes,
                                                      Context& ctx, std::size_t band, int y_begin, int y_end) {
    const std::size_t count = ctx.splats.size();
    detail::ReferenceSums<T>* const sums = ctx.sums.data() + band * count;
    std::fill(sums, sums + count, detail::ReferenceSums<T>{});
    for (int y = y_begin; y < y_end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const auto [list, left] = blend(ctx, band, x, y);
        std::array<T, 3> d_color;
        for (int c = 0; c < 3; ++c) d_color[static_cast<std::size_t>(c)] = d_image(c, y, x);
        const T d_alpha_plane = d_planes.alpha.data != nullptr ? d_planes.alpha(0, y, x) : T(0);
        const T d_depth_plane = d_planes.depth.data != nullptr ? d_planes.depth(0, y, x) : T(0);
        // Back to front. `behind` is what the viewer would see behind this splat: it starts as the background, and no
        // division by 1 - alpha and no separate background term is needed (docs/spec/numerics.md, BB1). Alpha is a
        // channel of ones before zeros, depth a channel of z before zeros.
        std::array<T, 3> behind = background;
        T alpha_behind = 0, depth_behind = 0;
        for (std::size_t k = list.size(); k-- > 0;) {
          const detail::ReferenceContribution<T>& item = list[k];
          const detail::ReferenceSplat<T>& splat = ctx.splats[item.splat];
          detail::ReferenceSums<T>& sum = sums[item.splat];
          const T weight = item.alpha * item.transmittance;
          T d_alpha = (T(1) - alpha_behind) * d_alpha_plane + (splat.depth - depth_behind) * d_depth_plane;
          for (std::size_t c = 0; c < 3; ++c) {
            sum.color[c] += weight * d_color[c];
            d_alpha += (splat.color[c] - behind[c]) * d_color[c];
            behind[c] += item.alpha * (splat.color[c] - behind[c]);
          }
          sum.depth += weight * d_depth_plane;
          alpha_behind += item.alpha * (T(1) - alpha_behind);
          depth_behind += item.alpha * (splat.depth - depth_behind);
          const T g = item.raw * item.slope * item.transmittance * d_alpha;
          sum.g += g;
          sum.gx += g * item.vx;
          sum.gy += g * item.vy;
          sum.gxx += g * item.vx * item.vx;
          sum.gxy += g * item.vx * item.vy;
          sum.gyy += g * item.vy * item.vy;
        }
      }
    }
  }

  // ---- one pixel ----

  struct Blended {
    std::span<const detail::ReferenceContribution<T>> list;  // front to back
    T left;                                                  // transmittance behind all of them
  };

  [[nodiscard]] static Blended blend(Context& ctx, std::size_t band, int x, int y) {
    const std::size_t count = ctx.splats.size();
    detail::ReferenceContribution<T>* const list = ctx.contributions.data() + band * count;
    std::size_t n = 0;
    T transmittance = 1;
    for (std::size_t i = 0; i < count; ++i) {
      const detail::ReferenceSplat<T>& splat = ctx.splats[i];
      if constexpr (accuracy.footprint == FootprintRule::square_three_sigma) {
        const int tile_x = x / accuracy.tile_size, tile_y = y / accuracy.tile_size;
        if (tile_x < splat.tiles.x_begin || tile_x >= splat.tiles.x_end || tile_y < splat.tiles.y_begin ||
            tile_y >= splat.tiles.y_end)
          continue;
      }
      detail::ReferenceContribution<T> item = evaluate(splat, x, y);
      if (!(item.alpha > T(0))) continue;
      const T next = std::fma(-item.alpha, transmittance, transmittance);  // one rounding (docs/spec/numerics.md, BF2)
      constexpr T stop = static_cast<T>(accuracy.transmittance_stop);
      if (accuracy.stop == StopRule::exclusive && next < stop) break;
      item.splat = i;
      item.transmittance = transmittance;
      list[n++] = item;
      transmittance = next;
      if (accuracy.stop == StopRule::inclusive && next < stop) break;  // blend, then stop (docs/spec/numerics.md, BF1)
    }
    return {{list, n}, transmittance};
  }

  /// alpha at the centre of pixel (x, y), 0 if it is cut off, and what backward needs of it.
  [[nodiscard]] static detail::ReferenceContribution<T> evaluate(const detail::ReferenceSplat<T>& splat, int x, int y) {
    constexpr T alpha_min = static_cast<T>(accuracy.alpha_min), alpha_max = static_cast<T>(accuracy.alpha_max);
    const T dx = static_cast<T>(x) + pixel_center<T> - splat.u, dy = static_cast<T>(y) + pixel_center<T> - splat.v;
    const T d_a = splat.pivot_x ? dy : dx, d_b = splat.pivot_x ? dx : dy;
    const T w = d_a - splat.slope * d_b;
    // >= 0 whatever the rounding (docs/spec/numerics.md, CV2)
    const T sigma = splat.major * w * w + splat.minor * d_b * d_b;
    detail::ReferenceContribution<T> item{};
    item.raw = splat.opacity * std::exp(-sigma);
    const bool clamped = !(item.raw < alpha_max);  // strict (docs/spec/numerics.md, BF3)
    item.alpha = clamped ? alpha_max : item.raw;
    item.slope = clamped && !accuracy.published_backward ? T(0) : T(1);
    if constexpr (accuracy.cutoff == CutoffRule::smooth) {
      const SmoothCutoff<T> ramp = smooth_cutoff(item.alpha, alpha_min);
      item.alpha = ramp.value;
      item.slope *= ramp.derivative;
    } else if (!(item.alpha >= alpha_min)) {
      item.alpha = T(0);
    }
    const T v_a = 2 * splat.major * w, v_b = 2 * splat.minor * d_b - splat.slope * v_a;
    item.vx = splat.pivot_x ? v_b : v_a;
    item.vy = splat.pivot_x ? v_a : v_b;
    return item;
  }

  // ---- one Gaussian ----

  /// False if z is not in front of the near plane, or the lens is not one-to-one there.
  [[nodiscard]] bool geometry(const GaussianColumns<const T>& gaussians, const Camera<T>& camera, std::size_t i,
                              detail::ReferenceGeometry<T>& g) const {
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c) g.world[r][c] = camera.rotation_camera_world[3 * r + c];
    }
    std::array<T, 3> d;
    for (std::size_t k = 0; k < 3; ++k) d[k] = subtract(gaussians.mean[k][i], camera.center_world[k]);
    for (std::size_t k = 0; k < 3; ++k) g.point[k] = g.world[k][0] * d[0] + g.world[k][1] * d[1] + g.world[k][2] * d[2];
    const T z = g.point[2];
    if (!(z > settings_.near_plane)) return false;  // NaN is culled as well (docs/spec/numerics.md, PR1)
    g.focal = {camera.fx, camera.fy};
    const std::array<T, 2> size{static_cast<T>(camera.width), static_cast<T>(camera.height)},
        principal{camera.cx, camera.cy};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      // docs/spec/numerics.md, PR4; published: 1.3 tan(fov/2)
      const T margin = T(0.3L) * size[axis] / (2 * g.focal[axis]);
      const T low = -(principal[axis] / g.focal[axis] + margin),
              high = (size[axis] - principal[axis]) / g.focal[axis] + margin;
      g.ratio[axis] = g.point[axis] / z;
      g.clamped[axis] = std::min(std::max(g.ratio[axis], low), high);
      for (std::size_t k = 0; k < 3; ++k)
        g.m[axis][k] = g.focal[axis] / z * (g.world[axis][k] - g.clamped[axis] * g.world[2][k]);
    }
    if constexpr (has_lens) {
      if (!bend(camera, g)) return false;
    }
    const T w = gaussians.rotation[0][i], x = gaussians.rotation[1][i], y = gaussians.rotation[2][i],
            q = gaussians.rotation[3][i];
    g.rotation = {{{1 - 2 * (y * y + q * q), 2 * (x * y - w * q), 2 * (x * q + w * y)},
                   {2 * (x * y + w * q), 1 - 2 * (x * x + q * q), 2 * (y * q - w * x)},
                   {2 * (x * q - w * y), 2 * (y * q + w * x), 1 - 2 * (x * x + y * y)}}};
    T largest = 0;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t j = 0; j < 3; ++j) {
        g.scale[j] = std::min(gaussians.scale[j][i], static_cast<T>(detail::scale_limit));
        g.unit[axis][j] =
            g.m[axis][0] * g.rotation[0][j] + g.m[axis][1] * g.rotation[1][j] + g.m[axis][2] * g.rotation[2][j];
        g.v[axis][j] = g.unit[axis][j] * g.scale[j];
        largest = std::max(largest, std::abs(g.v[axis][j]));
      }
    }
    const T limit = static_cast<T>(detail::footprint_limit);
    g.shrink = largest > limit ? limit / largest : T(1);
    for (auto& row : g.v) {
      for (T& value : row) value *= g.shrink;
    }
    return true;
  }

  /// What a lens changes: the limits of the clamp, which are of rays (lens_view.hpp says which), and M = diag(fx, fy) J
  /// W with the lens's J at the clamped ray. False outside the region where the lens is one-to-one.
  [[nodiscard]] bool bend(const Camera<T>& camera, detail::ReferenceGeometry<T>& g) const {
    const typename Effects::Lens& lens = settings_.lens;
    if (!lens.inside(g.ratio[0], g.ratio[1])) return false;
    const T margin_x = T(0.3L) * static_cast<T>(camera.width) / (2 * camera.fx),
            margin_y = T(0.3L) * static_cast<T>(camera.height) / (2 * camera.fy);
    const detail::RayLimits<T> limits = detail::ray_limits(
        lens, detail::RayLimits<T>{-(camera.cx / camera.fx + margin_x),
                                   (static_cast<T>(camera.width) - camera.cx) / camera.fx + margin_x,
                                   -(camera.cy / camera.fy + margin_y),
                                   (static_cast<T>(camera.height) - camera.cy) / camera.fy + margin_y});
    g.clamped = {std::min(std::max(g.ratio[0], limits.x_low), limits.x_high),
                 std::min(std::max(g.ratio[1], limits.y_low), limits.y_high)};
    if (!lens.inside(g.clamped[0], g.clamped[1])) g.clamped = g.ratio;
    const T z = g.point[2];
    const std::array<T, 6> j = lens.jacobian(g.clamped[0] * z, g.clamped[1] * z, z);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t k = 0; k < 3; ++k) {
        g.m[axis][k] = g.focal[axis] * (j[3 * axis] * g.world[0][k] + j[3 * axis + 1] * g.world[1][k] +
                                        j[3 * axis + 2] * g.world[2][k]);
      }
    }
    return true;
  }

  /// The backward pass of bend() and of the mean on the screen, by the lens's own adjoint at the point and at the
  /// clamped point (clamped * z, z), which moves with z alone where the clamp holds.
  void unbend(const detail::ReferenceGeometry<T>& g, const std::array<T, 2>& d_screen, const detail::Matrix23<T>& d_m,
              std::array<T, 3>& d_point) const {
    const typename Effects::Lens& lens = settings_.lens;
    const T z = g.point[2];
    const std::array<T, 3> mean =
        lens.backward(g.point[0], g.point[1], z, {g.focal[0] * d_screen[0], g.focal[1] * d_screen[1]}, {});
    std::array<T, 6> d_j{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t k = 0; k < 3; ++k) d_j[3 * axis + j] += g.focal[axis] * d_m[axis][k] * g.world[j][k];
      }
    }
    const std::array<T, 3> shape = lens.backward(g.clamped[0] * z, g.clamped[1] * z, z, {}, d_j);
    for (std::size_t k = 0; k < 3; ++k) d_point[k] += mean[k];
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (g.clamped[axis] == g.ratio[axis]) {
        d_point[axis] += shape[axis];
      } else {
        d_point[2] += g.clamped[axis] * shape[axis];
      }
    }
    d_point[2] += shape[2];
  }

  /// Mip filter: rho of a footprint, and by how much ln rho grows with V (docs/spec/numerics.md, CV6): half the
  /// derivatives of ln det(V V^T) - ln det(V V^T + e I), each as dlog det S = tr(S^-1 dS). Plain inverses, unlike the
  /// fast path; 0 at the floor.
  struct Filter {
    T rho;
    detail::Matrix23<T> d_log;
  };
  [[nodiscard]] Filter filter(const detail::Matrix23<T>& v) const {
    const T e = settings_.blur_variance;
    T xx = 0, xy = 0, yy = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      xx += v[0][k] * v[0][k];
      xy += v[0][k] * v[1][k];
      yy += v[1][k] * v[1][k];
    }
    const T c0 = v[0][1] * v[1][2] - v[0][2] * v[1][1], c1 = v[0][2] * v[1][0] - v[0][0] * v[1][2],
            c2 = v[0][0] * v[1][1] - v[0][1] * v[1][0];
    const T sharp = c0 * c0 + c1 * c1 + c2 * c2, blurred = sharp + e * (xx + yy) + e * e;
    const T squared = sharp / blurred, floor = static_cast<T>(detail::mip_floor);
    Filter result{std::sqrt(squared > floor ? squared : floor), {}};
    if (!(squared > floor)) return result;
    for (std::size_t k = 0; k < 3; ++k) {
      result.d_log[0][k] = (yy * v[0][k] - xy * v[1][k]) / sharp - ((yy + e) * v[0][k] - xy * v[1][k]) / blurred;
      result.d_log[1][k] = (xx * v[1][k] - xy * v[0][k]) / sharp - ((xx + e) * v[1][k] - xy * v[0][k]) / blurred;
    }
    return result;
  }

  /// mean - centre in double or better, then rounded (docs/spec/numerics.md, PR7).
  [[nodiscard]] static T subtract(T mean, double center) {
    if constexpr (sizeof(T) < sizeof(double)) {
      return static_cast<T>(static_cast<double>(mean) - center);
    } else {
      return mean - static_cast<T>(center);
    }
  }

  [[nodiscard]] bool project_one(const GaussianColumns<const T>& gaussians, const Camera<T>& camera, std::size_t i,
                                 detail::ReferenceSplat<T>& splat, RasterReport& report) const {
    bool finite = std::isfinite(gaussians.opacity[i]), sane = true;
    for (std::size_t k = 0; k < 3; ++k)
      finite = finite && std::isfinite(gaussians.mean[k][i]) && std::isfinite(gaussians.scale[k][i]);
    for (std::size_t k = 0; k < 4; ++k) finite = finite && std::isfinite(gaussians.rotation[k][i]);
    for (std::size_t k = 0; k < 3; ++k) {  // docs/spec/numerics.md, BF9
      const T limit = static_cast<T>(detail::color_limit), c = gaussians.color[k][i];
      sane = sane && std::abs(c) <= limit;
      splat.color[k] = std::isfinite(c) ? std::min(std::max(c, -limit), limit) : T(0);
    }
    if (!finite || !sane) ++report.scrubbed;
    detail::ReferenceGeometry<T> g;
    if (!finite || !geometry(gaussians, camera, i, g)) return false;
    splat.source = static_cast<std::uint32_t>(i);
    splat.depth = g.point[2];
    splat.u = camera.fx * g.ratio[0] + camera.cx;
    splat.v = camera.fy * g.ratio[1] + camera.cy;
    if constexpr (has_lens) {
      const std::array<T, 2> image = settings_.lens.project(g.point[0], g.point[1], g.point[2]);
      splat.u = camera.fx * image[0] + camera.cx;
      splat.v = camera.fy * image[1] + camera.cy;
    }
    splat.opacity = gaussians.opacity[i];
    if constexpr (filtered) splat.opacity *= filter(g.v).rho;

    // Covariance V V^T + e I. Its determinant by Cauchy and Binet, |V0 x V1|^2 + e (|V0|^2 + |V1|^2) + e^2: nothing
    // cancels (case CV1).
    const T e = settings_.blur_variance;
    const auto& v = g.v;
    const std::array<T, 3> cross{v[0][1] * v[1][2] - v[0][2] * v[1][1], v[0][2] * v[1][0] - v[0][0] * v[1][2],
                                 v[0][0] * v[1][1] - v[0][1] * v[1][0]};
    const auto dot = [](const std::array<T, 3>& a, const std::array<T, 3>& b) {
      return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    };
    const T xx = dot(v[0], v[0]), xy = dot(v[0], v[1]), yy = dot(v[1], v[1]);
    const T variance_x = xx + e, variance_y = yy + e, determinant = dot(cross, cross) + e * (xx + yy) + e * e;
    splat.pivot_x = variance_x > variance_y;
    const T pivot = splat.pivot_x ? variance_x : variance_y;
    splat.slope = xy / pivot;
    splat.major = pivot / (2 * determinant);
    splat.minor = 1 / (2 * pivot);

    if (!(splat.opacity > T(0))) return false;
    if constexpr (accuracy.footprint == FootprintRule::square_three_sigma) {
      const T middle = (variance_x + variance_y) / 2;
      const T radius = std::ceil(3 * std::sqrt(middle + std::sqrt(std::max(T(0.1f), middle * middle - determinant))));
      splat.tiles = detail::tile_rectangle<accuracy.footprint, accuracy.tile_size>(splat.u, splat.v, radius, radius,
                                                                                   camera.width, camera.height);
      return radius > T(0) && !splat.tiles.empty();
    } else {
      constexpr T floor = cutoff_floor<T>(accuracy);
      if (!(splat.opacity >= floor)) return false;  // docs/spec/numerics.md, TB8
      const T sigma_max = floor > T(0) ? std::log(splat.opacity / floor) : std::numeric_limits<T>::infinity();
      const T reach =
          sigma_max * (2 * T(1.0001)) + T(2e-5);  // the same slack as the fast path: "visible" must mean the same
      const T x = std::sqrt(reach * variance_x), y = std::sqrt(reach * variance_y), half = pixel_center<T>;
      return splat.u + x >= half && splat.u - x <= static_cast<T>(camera.width) - half && splat.v + y >= half &&
             splat.v - y <= static_cast<T>(camera.height) - half;
    }
  }

  /// From the sums of one splat to its Gaussian: ADDS.
  void unproject_one(const GaussianColumns<const T>& gaussians, const Camera<T>& camera,
                     const detail::ReferenceSplat<T>& splat, const detail::ReferenceSums<T>& sum,
                     const GaussianColumns<T>& d, Context& ctx) const {
    const std::size_t i = splat.source;
    detail::ReferenceGeometry<T> g;
    if (!geometry(gaussians, camera, i, g)) return;
    d.opacity[i] += sum.g / (filtered ? gaussians.opacity[i] : splat.opacity);  // the filter is a factor
    for (std::size_t k = 0; k < 3; ++k) {
      if (std::abs(gaussians.color[k][i]) <= static_cast<T>(detail::color_limit)) d.color[k][i] += sum.color[k];
    }
    ctx.gradient_norm[i] =
        std::hypot(static_cast<T>(camera.width) / 2 * sum.gx, static_cast<T>(camera.height) / 2 * sum.gy);

    // dL/dV = [sum g v v^T] V (docs/spec/numerics.md, CV3); V = B diag(s); B = M R; M = J W.
    detail::Matrix23<T> d_v, d_m{};
    for (std::size_t j = 0; j < 3; ++j) {
      d_v[0][j] = g.shrink * (sum.gxx * g.v[0][j] + sum.gxy * g.v[1][j]);
      d_v[1][j] = g.shrink * (sum.gxy * g.v[0][j] + sum.gyy * g.v[1][j]);
      if constexpr (filtered) {  // sum.g = dL/d(ln of the drawn opacity)
        const Filter by_filter = filter(g.v);
        for (std::size_t axis = 0; axis < 2; ++axis) d_v[axis][j] += g.shrink * sum.g * by_filter.d_log[axis][j];
      }
      d.scale[j][i] += d_v[0][j] * g.unit[0][j] + d_v[1][j] * g.unit[1][j];
    }
    detail::Matrix33<T> d_r{};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t k = 0; k < 3; ++k) {
        for (std::size_t j = 0; j < 3; ++j) {
          const T d_b = d_v[axis][j] * g.scale[j];
          d_m[axis][k] += d_b * g.rotation[k][j];
          d_r[k][j] += d_b * g.m[axis][k];
        }
      }
    }
    const T w = gaussians.rotation[0][i], x = gaussians.rotation[1][i], y = gaussians.rotation[2][i],
            z = gaussians.rotation[3][i];
    d.rotation[0][i] += 2 * (z * (d_r[1][0] - d_r[0][1]) + y * (d_r[0][2] - d_r[2][0]) + x * (d_r[2][1] - d_r[1][2]));
    d.rotation[1][i] += 2 * (y * (d_r[0][1] + d_r[1][0]) + z * (d_r[0][2] + d_r[2][0]) + w * (d_r[2][1] - d_r[1][2]) -
                             2 * x * (d_r[1][1] + d_r[2][2]));
    d.rotation[2][i] += 2 * (x * (d_r[0][1] + d_r[1][0]) + w * (d_r[0][2] - d_r[2][0]) + z * (d_r[1][2] + d_r[2][1]) -
                             2 * y * (d_r[0][0] + d_r[2][2]));
    d.rotation[3][i] += 2 * (w * (d_r[1][0] - d_r[0][1]) + x * (d_r[0][2] + d_r[2][0]) + y * (d_r[1][2] + d_r[2][1]) -
                             2 * z * (d_r[0][0] + d_r[1][1]));

    // The point: through the mean on the screen, u = f x/z + c, through the depth, and through J = f/z [1, 0, -clamped]
    // (case PR3).
    const std::array<T, 2> d_screen{sum.gx, sum.gy};
    std::array<T, 3> d_point{0, 0, sum.depth};
    if constexpr (has_lens) {
      unbend(g, d_screen, d_m, d_point);
    } else {
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const T f = g.focal[axis], depth = g.point[2];
        d_point[axis] += f / depth * d_screen[axis];
        d_point[2] -= f / depth * g.ratio[axis] * d_screen[axis];
        T d_diagonal = 0, d_third = 0;  // of J's entries f/z and -f clamped/z
        for (std::size_t k = 0; k < 3; ++k) {
          d_diagonal += d_m[axis][k] * g.world[axis][k];
          d_third += d_m[axis][k] * g.world[2][k];
        }
        const bool free = g.clamped[axis] == g.ratio[axis];
        if (free) d_point[axis] -= f / (depth * depth) * d_third;
        const T factor =
            free || accuracy.published_backward ? T(2) : T(1);  // published: the unclamped factor everywhere
        d_point[2] += f / (depth * depth) * (factor * g.clamped[axis] * d_third - d_diagonal);
      }
    }
    for (std::size_t k = 0; k < 3; ++k) {
      d.mean[k][i] += g.world[0][k] * d_point[0] + g.world[1][k] * d_point[1] + g.world[2][k] * d_point[2];
    }
  }

  Settings settings_{};
};

}  // namespace compmark
