// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// CameraTangent: an image and its derivatives by the nine numbers of a camera (scene/register/camera_step.hpp), for
// Gauss-Newton, which needs them pixel by pixel. Forward mode: every splat carries how its mean and its covariance move
// with each number, so that with v = dsigma/d(pixel - mean) and S the covariance on the screen
//     d ln(alpha) = v . dmean + v^T dS v / 2,        dC = sum over splats of T dalpha (c - behind),
// `behind` being what is seen behind a splat: the finished colour less what has been blended, over the transmittance.
// Opacities and colours are held: those that a network gives by the direction of view move with the camera as well, but
// Gauss-Newton renders the true image at every step and needs no more of its derivative than this. A clamped alpha has
// derivative 0, a cut-off one too. A rasterizer of its own beside the tile rasterizer, in whose lists it walks: what
// does not ask for tangents does not change. Cost: forward, and about twice it for the derivatives; 27 planes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gaussians.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/register/camera_step.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/project.hpp"
#include "compmark/splat/raster/tile.hpp"
#include "compmark/splat/raster/tile_block.hpp"
#include "compmark/splat/raster/tile_reach.hpp"

namespace compmark {

namespace detail {

/// How one splat moves with one number of the camera: mean, half the variances, covariance; and ln(opacity) by a filter.
template <class T>
struct SplatMove {
  T u, v, half_xx, xy, half_yy, opacity;
};
template <class T>
struct alignas(64) SplatMoves {
  SplatMove<T> by[camera_parameters];
};

/// The moves of the visible among Gaussians [begin, end), each at its place in depth order.
template <class T, int W, class Filter>
void splat_moves(const GaussianColumns<const T>& gaussians, const PinholeView<T>& view,
                 const ProjectionSettings<T>& settings, const ProjectedSplats<T>& projected, SplatMoves<T>* moves,
                 std::size_t begin, std::size_t end) {
  using P = Pack<T, W>;
  const P zero(T(0)), one(T(1));
  for (std::size_t i = begin; i < end; i += W) {
    const std::size_t lanes = std::min<std::size_t>(W, end - i);
    if (std::all_of(projected.visible.data() + i, projected.visible.data() + i + lanes,
                    [](std::uint8_t visible) { return visible == 0; }))
      continue;
    const LoadedGaussians<P> g = load_gaussians<T, W>(gaussians, i);
    const CameraPoint<P> at = camera_point<T, W>(view, g.mean, settings.near_plane);
    const std::array<P, 9> r = quaternion_matrix(g.rotation);
    const ScreenAxes<P> axes = screen_axes(screen_jacobian<T, W>(view, at), r, g.scale);
    std::array<P, 6> filter;
    if constexpr (Filter::active)
      filter = Filter::log_gradient(axes.v, footprint_of(axes.v, settings.blur_variance).determinant,
                                    settings.blur_variance);
    std::array<P, 9> local;  // the axes of the Gaussian in the camera frame, columns
    for (std::size_t j = 0; j < 3; ++j) {
      const P scale = axes.shrink * min(g.scale[j], P(static_cast<T>(scale_limit)));
      for (std::size_t k = 0; k < 3; ++k)
        local[3 * k + j] =
            scale * fma(P(view.rotation[3 * k]), r[j],
                        fma(P(view.rotation[3 * k + 1]), r[3 + j], P(view.rotation[3 * k + 2]) * r[6 + j]));
    }
    const std::array<T, 2> focal{view.fx, view.fy};
    const std::array<P, 2> ratio{at.x_over_z, at.y_over_z}, clamped{at.clamped_x, at.clamped_y};
    std::array<std::array<P, 6>, camera_parameters> move;
    for (std::size_t p = 0; p < camera_parameters; ++p) {
      // e_p x (.) for a rotation; a translation moves the point alone.
      const std::size_t after = (p + 1) % 3, last = (p + 2) % 3;
      std::array<P, 3> d_point{zero, zero, zero};
      std::array<P, 9> d_local;
      d_local.fill(zero);
      if (p < 3) {
        d_point[after] = -at.point[last];
        d_point[last] = at.point[after];
        for (std::size_t j = 0; j < 3; ++j) {
          d_local[3 * after + j] = -local[3 * last + j];
          d_local[3 * last + j] = local[3 * after + j];
        }
      } else if (p < 6) {
        d_point[p - 3] = one;
      }
      std::array<P, 6> d_v;
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const auto free = clamped[axis] == ratio[axis];
        const P d_ratio = at.inverse_z * (d_point[axis] - ratio[axis] * d_point[2]);
        // The limits of the clamp are of the image, and move with its intrinsics (lens_view.hpp).
        const P d_limit = p == 6 ? -clamped[axis] : p == 7 + axis ? P(T(-1) / focal[axis]) : zero;
        const P d_clamped = select(free, d_ratio, d_limit);
        const P growth = (p == 6 ? one : zero) - d_point[2] * at.inverse_z, factor = P(focal[axis]) * at.inverse_z;
        for (std::size_t j = 0; j < 3; ++j)
          d_v[3 * axis + j] =
              fma(axes.v[3 * axis + j], growth,
                  factor * (d_local[3 * axis + j] - clamped[axis] * d_local[6 + j] - d_clamped * local[6 + j]));
        move[p][axis] = P(focal[axis]) * (d_ratio + (p == 6 ? ratio[axis] : zero)) + (p == 7 + axis ? one : zero);
      }
      const auto dot = [](const P* a, const P* b) { return fma(a[0], b[0], fma(a[1], b[1], a[2] * b[2])); };
      move[p][2] = dot(axes.v.data(), d_v.data());
      move[p][3] = dot(axes.v.data(), d_v.data() + 3) + dot(axes.v.data() + 3, d_v.data());
      move[p][4] = dot(axes.v.data() + 3, d_v.data() + 3);
      move[p][5] = zero;
      if constexpr (Filter::active)
        move[p][5] = dot(filter.data(), d_v.data()) + dot(filter.data() + 3, d_v.data() + 3);
    }
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      if (projected.visible[i + lane] == 0) continue;
      SplatMoves<T>& to = moves[projected.place[i + lane] & ~ProjectedSplats<T>::pivot_bit];
      for (std::size_t p = 0; p < camera_parameters; ++p) {
        const int at_lane = static_cast<int>(lane);
        to.by[p] = {move[p][0].lane(at_lane), move[p][1].lane(at_lane), move[p][2].lane(at_lane),
                    move[p][3].lane(at_lane), move[p][4].lane(at_lane), move[p][5].lane(at_lane)};
      }
    }
  }
}

