// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// (1 - lambda) mean |x - y| + lambda (1 - SSIM(x, y)) and its gradient in one pass over bands of rows
// (docs/spec/method.md, 3.1; Scaffold-GS eq. 9). A band is a fixed chunk: it recomputes the ten rows of halo it shares
// with its neighbours instead of storing three maps of the whole image, keeps its maps in a ring of 18 rows inside the
// second-level cache, and adds up its own rows in double. Cost per sample: 330 flop and (1 + 10 / band) times 94 more
// for the halo; bytes: x and y read, d read and written once (16 a sample).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/gradient_mode.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/loss/photometric_scratch.hpp"
#include "compmark/splat/loss/ssim.hpp"

namespace compmark {

/// What one evaluation found; `loss` = (1 - lambda) l1 + lambda (1 - ssim), without the caller's weight.
struct PhotometricReport {
  double l1 = 0;
  double ssim = 0;
  double loss = 0;
};

/// L1 + SSIM of planar images of any channel count and size (1 x 1 works: the window sees zeros outside the image, as
/// published).
template <class T>
class PhotometricLoss {
 public:
  using Scalar = T;
  struct Settings {
    T lambda_dssim = T(0.2);
  };
  /// Scratch, grow-only: 83 rows of the image's width + 32 scalars a worker, 16 bytes a band.
  struct Context {
    PerWorkerRows<T> scratch;
    Buffer<double> partial;
  };

  Settings settings;

  PhotometricLoss() = default;
  explicit PhotometricLoss(const Settings& chosen) : settings(chosen) {}

  template <Executor E>
  PhotometricReport forward(ImageView<const T> rendered, ImageView<const T> target, Context& context,
                            E& executor) const {
    return run<false, GradientMode::add>(rendered, target, T(0), {}, context, executor);
  }
  /// ADDS weight dloss/drendered to d_rendered, or sets it. Neither image is clamped (the published loss is not).
  template <GradientMode mode = GradientMode::add, Executor E>
  PhotometricReport forward_backward(ImageView<const T> rendered, ImageView<const T> target, T weight,
                                     ImageView<T> d_rendered, Context& context, E& executor) const {
    COMPMARK_ASSERT(d_rendered.size() == rendered.size(), "PhotometricLoss: gradient and image differ in size");
    return run<true, mode>(rendered, target, weight, d_rendered, context, executor);
  }

 private:
  using P = Pack<T, native_width<T>>;
  using M = typename P::MaskType;
  using Taps = detail::SsimTaps<P>;
  static constexpr int lanes = P::width;
  static constexpr int band_rows = 96;
  static constexpr int step = 4;  // rows of one vertical pass: 16 sums, 6 taps and 5 temporaries fill the 32 registers
  static constexpr int window_rows = step + 2 * ssim_radius;

  using Scratch = detail::PhotometricScratch<T, step>;
  struct Sums {
    double l1 = 0;
    double distance = 0;
  };

  template <bool Backward, GradientMode mode, class E>
  PhotometricReport run(ImageView<const T> x, ImageView<const T> y, T weight, ImageView<T> d_x, Context& context,
                        E& executor) const {
    COMPMARK_ASSERT(x.channels == y.channels && x.height == y.height && x.width == y.width,
                    "PhotometricLoss: two shapes");
    if (x.size() == 0) return {0, 1, 0};
    const std::size_t padded = (static_cast<std::size_t>(x.width) + lanes - 1) / lanes * lanes;
    const std::size_t stride = padded + 2 * Scratch::margin;
    context.scratch.resize(executor.concurrency(), stride * Scratch::rows);
    const std::size_t bands = chunk_count(static_cast<std::size_t>(x.height), band_rows);
    const std::size_t chunks = bands * static_cast<std::size_t>(x.channels);
    context.partial.resize(2 * chunks);
    const T scale = weight / static_cast<T>(x.size());
    executor.for_chunks(chunks, 1, [&](std::size_t chunk, std::size_t, std::size_t worker) {
      const int channel = static_cast<int>(chunk / bands);
      const int begin = static_cast<int>(chunk % bands) * band_rows;
      const Scratch scratch{context.scratch.row(worker), stride};
      const Sums sums =
          band<Backward, mode>(x, y, scale, d_x, channel, begin, std::min(begin + band_rows, x.height), scratch);
      context.partial[2 * chunk] = sums.l1;
      context.partial[2 * chunk + 1] = sums.distance;
    });
    Sums total;
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
      total.l1 += context.partial[2 * chunk];
      total.distance += context.partial[2 * chunk + 1];
    }
    const double count = static_cast<double>(x.size());
    const double lambda = static_cast<double>(settings.lambda_dssim);
    const double l1 = total.l1 / count;
    const double distance = total.distance / count;
    return {l1, 1 - distance, (1 - lambda) * l1 + lambda * distance};
  }

