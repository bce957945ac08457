// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The map E = 1 - SSIM of two planes, which growing looks at, its sum, and the gradient of the sum: the kernels of
// ssim.hpp over whole planes. (PhotometricLoss, which needs no map, keeps everything in a ring of rows instead.) A
// chunk of rows reads ten rows more than it writes, nothing is computed twice. Cost a pixel: 225 operations for the
// map, 144 for the gradient, 28 bytes written and read back between the two.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/unroll.hpp"
#include "compmark/splat/loss/photometric_scratch.hpp"
#include "compmark/splat/loss/ssim.hpp"

namespace compmark::detail {

template <class T>
class SimilarityMap {
 public:
  struct Context {
    Buffer<T> error;    ///< E [height, width]
    Buffer<T> between;  ///< [ssim_maps, height, padded width]
    PerWorkerRows<T> scratch;
    Buffer<double> partial;
  };

  /// Fills context.error and returns its sum; with Backward also what `gradient` needs.
  template <bool Backward, class E>
  static double measure(const T* x, const T* y, std::size_t height, std::size_t width, Context& context, E& executor) {
    context.error.resize(height * width);
    if constexpr (Backward) context.between.resize(ssim_maps * height * padded(width));
    context.scratch.resize(executor.concurrency(), stride(width) * Scratch::rows);
    context.partial.resize(chunk_count(height, grain));
    return sum_rows(height, width, context, executor, [&](std::size_t begin, std::size_t end, const Scratch& scratch) {
      return measure_rows<Backward>(x, y, height, width, begin, end, scratch, context);
    });
  }

  /// d_x = weight times the gradient of the sum of E by x; written, not added. After measure<true> of the same planes.
  template <class E>
  static void gradient(const T* x, const T* y, std::size_t height, std::size_t width, T weight, T* d_x,
                       Context& context, E& executor) {
    executor.for_chunks(height, grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      const Scratch scratch = scratch_of(width, context, worker);
      for (std::size_t row = begin; row < end; row += step) {
        blur_maps(height, width, row, scratch, context);
        for (std::size_t r = row; r < std::min(row + step, end); ++r)
          gradient_row(x + r * width, y + r * width, width, weight, static_cast<int>(r - row), scratch,
                       d_x + r * width);
      }
    });
  }

 private:
  using P = Pack<T, native_width<T>>;
  using M = typename P::MaskType;
  using Taps = SsimTaps<P>;
  static constexpr int step = 4;
  static constexpr int window = step + 2 * ssim_radius;
  static constexpr std::size_t lanes = P::width;
  static constexpr std::size_t grain = 16;
  using Scratch = PhotometricScratch<T, step>;

  static std::size_t padded(std::size_t width) { return (width + lanes - 1) / lanes * lanes; }
  static std::size_t stride(std::size_t width) { return padded(width) + 2 * Scratch::margin; }
  static Scratch scratch_of(std::size_t width, Context& context, std::size_t worker) {
    const Scratch scratch{context.scratch.row(worker), stride(width)};
    scratch.clear_margins();
    return scratch;
  }