/// Scratch of one worker.
template <class T>
struct TangentScratch {
  CellSplat<T> splats[chunk_splats];
  alignas(64) T remaining[3][cell_blocks][block_pixels];  // of the finished colour, behind what was blended
  alignas(64) T transmittance[cell_blocks][block_pixels];
  alignas(64) T tangent[3 * camera_parameters][cell_blocks][block_pixels];
};

/// One block through the splats of a chunk that forward blended in it. Not inlined, so that every executor runs the
/// same instructions.
template <Accuracy accuracy, int W, class Filter, class T>
__attribute__((noinline)) void tangent_block(std::span<const std::uint32_t> list, const SplatMoves<T>* moves,
                                             const std::uint64_t (&blended)[chunk_words], int block,
                                             TangentScratch<T>& scratch) {
  using P = Pack<T, W>;
  const BlockList met(blended, (list.size() + 63) / 64);
  const T* const x_at = cell_table<T>.at[0][block];
  const T* const y_at = cell_table<T>.at[1][block];
  for (int j = 0; j < block_pixels; j += W) {
    const P x = P::load(x_at + j), y = P::load(y_at + j);
    P transmittance = P::load(scratch.transmittance[block] + j);
    std::array<P, 3> remaining;
    std::array<P, 3 * camera_parameters> sum;
    for (std::size_t c = 0; c < 3; ++c) remaining[c] = P::load(scratch.remaining[c][block] + j);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = P::load(scratch.tangent[k][block] + j);
    for (std::size_t next = 0; next < met.size; ++next) {
      const CellSplat<T>& splat = scratch.splats[met.index[next]];
      const InStep<P, 1> raw = raw_alpha<accuracy, 1, T, W>({&splat}, x, y, x_at + j);
      const Blend<T, W> blend_here = blend<accuracy, true>(raw.part[0], transmittance);
      const std::array<T, 3> color{splat.red, splat.green, splat.blue};
      // Behind a splat that covers all but nothing there is nothing to see; alpha is clamped there.
      const P behind = P(T(1)) / max(abs(transmittance), P(T(1e-12)));
      std::array<P, 3> light;
      for (std::size_t c = 0; c < 3; ++c) {
        remaining[c] = fma(-blend_here.weight, P(color[c]), remaining[c]);
        light[c] = blend_here.chain * (P(color[c]) - behind * remaining[c]);
      }
      constexpr T factor = T(2) / sigma_unit<accuracy, T>;
      const P w = factor * fma(x, P(splat.wx), fma(y, P(splat.wy), P(splat.w0)));
      const P b = factor * fma(P::load(x_at + j + splat.axis), P(splat.bd), P(splat.b0));
      const P bx(splat.axis == 0 ? splat.bd : T(0)), by(splat.axis == 0 ? T(0) : splat.bd);
      const P vx = fma(w, P(splat.wx), b * bx), vy = fma(w, P(splat.wy), b * by);
      const P xx = vx * vx, xy = vx * vy, yy = vy * vy;
      const SplatMoves<T>& move = moves[list[met.index[next]]];
      for (std::size_t p = 0; p < camera_parameters; ++p) {
        const SplatMove<T>& m = move.by[p];
        P grows = fma(xx, P(m.half_xx), fma(xy, P(m.xy), yy * P(m.half_yy)));
        grows = fma(vx, P(m.u), fma(vy, P(m.v), grows));
        if constexpr (Filter::active) grows += P(m.opacity);
        for (std::size_t c = 0; c < 3; ++c) sum[3 * p + c] = fma(grows, light[c], sum[3 * p + c]);
      }
    }
    transmittance.store(scratch.transmittance[block] + j);
    for (std::size_t c = 0; c < 3; ++c) remaining[c].store(scratch.remaining[c][block] + j);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k].store(scratch.tangent[k][block] + j);
  }
}

}  // namespace detail