  template <bool Backward, GradientMode mode>
  Sums band(ImageView<const T> x, ImageView<const T> y, T scale, ImageView<T> d_x, int channel, int begin, int end,
            const Scratch& scratch) const {
    scratch.clear_margins();
    const int first_map = Backward ? std::max(0, begin - ssim_radius) : begin;
    const int last_map = Backward ? std::min(x.height, end + ssim_radius) : end;
    Sums sums;
    int gradient_row = begin;
    for (int row = first_map; row < last_map; row += step) {
      const int done = std::min(row + step, last_map);
      blur_vertically(x, y, channel, row, scratch);
      for (int r = row; r < done; ++r) {
        const bool own = r >= begin && r < end;
        make_maps<Backward>(x.row(channel, r), y.row(channel, r), x.width, r, r - row, own, sums, scratch);
      }
      if constexpr (Backward) {
        while (gradient_row < end && (std::min(gradient_row + step, end) + ssim_radius <= done || done == last_map)) {
          add_gradient<mode>(x, y, scale, d_x, channel, gradient_row, std::min(gradient_row + step, end), last_map,
                             scratch);
          gradient_row += step;
        }
      }
    }
    return sums;
  }

  /// Loads a pack of an image row; columns behind the last become 0, the value outside.
  template <bool Full>
  static COMPMARK_INLINE P load(const T* source, M mask) {
    if constexpr (Full) {
      return P::load(source);
    } else {
      return P::load(source, mask);
    }
  }
  /// f(column, bool_constant full, mask): all packs of a row, the last one masked.
  template <class F>
  static COMPMARK_INLINE void for_packs(int width, const F& f) {
    int column = 0;
    for (; column + lanes <= width; column += lanes) f(column, std::true_type{}, M::first(lanes));
    if (column < width) f(column, std::false_type{}, M::first(width - column));
  }

  void blur_vertically(ImageView<const T> x, ImageView<const T> y, int channel, int row, const Scratch& scratch) const {
    const Taps taps;
    std::array<const T*, window_rows> x_rows;
    std::array<const T*, window_rows> y_rows;
    for (int i = 0; i < window_rows; ++i) {
      const int source = row + i - ssim_radius;
      const bool inside = source >= 0 && source < x.height;
      x_rows[static_cast<std::size_t>(i)] = inside ? x.row(channel, source) : scratch.zeros();
      y_rows[static_cast<std::size_t>(i)] = inside ? y.row(channel, source) : scratch.zeros();
    }
    for_packs(
        x.width, [&](int column, auto full, M mask) __attribute__((always_inline)) {
          P sum[detail::ssim_blurs][step];
          detail::ssim_blur_columns<step>(
              taps,
              [&](int i, P& x_pack, P& y_pack) __attribute__((always_inline)) {
                x_pack = load<decltype(full)::value>(x_rows[static_cast<std::size_t>(i)] + column, mask);
                y_pack = load<decltype(full)::value>(y_rows[static_cast<std::size_t>(i)] + column, mask);
              },
              sum);
          for (int map = 0; map < detail::ssim_blurs; ++map) {
            for (int r = 0; r < step; ++r) sum[map][r].store(scratch.blurred(map, r) + column);
          }
        });
  }