  template <class E, class Rows>
  static double sum_rows(std::size_t height, std::size_t width, Context& context, E& executor, const Rows& rows) {
    executor.for_chunks(height, grain, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      context.partial[begin / grain] = rows(begin, end, scratch_of(width, context, worker));
    });
    double sum = 0;
    for (std::size_t i = 0; i < chunk_count(height, grain); ++i) sum += context.partial[i];
    return sum;
  }

  /// f(column, mask of the columns inside) for all packs of a row.
  template <class F>
  static COMPMARK_INLINE void for_packs(std::size_t width, const F& f) {
    for (std::size_t column = 0; column < width; column += lanes)
      f(column, M::first(static_cast<std::ptrdiff_t>(width - column)));
  }
  /// Rows row - 5 ... row + step + 4 of a plane; zeros outside.
  static std::array<const T*, window> rows_around(const T* plane, std::size_t height, std::size_t row_stride,
                                                  std::size_t row, const T* zeros) {
    std::array<const T*, window> rows;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::size_t source = row + i;  // plus the radius
      const bool inside = source >= ssim_radius && source - ssim_radius < height;
      rows[i] = inside ? plane + (source - ssim_radius) * row_stride : zeros;
    }
    return rows;
  }

  template <bool Backward>
  static double measure_rows(const T* x, const T* y, std::size_t height, std::size_t width, std::size_t begin,
                             std::size_t end, const Scratch& scratch, Context& context) {
    const Taps taps;
    double sum = 0;
    for (std::size_t row = begin; row < end; row += step) {
      const auto x_rows = rows_around(x, height, width, row, scratch.zeros());
      const auto y_rows = rows_around(y, height, width, row, scratch.zeros());
      for_packs(
          width, [&](std::size_t column, M inside) __attribute__((always_inline)) {
            P blurred[ssim_blurs][step];
            ssim_blur_columns<step>(
                taps,
                [&](int i, P& a, P& b) __attribute__((always_inline)) {
                  a = P::load(x_rows[static_cast<std::size_t>(i)] + column, inside);
                  b = P::load(y_rows[static_cast<std::size_t>(i)] + column, inside);
                },
                blurred);
            for (int map = 0; map < ssim_blurs; ++map) {
              for (int r = 0; r < step; ++r) blurred[map][r].store(scratch.blurred(map, r) + column);
            }
          });
      for (std::size_t r = row; r < std::min(row + step, end); ++r)
        sum += measure_row<Backward>(static_cast<int>(r - row), r, height, width, scratch, context);
    }
    return sum;
  }

  template <bool Backward>
  static double measure_row(int r, std::size_t row, std::size_t height, std::size_t width, const Scratch& scratch,
                            Context& context) {
    const Taps taps;
    const T* const mean_x = scratch.blurred(blur_x, r);
    const T* const mean_d = scratch.blurred(blur_d, r);
    const T* const mean_xy = scratch.blurred(blur_xy, r);
    const T* const mean_dd = scratch.blurred(blur_dd, r);
    const std::size_t plane = height * padded(width);
    T* const between =
        Backward ? context.between.data() + row * padded(width) : nullptr;  // empty without a backward pass
    T* const error = context.error.data() + row * width;
    P total(T(0));
    for_packs(
        width, [&](std::size_t column, M inside) __attribute__((always_inline)) {
          const SsimPoint<P> point =
              ssim_point(ssim_blur_row(taps, mean_x + column), ssim_blur_row(taps, mean_d + column),
                         ssim_blur_row(taps, mean_xy + column), ssim_blur_row(taps, mean_dd + column));
          total += keep(inside, point.distance);
          point.distance.store(error + column, inside);
          if constexpr (Backward) {
            keep(inside, point.u).store(between + map_u * plane + column);
            keep(inside, point.q).store(between + map_q * plane + column);
            keep(inside, point.p).store(between + map_p * plane + column);
          }
        });
    return static_cast<double>(reduce_add(total));
  }

  static void blur_maps(std::size_t height, std::size_t width, std::size_t row, const Scratch& scratch,
                        const Context& context) {
    const Taps taps;
    for (int map = 0; map < ssim_maps; ++map) {
      const T* const plane = context.between.data() + static_cast<std::size_t>(map) * height * padded(width);
      const auto rows = rows_around(plane, height, padded(width), row, scratch.zeros());
      for (std::size_t column = 0; column < width; column += lanes) {
        P sum[step];
        unroll<step>([&](auto r) __attribute__((always_inline)) { sum[r()] = P(T(0)); });
        unroll<window>([&](auto i) __attribute__((always_inline)) {
          const P value = P::load(rows[static_cast<std::size_t>(i())] + column);
          unroll<step>([&](auto r) __attribute__((always_inline)) {
            constexpr int k = decltype(i)::value - decltype(r)::value - ssim_radius;
            if constexpr (k >= -ssim_radius && k <= ssim_radius) sum[r()] = fma(taps.at(k), value, sum[r()]);
          });
        });
        for (int r = 0; r < step; ++r) sum[r].store(scratch.blurred_back(map, r) + column);
      }
    }
  }

  static void gradient_row(const T* x, const T* y, std::size_t width, T weight, int r, const Scratch& scratch, T* d_x) {
    const Taps taps;
    const T* const u = scratch.blurred_back(map_u, r);
    const T* const q = scratch.blurred_back(map_q, r);
    const T* const p = scratch.blurred_back(map_p, r);
    for_packs(
        width, [&](std::size_t column, M inside) __attribute__((always_inline)) {
          const P a = P::load(x + column, inside);
          const P d = a - P::load(y + column, inside);
          const P slope = fma(a - P(T(0.5)), ssim_blur_row(taps, q + column), ssim_blur_row(taps, u + column)) -
                          d * ssim_blur_row(taps, p + column);
          (P(-weight) * slope).store(d_x + column, inside);
        });
  }
};

}  // namespace compmark::detail
