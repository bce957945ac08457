// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Projection: Gaussians in, visible splats in depth order out. Three steps: (1) visibility and depth of every Gaussian,
// (2) a stable sort by depth, (3) the splats, written straight to their place in depth order. Computing the footprint
// twice (~190 flop) is cheaper than writing 64 bytes a splat, reading them back in depth order and writing them again.
// Cost: reads 44 + 56 bytes and writes 64 bytes a visible Gaussian, plus the sort.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/concept.hpp"
#include "compmark/splat/raster/depth_sort.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/footprint.hpp"
#include "compmark/splat/raster/lens_view.hpp"
#include "compmark/splat/raster/projected.hpp"
#include "compmark/splat/raster/transpose.hpp"

namespace compmark {

/// Scratch of project(); grow-only.
template <class T>
struct ProjectWorkspace {
  struct Partial {
    DepthKey<T> smallest, largest;
    std::uint32_t scrubbed;
  };
  DepthSortWorkspace<T> sort;
  Buffer<Partial> partial;
};

namespace detail {

inline constexpr std::size_t project_grain = 2048;  // Gaussians a chunk: about 115 KB of columns in float

/// One pack of Gaussians, loaded and checked.
template <class P>
struct LoadedGaussians {
  std::array<P, 3> mean, scale;
  std::array<P, 4> rotation;
  P opacity;
  typename P::MaskType finite;
};

template <class T, int W>
[[nodiscard]] COMPMARK_INLINE LoadedGaussians<Pack<T, W>> load_gaussians(const GaussianColumns<const T>& gaussians,
                                                                         std::size_t i) {
  using P = Pack<T, W>;
  LoadedGaussians<P> g;
  P poison(T(0));  // x * 0 is NaN for infinities and NaN: one fma a column finds them all
  const auto load = [&](const T* column) {
    const P value = P::load(column + i);
    poison = fma(value, P(T(0)), poison);
    return value;
  };
  for (std::size_t k = 0; k < 3; ++k) g.mean[k] = load(gaussians.mean[k]);
  for (std::size_t k = 0; k < 3; ++k) g.scale[k] = load(gaussians.scale[k]);
  for (std::size_t k = 0; k < 4; ++k) g.rotation[k] = load(gaussians.rotation[k]);
  g.opacity = load(gaussians.opacity);
  g.finite = poison == P(T(0));
  return g;
}

/// Everything about a pack of Gaussians on the screen.
template <class P>
struct ScreenGaussians {
  CameraPoint<P> at;
  Footprint<P> footprint;
  P u, v, opacity, sigma_max, half_width, half_height;
  typename P::MaskType visible;
};

template <Accuracy accuracy, class T, int W, class Effects = NoRasterEffects>
[[nodiscard]] COMPMARK_INLINE ScreenGaussians<Pack<T, W>> to_screen(
    const LensView<T, typename Effects::Lens>& view, const LoadedGaussians<Pack<T, W>>& g,
    const ProjectionSettings<T, typename Effects::Lens>& settings) {
  using P = Pack<T, W>;
  constexpr T floor = cutoff_floor<T>(accuracy);
  ScreenGaussians<P> s;
  s.at = camera_point<T, W>(view, g.mean, settings.near_plane);
  const auto bent = lens_point<T, W>(view, s.at);
  const ScreenAxes<P> axes =
      screen_axes(screen_jacobian<T, W>(view, s.at, bent), quaternion_matrix(g.rotation), g.scale);
  s.footprint = footprint_of(axes.v, settings.blur_variance);
  const ScreenPoint<P> mean = screen_point<T, W>(view, s.at, bent);
  s.u = mean.u;
  s.v = mean.v;
  s.opacity = Effects::Filter::opacity(g.opacity, axes.v, s.footprint.determinant);
  // "opacity >= floor" comes before the logarithm, and NaN fails it (docs/spec/numerics.md, TB8).
  const auto opaque = (s.opacity > P(T(0))) & (s.opacity >= P(floor));
  s.sigma_max = P(std::numeric_limits<T>::infinity());
  if constexpr (floor > T(0))
    s.sigma_max = log_positive(select(s.opacity > P(T(0)), s.opacity, P(floor)) * P(T(1) / floor));
  const auto valid = s.at.in_front & g.finite;
  if constexpr (accuracy.footprint == FootprintRule::square_three_sigma) {
    // lambda_max with the published floor of 0.1, then a square of whole pixels. Not opacity-aware.
    const P middle = P(T(0.5)) * (s.footprint.variance_x + s.footprint.variance_y);
    const P lambda = middle + sqrt(max(middle * middle - s.footprint.determinant, P(T(0.1f))));
    const P radius = P(T(3)) * sqrt(lambda);
    unsigned hit = 0;
    for (int lane = 0; lane < W; ++lane) {
      const T r = std::ceil(radius.lane(lane));
      s.half_width.set(lane, r);
      const TileRectangle tiles = tile_rectangle<accuracy.footprint, accuracy.tile_size>(
          s.u.lane(lane), s.v.lane(lane), r, r, static_cast<int>(view.width), static_cast<int>(view.height));
      hit |= (r > T(0) && !tiles.empty()) ? 1u << lane : 0u;
    }
    s.half_height = s.half_width;
    s.visible = valid & (s.opacity > P(T(0))) & Mask<T, W>::from_bits(hit);
  } else {
    // The marginal variances give the box, no eigenvalue needed (docs/spec/numerics.md, CV5); the slack is that of the
    // tile test (TB3).
    const P reach = fma(s.sigma_max, P(T(2) * T(1.0001)), P(T(2e-5)));
    s.half_width = sqrt(reach * s.footprint.variance_x);
    s.half_height = sqrt(reach * s.footprint.variance_y);
    const P half(pixel_center<T>);
    s.visible = valid & opaque & (s.u + s.half_width >= half) & (s.u - s.half_width <= P(view.width) - half) &
                (s.v + s.half_height >= half) & (s.v - s.half_height <= P(view.height) - half);
  }
  return s;
}

template <class T>
[[nodiscard]] COMPMARK_INLINE DepthKey<T> depth_key(T depth) {
  return std::bit_cast<DepthKey<T>>(depth);
}

/// Step 1 for Gaussians [begin, end): visible, place (0 or nowhere) and the depth entries of the visible ones.
template <Accuracy accuracy, class T, int W, class Effects = NoRasterEffects>
void find_visible(const GaussianColumns<const T>& gaussians, const LensView<T, typename Effects::Lens>& view,
                  const ProjectionSettings<T, typename Effects::Lens>& settings, std::size_t begin, std::size_t end,
                  ProjectedSplats<T>& out, ProjectWorkspace<T>& workspace) {
  using P = Pack<T, W>;
  const std::size_t chunk = begin / project_grain;
  DepthEntry<T>* entry = workspace.sort.entries.data() + begin;
  DepthKey<T> smallest = std::numeric_limits<DepthKey<T>>::max(), largest = 0;
  std::uint32_t scrubbed = 0;
  const P limit(static_cast<T>(color_limit));
  for (std::size_t i = begin; i < end; i += W) {
    const Mask<T, W> inside = Mask<T, W>::first(static_cast<std::ptrdiff_t>(end - i));
    const LoadedGaussians<P> g = load_gaussians<T, W>(gaussians, i);
    const ScreenGaussians<P> s = to_screen<accuracy, T, W, Effects>(view, g, settings);
    Mask<T, W> sane = g.finite;
    for (std::size_t k = 0; k < 3; ++k) sane = sane & (abs(P::load(gaussians.color[k] + i)) <= limit);
    scrubbed += static_cast<std::uint32_t>(count(inside & !sane));
    const unsigned bits = (s.visible & inside).bits();
    for (unsigned left = bits; left != 0; left &= left - 1) {
      const int lane = std::countr_zero(left);
      const DepthKey<T> key = depth_key(s.at.point[2].lane(lane));
      smallest = std::min(smallest, key);
      largest = std::max(largest, key);
      *entry++ = {key, static_cast<std::uint32_t>(i + static_cast<std::size_t>(lane))};
    }
    const std::size_t lanes = std::min<std::size_t>(W, end - i);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      out.visible[i + lane] = static_cast<std::uint8_t>(bits >> lane & 1u);
      out.place[i + lane] = (bits >> lane & 1u) != 0 ? 0u : ProjectedSplats<T>::nowhere;
    }
  }
  workspace.sort.counts[chunk] = static_cast<std::uint32_t>(entry - (workspace.sort.entries.data() + begin));
  workspace.partial[chunk] = {smallest, largest, scrubbed};
}

/// More bytes of splats than this are written past the caches: they would not stay there, and reading each line before
/// it is overwritten, in random order, was two thirds of the time of step 3 at 300k Gaussians. Fewer are left in the
/// cache for binning.
inline constexpr std::size_t streaming_bytes = std::size_t{8} << 20;

/// Step 3 for Gaussians [begin, end): the splats of the visible ones, each to its place.
template <Accuracy accuracy, bool streaming, class T, int W, class Effects = NoRasterEffects>
void write_splats(const GaussianColumns<const T>& gaussians, const LensView<T, typename Effects::Lens>& view,
                  const ProjectionSettings<T, typename Effects::Lens>& settings, std::size_t begin, std::size_t end,
                  ProjectedSplats<T>& out) {
  using P = Pack<T, W>;
  const P limit(static_cast<T>(color_limit));
  for (std::size_t i = begin; i < end; i += W) {
    const std::size_t lanes = std::min<std::size_t>(W, end - i);
    std::array<T*, W> record;
    bool some = false;
    for (std::size_t lane = 0; lane < W; ++lane) {
      const std::uint32_t place = lane < lanes ? out.place[i + lane] : ProjectedSplats<T>::nowhere;
      record[lane] = place != ProjectedSplats<T>::nowhere
                         ? reinterpret_cast<T*>(out.splats.data() + (place & ~ProjectedSplats<T>::pivot_bit))
                         : nullptr;
      some = some || record[lane] != nullptr;
    }
    if (!some) continue;
    const LoadedGaussians<P> g = load_gaussians<T, W>(gaussians, i);
    const ScreenGaussians<P> s = to_screen<accuracy, T, W, Effects>(view, g, settings);
    std::array<P, 3> color;
    for (std::size_t k = 0; k < 3; ++k) {
      const P c = P::load(gaussians.color[k] + i);
      // infinite, NaN and next to nothing become 0, large is clamped (docs/spec/numerics.md, BF9, SY4)
      color[k] = keep((c - c == P(T(0))) & (abs(c) >= P(static_cast<T>(color_floor))), min(max(c, -limit), limit));
    }
    const P zero(T(0));
    const P pivot = select(s.footprint.pivot_x, P(T(1)), zero);
    store_records<P, streaming>(
        {s.u, s.v, s.footprint.slope, s.footprint.major, s.footprint.minor, pivot, s.opacity, color[0], color[1],
         color[2], s.at.point[2], s.sigma_max, s.half_width, s.half_height, zero, zero},
        record);
    const unsigned pivots = s.footprint.pivot_x.bits();
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (record[lane] != nullptr && (pivots >> lane & 1u) != 0) out.place[i + lane] |= ProjectedSplats<T>::pivot_bit;
    }
  }
  if constexpr (streaming) streaming_fence();
}

}  // namespace detail

