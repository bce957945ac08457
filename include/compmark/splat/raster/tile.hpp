// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// TileRasterizer: project, sort, bin, blend tile by tile (concept Rasterizer, laws R1 to R6). Tiles are the chunks of
// the executor and every sum has a fixed order, so the bits do not depend on the number of threads. Cost
// (docs/concepts/TileRasterizer.md), all included, measured with AVX-512 at 3.8 GHz: ~27 cycles forward and ~47
// backward per block of 4 x 4 pixels and splat. Memory: 128 bytes a visible Gaussian, 72 bytes a (splat, tile) pair,
// 0.6 MB a worker. Longer than 300 lines: the loops of both directions over the same tiles, chunks and cells.
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
#include "compmark/core/gradient_mode.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/result.hpp"
#include "compmark/splat/raster/accuracy.hpp"
#include "compmark/splat/raster/bin.hpp"
#include "compmark/splat/raster/concept.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/outputs.hpp"
#include "compmark/splat/raster/project.hpp"
#include "compmark/splat/raster/project_backward.hpp"
#include "compmark/splat/raster/tile_backward.hpp"
#include "compmark/splat/raster/tile_forward.hpp"
#include "compmark/splat/raster/tile_hits.hpp"

namespace compmark {

/// See splat/raster/concept.hpp. `W` is the pack width, other than native for tests; `Effects` is a RasterEffects.
template <class T, Accuracy accuracy = accuracy::standard, RasterOutputs outputs = RasterOutputs{},
          int W = detail::block_width<T>, class Effects = NoRasterEffects>
class TileRasterizer {
  static_assert(accuracy.tile_size > 0 && accuracy.tile_size % detail::cell_side == 0,
                "TileRasterizer: Accuracy::tile_size must be a multiple of 16");
  static_assert(accuracy.exp_degree == 0 || (accuracy.exp_degree >= 2 && accuracy.exp_degree <= 6),
                "TileRasterizer: Accuracy::exp_degree must be 0 (std::exp) or 2 to 6");
  static_assert(detail::block_pixels % W == 0, "TileRasterizer: the pack width must divide 16");

 public:
  using Scalar = T;
  static constexpr Accuracy accuracy_policy = accuracy;
  static constexpr RasterOutputs output_policy = outputs;
  using EffectPolicy = Effects;

  struct Settings {
    T near_plane = T(0.2);     ///< world units; Gaussians at or before it are culled
    T blur_variance = T(0.3);  ///< pixels^2, added to both variances of the footprint (the published low-pass filter)
    BinSettings bin{};         ///< budget of (splat, tile) pairs
    [[no_unique_address]] typename Effects::Lens lens{};  ///< coefficients of the lens; nothing for a pinhole
  };

  /// Everything forward leaves for backward. Grow-only: after warm-up nothing is allocated.
  struct Context : std::conditional_t<outputs.alpha, detail::AlphaPlane<T>, detail::NoAlphaPlane>,
                   std::conditional_t<outputs.depth, detail::DepthPlane<T>, detail::NoDepthPlane>,
                   std::conditional_t<outputs.screen_statistics, detail::GradientNorms<T>, detail::NoGradientNorms> {
    ProjectedSplats<T> projected;
    ProjectWorkspace<T> project_workspace;
    TileLists lists;
    BinWorkspace bin_workspace;
    Buffer<detail::WhiteSplat<T>> white;    // [count]
    Buffer<std::size_t> first_chunk;        // [tiles + 1], for one cell of the tile
    Buffer<detail::ChunkRecord<T>> chunks;  // [first_chunk[tiles] * cells of a tile]
    Buffer<std::uint32_t> opened;           // [tiles * cells] chunks that forward worked on
    PerWorker<detail::ForwardScratch<T>> forward_scratch;
    PerWorker<detail::BackwardScratch<accuracy, T>> backward_scratch;
    Buffer<SplatGradient<T>> pair_gradients;   // [pairs] as TileLists::splat
    Buffer<SplatGradient<T>> splat_gradients;  // [gaussians], of the visible ones
  };

  TileRasterizer() = default;
  explicit TileRasterizer(const Settings& settings) : settings_(settings) {}
  [[nodiscard]] const Settings& settings() const { return settings_; }