template <class T, Accuracy accuracy = accuracy::standard, class Filter = NoFilter, int W = detail::block_width<T>>
class CameraTangent {
  static_assert(accuracy.tile_size == detail::cell_side && !accuracy.published_backward &&
                    accuracy.stop == StopRule::inclusive,
                "CameraTangent: tiles of 16 pixels, the library's own rules of stopping and clamping");

 public:
  using Effects = RasterEffects<PinholeLens, Filter>;
  using Raster = TileRasterizer<T, accuracy, RasterOutputs{}, W, Effects>;

  struct Context {
    typename Raster::Context raster;
    Buffer<detail::SplatMoves<T>> moves;  // [visible splats]
    PerWorker<detail::TangentScratch<T>> scratch;
  };

  CameraTangent() = default;
  CameraTangent(T near_plane, T blur_variance) : near_plane_(near_plane), blur_variance_(blur_variance) {}

  /// Overwrites image [3, height, width] and tangents [27, height, width]: plane 3 p + c is the derivative of colour c
  /// by number p of the camera. The columns must be readable up to the next multiple of 16 rows. Error: the view has
  /// more pairs of splats and tiles than the rasterizer takes; the tangents are then zero. Same bits at any thread
  /// count.
  template <Executor E>
  Result<Done> render(GaussianColumns<const T> gaussians, const Camera<T>& camera, std::array<T, 3> background,
                      ImageView<T> image, ImageView<T> tangents, Context& ctx, E& executor) const {
    COMPMARK_ASSERT(tangents.channels == 27 && tangents.height == camera.height && tangents.width == camera.width,
                    "CameraTangent: the tangents must be [27, camera.height, camera.width]");
    typename Raster::Settings settings;
    settings.near_plane = near_plane_;
    settings.blur_variance = blur_variance_;
    RasterReport report = Raster(settings).forward(gaussians, camera, background, image, ctx.raster, executor);
    const ProjectedSplats<T>& projected = ctx.raster.projected;
    ctx.moves.resize(projected.count);
    const detail::PinholeView<T> view(camera);
    const ProjectionSettings<T> projection{near_plane_, blur_variance_, {}};
    executor.for_chunks(gaussians.count, detail::project_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      detail::splat_moves<T, native_width<T>, Filter>(gaussians, view, projection, projected, ctx.moves.data(), begin,
                                                      end);
    });
    ctx.scratch.resize(executor.concurrency());
    const TileLists& lists = ctx.raster.lists;
    const std::size_t tiles = static_cast<std::size_t>(lists.tiles_x) * static_cast<std::size_t>(lists.tiles_y);
    executor.for_chunks(tiles, std::size_t{4}, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      for (std::size_t tile = begin; tile < end; ++tile) tangent_cell(tile, image, tangents, ctx, ctx.scratch[worker]);
    });
    if (report.error) return std::move(*report.error);
    return Done{};
  }

 private:
  static void tangent_cell(std::size_t tile, ImageView<const T> image, ImageView<T> tangents, const Context& ctx,
                           detail::TangentScratch<T>& scratch) {
    const TileLists& lists = ctx.raster.lists;
    const auto across = static_cast<std::size_t>(lists.tiles_x);
    const detail::CellPlace place{static_cast<int>(tile % across) * detail::cell_side,
                                  static_cast<int>(tile / across) * detail::cell_side, image.width, image.height};
    const std::span<const std::uint32_t> list =
        lists.splat.span().subspan(lists.begin[tile], lists.begin[tile + 1] - lists.begin[tile]);
    std::fill_n(&scratch.tangent[0][0][0], sizeof(scratch.tangent) / sizeof(T), T(0));
    detail::each_block_row(
        place, [&](int block, int lane, std::size_t /*offset*/, int count) __attribute__((always_inline)) {
          for (int i = 0; i < detail::block_side; ++i) scratch.transmittance[block][lane + i] = i < count ? T(1) : T(0);
        });
    for (int c = 0; c < 3; ++c) detail::load_cell(image.plane(c), place, scratch.remaining[c]);
    const std::size_t opened = ctx.raster.opened[tile];
    for (std::size_t chunk = 0; chunk < opened; ++chunk) {
      const std::size_t first = chunk * detail::chunk_splats;
      const auto part = list.subspan(first, std::min(detail::chunk_splats, list.size() - first));
      for (std::size_t k = 0; k < part.size(); ++k) {
        // Waiting for the moves of one splat after the other was two thirds of the time at 180,000 splats.
        const char* const move = reinterpret_cast<const char*>(ctx.moves.data() + part[k]);
        for (std::size_t line = 0; line < sizeof(detail::SplatMoves<T>); line += 64) __builtin_prefetch(move + line);
        detail::to_cell(ctx.raster.white[part[k]], static_cast<T>(place.x), static_cast<T>(place.y), scratch.splats[k]);
      }
      const detail::ChunkRecord<T>& record = ctx.raster.chunks[ctx.raster.first_chunk[tile] + chunk];
      for (int block = 0; block < detail::cell_blocks; ++block)
        detail::tangent_block<accuracy, W, Filter>(part, ctx.moves.data(), record.blended[block], block, scratch);
    }
    for (int k = 0; k < tangents.channels; ++k) detail::store_cell(scratch.tangent[k], place, tangents.plane(k));
  }

  T near_plane_ = T(0.2);
  T blur_variance_ = T(0.3);
};

}  // namespace compmark