/// Projects, culls and sorts. `gaussians` columns must be readable up to the next multiple of 16 rows (GaussianBatch
/// is). A Gaussian with a non-finite mean, scale, rotation or opacity is dropped; a non-finite colour becomes 0 and a
/// colour beyond +-100 is clamped; `scrubbed` counts all of these, visible or not. Fewer than 2^31 Gaussians.
template <Accuracy accuracy, class T, int W = native_width<T>, class Effects = NoRasterEffects, Executor E>
RasterReport project(GaussianColumns<const T> gaussians, const Camera<T>& camera,
                     const ProjectionSettings<T, typename Effects::Lens>& settings, ProjectedSplats<T>& out,
                     ProjectWorkspace<T>& workspace, E& executor) {
  const std::size_t n = gaussians.count;
  COMPMARK_ASSERT(n < ProjectedSplats<T>::pivot_bit, "project: too many Gaussians for a 31-bit index");
  const detail::LensView<T, typename Effects::Lens> view(camera, settings.lens);
  const std::size_t chunks = chunk_count(n, detail::project_grain);
  out.gaussians = n;
  out.visible.resize(n);
  out.place.resize(n);
  workspace.sort.entries.resize(n);
  workspace.sort.counts.resize(chunks);
  workspace.partial.resize(chunks);
  executor.for_chunks(n, detail::project_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    detail::find_visible<accuracy, T, W, Effects>(gaussians, view, settings, begin, end, out, workspace);
  });
  RasterReport report;
  DepthKey<T> smallest = std::numeric_limits<DepthKey<T>>::max(), largest = 0;
  for (const auto& partial : workspace.partial) {
    smallest = std::min(smallest, partial.smallest);
    largest = std::max(largest, partial.largest);
    report.scrubbed += partial.scrubbed;
  }
  out.count = depth_sort(workspace.sort, chunks, detail::project_grain, smallest, largest, executor);
  report.visible = out.count;
  out.splats.resize(out.count);
  out.source.resize(out.count);
  executor.for_chunks(out.count, std::size_t{8192}, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t rank = begin; rank < end; ++rank) {
      const std::uint32_t index = workspace.sort.entries[rank].index;
      out.source[rank] = index;
      out.place[index] = static_cast<std::uint32_t>(rank);
    }
  });
  executor.for_chunks(n, detail::project_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    if (out.count * sizeof(Splat<T>) > detail::streaming_bytes) {
      detail::write_splats<accuracy, true, T, W, Effects>(gaussians, view, settings, begin, end, out);
    } else {
      detail::write_splats<accuracy, false, T, W, Effects>(gaussians, view, settings, begin, end, out);
    }
  });
  return report;
}

}  // namespace compmark