  template <Executor E>
  RasterReport forward(GaussianColumns<const T> gaussians, const Camera<T>& camera, std::array<T, 3> background,
                       ImageView<T> image, Context& ctx, E& executor) const {
    COMPMARK_ASSERT(image.channels == 3 && image.height == camera.height && image.width == camera.width,
                    "TileRasterizer: the image must be [3, camera.height, camera.width]");
    RasterReport report = project<accuracy, T, native_width<T>, Effects>(gaussians, camera, projection(), ctx.projected,
                                                                         ctx.project_workspace, executor);
    ctx.white.resize(ctx.projected.count);
    const Result<Done> binned =
        bin<accuracy>(ctx.projected, camera.width, camera.height, settings_.bin, ctx.lists, ctx.bin_workspace, executor,
                      [&](std::size_t first, std::size_t lanes, const auto& splats) {
                        detail::store_white<accuracy>(ctx.white.data() + first, lanes, splats);
                      });
    if (!binned) report.error = binned.error();
    report.pairs = ctx.lists.pairs;
    blend_whitened(camera.width, camera.height, background, image, ctx, executor);
    return report;
  }

  /// The pixel loop alone, for splats and lists that are already in the context.
  template <Executor E>
  void blend_forward(int width, int height, const std::array<T, 3>& background, ImageView<T> image, Context& ctx,
                     E& executor) const {
    using P = Pack<T, native_width<T>>;
    ctx.white.resize(ctx.projected.count);
    executor.for_chunks(ctx.projected.count, splat_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; i += P::width)
        detail::store_white<accuracy>(ctx.white.data() + i, std::min<std::size_t>(P::width, end - i),
                                      detail::load_splats<P>(ctx.projected.splats.data() + i, end - i));
    });
    blend_whitened(width, height, background, image, ctx, executor);
  }

  /// The same for splats that are already whitened.
  template <Executor E>
  void blend_whitened(int width, int height, const std::array<T, 3>& background, ImageView<T> image, Context& ctx,
                      E& executor) const {
    const std::size_t tiles = tile_count(ctx.lists);
    ctx.first_chunk.resize(tiles + 1);
    std::size_t chunks = 0;
    for (std::size_t tile = 0; tile < tiles; ++tile) {
      ctx.first_chunk[tile] = chunks;
      chunks += detail::list_chunks(ctx.lists.begin[tile + 1] - ctx.lists.begin[tile]);
    }
    ctx.first_chunk[tiles] = chunks;
    ctx.chunks.resize(chunks * cells);
    ctx.opened.resize(tiles * cells);
    ctx.forward_scratch.resize(executor.concurrency());
    detail::ForwardPlanes<T> planes{image};
    if constexpr (outputs.alpha) {
      ctx.alpha.resize(image.plane_size());
      planes.alpha = ctx.alpha.data();
    }
    if constexpr (outputs.depth) {
      ctx.depth.resize(image.plane_size());
      planes.depth = ctx.depth.data();
    }
    executor.for_chunks(tiles, tile_grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      for (std::size_t tile = begin; tile < end; ++tile) {
        for (std::size_t cell = 0; cell < cells; ++cell) {
          const detail::CellPlace place = place_of(ctx.lists, tile, cell, width, height);
          const std::size_t opened =
              place.x >= width || place.y >= height
                  ? 0
                  : detail::forward_cell<accuracy, outputs, W, T>(
                        ctx.white.span(), list_of(ctx.lists, ctx.lists.splat, tile), upcoming(ctx.lists, tile, end),
                        place, background, planes, chunks_of(ctx, tile, cell), ctx.forward_scratch[worker]);
          ctx.opened[tile * cells + cell] = static_cast<std::uint32_t>(opened);
        }
      }
    });
  }

  /// With GradientMode::set, d_gaussians is overwritten instead of added to (rows of invisible Gaussians become 0).
  template <GradientMode mode = GradientMode::add, Executor E>
  void backward(GaussianColumns<const T> gaussians, const Camera<T>& camera, std::array<T, 3> background,
                ImageView<const T> d_image, GaussianColumns<T> d_gaussians, Context& ctx, E& executor) const {
    backward<mode>(gaussians, camera, background, d_image, PlaneGradients<T>{}, d_gaussians, ctx, executor);
  }

  /// With gradients of the alpha and depth planes that `outputs` asked for.
  template <GradientMode mode = GradientMode::add, Executor E>
  void backward(GaussianColumns<const T> gaussians, const Camera<T>& camera, std::array<T, 3> background,
                ImageView<const T> d_image, const PlaneGradients<T>& d_planes, GaussianColumns<T> d_gaussians,
                Context& ctx, E& executor) const {
    blend_backward(camera.width, camera.height, background, d_image, d_planes, ctx, executor);
    std::span<T> norms;
    if constexpr (outputs.screen_statistics) {
      ctx.gradient_norm.resize(gaussians.count);
      norms = ctx.gradient_norm.span();
    }
    project_backward<accuracy, T, native_width<T>, mode, Effects>(
        gaussians, camera, projection(), ctx.projected, std::span<const SplatGradient<T>>(ctx.splat_gradients.span()),
        d_gaussians, norms, executor);
  }

  /// The pixel loop alone: leaves the sums of every splat in ctx.splat_gradients.
  template <Executor E>
  void blend_backward(int width, int height, const std::array<T, 3>& background, ImageView<const T> d_image,
                      const PlaneGradients<T>& d_planes, Context& ctx, E& executor) const {
    COMPMARK_ASSERT(outputs.alpha || d_planes.alpha.data == nullptr,
                    "TileRasterizer: a gradient of alpha needs RasterOutputs{.alpha = true}");
    COMPMARK_ASSERT(outputs.depth || d_planes.depth.data == nullptr,
                    "TileRasterizer: a gradient of depth needs RasterOutputs{.depth = true}");
    const std::size_t tiles = tile_count(ctx.lists);
    ctx.pair_gradients.resize(ctx.lists.pairs);
    ctx.backward_scratch.resize(executor.concurrency());
    const bool streaming = cells == 1 && ctx.lists.pairs > detail::streaming_records;
    const detail::BackwardPlanes<T> planes{d_image, d_planes.alpha.data, d_planes.depth.data};
    executor.for_chunks(tiles, tile_grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      for (std::size_t tile = begin; tile < end; ++tile) {
        for (std::size_t cell = 0; cell < cells; ++cell) {
          const detail::CellPlace place = place_of(ctx.lists, tile, cell, width, height);
          if (place.x >= width || place.y >= height) continue;  // cell 0 is always inside
          detail::backward_cell<accuracy, outputs, W, T>(
              ctx.white.span(), list_of(ctx.lists, ctx.lists.splat, tile), last_chunk(ctx, tile + 1, end), place,
              background, planes, chunks_of(ctx, tile, cell), ctx.opened[tile * cells + cell], cell != 0, streaming,
              ctx.pair_gradients.data() + ctx.lists.begin[tile], ctx.backward_scratch[worker]);
        }
      }
    });
    ctx.splat_gradients.resize(ctx.projected.gaussians);
    executor.for_chunks(ctx.projected.count, splat_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) sum_pairs(ctx, i);
      streaming_fence();
    });
  }

  [[nodiscard]] ScreenStatistics<T> screen(const Context& ctx) const {
    ScreenStatistics<T> statistics{ctx.projected.visible.span(), {}};
    if constexpr (outputs.screen_statistics) statistics.gradient_norm = ctx.gradient_norm.span();
    return statistics;
  }

 private:
  static constexpr std::size_t splat_grain = 1024;
  static constexpr std::size_t records_ahead = 64;  // pairs between asking for a record and adding it
  static constexpr std::size_t tile_grain =
      8;  // neighbours share most of their splats, which then stay in the worker's cache
  static constexpr std::size_t cells_x = static_cast<std::size_t>(accuracy.tile_size / detail::cell_side);
  static constexpr std::size_t cells = cells_x * cells_x;

  [[nodiscard]] ProjectionSettings<T, typename Effects::Lens> projection() const {
    return {settings_.near_plane, settings_.blur_variance, settings_.lens};
  }
  [[nodiscard]] static std::size_t tile_count(const TileLists& lists) {
    return static_cast<std::size_t>(lists.tiles_x) * static_cast<std::size_t>(lists.tiles_y);
  }
  [[nodiscard]] static std::span<const std::uint32_t> list_of(const TileLists& lists,
                                                              const Buffer<std::uint32_t>& column, std::size_t tile) {
    return column.span().subspan(lists.begin[tile], lists.begin[tile + 1] - lists.begin[tile]);
  }
  /// The list that the same worker takes next, to have it in the cache by then.
  [[nodiscard]] static std::span<const std::uint32_t> upcoming(const TileLists& lists, std::size_t tile,
                                                               std::size_t end) {
    return tile + 1 < end ? list_of(lists, lists.splat, tile + 1) : std::span<const std::uint32_t>{};
  }
  /// The same for backward, which begins with the last chunk that forward opened.
  [[nodiscard]] static std::span<const std::uint32_t> last_chunk(const Context& ctx, std::size_t tile,
                                                                 std::size_t end) {
    if (tile >= end) return {};
    const std::span<const std::uint32_t> list = list_of(ctx.lists, ctx.lists.splat, tile);
    const std::size_t opened = ctx.opened[tile * cells];
    return opened == 0 ? std::span<const std::uint32_t>{} : list.subspan((opened - 1) * detail::chunk_splats);
  }
  [[nodiscard]] static detail::CellPlace place_of(const TileLists& lists, std::size_t tile, std::size_t cell, int width,
                                                  int height) {
    const auto tiles_x = static_cast<std::size_t>(lists.tiles_x);
    return {static_cast<int>(tile % tiles_x * cells_x + cell % cells_x) * detail::cell_side,
            static_cast<int>(tile / tiles_x * cells_x + cell / cells_x) * detail::cell_side, width, height};
  }
  [[nodiscard]] static detail::ChunkRecord<T>* chunks_of(Context& ctx, std::size_t tile, std::size_t cell) {
    const std::size_t length = ctx.first_chunk[tile + 1] - ctx.first_chunk[tile];
    return ctx.chunks.data() + ctx.first_chunk[tile] * cells + cell * length;
  }

  /// Ordered sum over the pairs of splat i, 32 at a time (docs/spec/numerics.md, BB3), and from whitened units to
  /// pixels.
  static void sum_pairs(Context& ctx, std::size_t i) {
    using P = Pack<T, W>;
    constexpr std::size_t packs = 16 / W;
    const std::size_t first = ctx.lists.first_slot[i], last = ctx.lists.first_slot[i + 1];
    const std::uint32_t* const position = ctx.lists.position.data();
    std::array<P, packs> sums;
    sums.fill(P(T(0)));
    for (std::size_t begin = first; begin < last; begin += 32) {
      std::array<P, packs> part;
      part.fill(P(T(0)));
      for (std::size_t slot = begin; slot < last && slot < begin + 32; ++slot) {
        if (slot + records_ahead < ctx.lists.pairs)
          __builtin_prefetch(&ctx.pair_gradients[position[slot + records_ahead]], 0, 2);
        const T* record = &ctx.pair_gradients[position[slot]].g;
        for (std::size_t m = 0; m < packs; ++m) part[m] += P::load(record + m * W);
      }
      for (std::size_t m = 0; m < packs; ++m) sums[m] += part[m];
    }
    alignas(64) std::array<T, 16> total;
    for (std::size_t m = 0; m < packs; ++m) sums[m].store(total.data() + m * W);
    const detail::WhiteSplat<T>& white = ctx.white[i];
    const bool pivot_x = white.bx != T(0);
    const T w = T(1) / (pivot_x ? white.wy : white.wx), b = T(1) / (white.bx + white.by);
    const auto sum = [&](std::size_t m) { return total[detail::record_lane[m]]; };
    // To the row of its Gaussian, whole lines past the caches, so that projection's backward pass reads in sequence.
    alignas(64) const std::array<T, 16> result{sum(0),         sum(1) * w, sum(2) * b, sum(3) * w * w, sum(4) * w * b,
                                               sum(5) * b * b, sum(6),     sum(7),     sum(8),         sum(9)};
    T* const target = &ctx.splat_gradients[ctx.projected.source[i]].g;
    for (std::size_t m = 0; m < packs; ++m) P::load(result.data() + m * W).store_streaming(target + m * W);
  }

  Settings settings_{};
};

/// A TileRasterizer with effects: EffectTileRasterizer<float, RasterEffects<FisheyeLens<float>, MipFilter>>.
template <class T, class Effects, Accuracy accuracy = accuracy::standard, RasterOutputs outputs = RasterOutputs{}>
using EffectTileRasterizer = TileRasterizer<T, accuracy, outputs, detail::block_width<T>, Effects>;

}  // namespace compmark