  template <bool Backward>
  void make_maps(const T* x_row, const T* y_row, int width, int y, int r, bool own, Sums& sums,
                 const Scratch& scratch) const {
    const Taps taps;
    const T* mean_x = scratch.blurred(detail::blur_x, r);
    const T* mean_d = scratch.blurred(detail::blur_d, r);
    const T* mean_xy = scratch.blurred(detail::blur_xy, r);
    const T* mean_dd = scratch.blurred(detail::blur_dd, r);
    T* u = scratch.ring(detail::map_u, y);
    T* q = scratch.ring(detail::map_q, y);
    T* p = scratch.ring(detail::map_p, y);
    P l1(T(0));
    P distance(T(0));
    for_packs(
        width, [&](int column, auto full, M mask) __attribute__((always_inline)) {
          detail::SsimPoint<P> point = detail::ssim_point(
              detail::ssim_blur_row(taps, mean_x + column), detail::ssim_blur_row(taps, mean_d + column),
              detail::ssim_blur_row(taps, mean_xy + column), detail::ssim_blur_row(taps, mean_dd + column));
          if constexpr (!decltype(full)::value) {
            point = {keep(mask, point.distance), keep(mask, point.u), keep(mask, point.q), keep(mask, point.p)};
          }
          distance += point.distance;
          l1 += abs(load<decltype(full)::value>(x_row + column, mask) -
                    load<decltype(full)::value>(y_row + column, mask));
          if constexpr (Backward) {
            point.u.store(u + column);
            point.q.store(q + column);
            point.p.store(p + column);
          }
        });
    if (own) {
      sums.l1 += static_cast<double>(reduce_add(l1));
      sums.distance += static_cast<double>(reduce_add(distance));
    }
  }

  template <GradientMode mode>
  void add_gradient(ImageView<const T> x, ImageView<const T> y, T scale, ImageView<T> d_x, int channel, int begin,
                    int end, int map_end, const Scratch& scratch) const {
    const Taps taps;
    for (int map = 0; map < detail::ssim_maps; ++map) {
      std::array<const T*, window_rows> rows;
      for (int i = 0; i < window_rows; ++i) {
        const int source = begin + i - ssim_radius;
        rows[static_cast<std::size_t>(i)] =
            source >= 0 && source < map_end ? scratch.ring(map, source) : scratch.zeros();
      }
      for (int column = 0; column < x.width; column += lanes) {
        P sum[step];
        detail::unroll<step>([&](auto r) __attribute__((always_inline)) { sum[r()] = P(T(0)); });
        detail::unroll<window_rows>([&](auto i) __attribute__((always_inline)) {
          const P value = P::load(rows[static_cast<std::size_t>(i())] + column);
          detail::unroll<step>([&](auto r) __attribute__((always_inline)) {
            constexpr int k = decltype(i)::value - decltype(r)::value - ssim_radius;
            if constexpr (k >= -ssim_radius && k <= ssim_radius) sum[r()] = fma(taps.at(k), value, sum[r()]);
          });
        });
        for (int r = 0; r < step; ++r) sum[r].store(scratch.blurred_back(map, r) + column);
      }
    }
    const P weight_l1(scale * (T(1) - settings.lambda_dssim));
    const P weight_ssim(-scale * settings.lambda_dssim);
    for (int row = begin; row < end; ++row) {
      const T* u = scratch.blurred_back(detail::map_u, row - begin);
      const T* q = scratch.blurred_back(detail::map_q, row - begin);
      const T* p = scratch.blurred_back(detail::map_p, row - begin);
      const T* x_row = x.row(channel, row);
      const T* y_row = y.row(channel, row);
      T* d_row = d_x.row(channel, row);
      for_packs(
          x.width, [&](int column, auto full, M mask) __attribute__((always_inline)) {
            const P x_pack = load<decltype(full)::value>(x_row + column, mask);
            const P d = x_pack - load<decltype(full)::value>(y_row + column, mask);
            const P blurred_u = detail::ssim_blur_row(taps, u + column);
            const P blurred_q = detail::ssim_blur_row(taps, q + column);
            const P blurred_p = detail::ssim_blur_row(taps, p + column);
            const P slope = fma(x_pack - P(T(0.5)), blurred_q, blurred_u) - d * blurred_p;
            const P zero(T(0));
            const P sign =
                select(d > zero, P(T(1)), select(d < zero, P(T(-1)), zero));  // 0 at 0, unlike copysign (case LS9)
            P old = zero;
            if constexpr (mode == GradientMode::add) old = load<decltype(full)::value>(d_row + column, mask);
            const P sum = fma(weight_l1, sign, fma(weight_ssim, slope, old));
            if constexpr (decltype(full)::value) {
              sum.store(d_row + column);
            } else {
              sum.store(d_row + column, mask);
            }
          });
    }
  }
};

}  // namespace compmark
