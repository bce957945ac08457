// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Winograd's convolution F(m x m, 3 x 3) (Lavin and Gray 2016), a policy beside Convolution<T> for 3 x 3 kernels at
// stride 1. A tile of m x m outputs reads n x n inputs, n = m + 2, and costs n^2 multiplications a channel pair in
// place of 9 m^2 (m = 4: 36 for 144, a quarter):
//   Y = A^T [ sum_c (G g_c G^T) . (B^T d_c B) ] A      (the matrices: math/winograd_transform.hpp).
// From planar maps to planar maps, with nothing else in memory: 48 tiles at a time go through all the steps in the
// second-level cache. Per channel their rows are split by column modulo m, so that lanes are tiles, and transformed;
// then n^2 products [out x in] [in x 48] run in registers; per output channel the sums are transformed back and joined
// to rows. Tiles are numbered along the rows, one unused behind each. Rounding grows with the tile
// (tests/math/winograd.test.cpp has the figures): F(2) is as exact as the direct sum, F(4) loses a factor of two, F(6)
// of seven. Cost: n^2 / m^2 multiplications an output and channel pair, a fifth more for the rest at 64 channels
// (benchmarks/math_convolution.bench.cpp). Scratch grows with in + out: beyond 128 channels it leaves the cache. Longer
// than 300 lines: the steps share one layout of the block.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/unroll.hpp"
#include "compmark/math/winograd_transform.hpp"

namespace compmark {

/// Scratch of a Winograd convolution, grow-only: about n^2 (in + out) 48 scalars a worker.
template <class T>
struct WinogradScratch {
  PerWorkerRows<T> values;
};

/// 3 x 3 kernels at stride 1. Calls as Convolution<T>: assign, resize_output, forward, from a view to a view.
template <class T, int Tile = 4, class Points = WinogradPoints<Tile>>
class WinogradConvolution {
  using Transform = detail::WinogradTransform<Tile, Points>;
  static constexpr int n = Transform::n;

 public:
  using Scratch = WinogradScratch<T>;
  static constexpr int elements = n * n;
  static constexpr int tile_packs = Convolution<T>::position_packs;
  static constexpr int channel_block = Convolution<T>::channel_block;
  static constexpr std::size_t block = Convolution<T>::tile;  ///< tiles that go through the steps together

  WinogradConvolution() = default;
  /// `weight` [out, in, 3, 3], `bias` [out] or empty.
  WinogradConvolution(const ConvShape& shape, std::span<const T> weight, std::span<const T> bias) {
    assign(shape, weight, bias);
  }

  /// New weights (while they train): out * in small transforms.
  void assign(const ConvShape& shape, std::span<const T> weight, std::span<const T> bias) {
    const std::size_t in = static_cast<std::size_t>(shape.in);
    COMPMARK_ASSERT(weight.size() == static_cast<std::size_t>(shape.out) * in * 9, "WinogradConvolution: weight count");
    COMPMARK_ASSERT(bias.empty() || bias.size() == static_cast<std::size_t>(shape.out),
                    "WinogradConvolution: bias count");
    transform_weights(shape, [&](std::size_t o, std::size_t c, std::size_t k) { return weight[(o * in + c) * 9 + k]; });
    for (std::size_t o = 0; o < bias.size(); ++o) bias_[o] = bias[o];
  }
  /// The gradient to the input of the convolution that has this shape and weight: flipped, transposed, padding 2 - p,
  /// no bias.
  void assign_adjoint(const ConvShape& shape, std::span<const T> weight) {
    const std::size_t in = static_cast<std::size_t>(shape.in);
    COMPMARK_ASSERT(weight.size() == static_cast<std::size_t>(shape.out) * in * 9, "WinogradConvolution: weight count");
    transform_weights({shape.out, shape.in, shape.kernel, shape.stride, 2 - shape.padding},
                      [&](std::size_t c, std::size_t o, std::size_t k) { return weight[(o * in + c) * 9 + 8 - k]; });
  }

  [[nodiscard]] const ConvShape& shape() const { return shape_; }

  /// Shapes `output` for `channels` channels (0: this convolution's) over `input`.
  void resize_output(FeatureView<const T> input, FeatureMaps<T>& output, int channels = 0) const {
    resize(channels == 0 ? shape_.out : channels, shape_.output_size(input.height), shape_.output_size(input.width),
           output);
  }
  /// Dense rows, planes an odd number of cache lines apart lest all channels share the sets of the cache.
  static void resize(int channels, int height, int width, FeatureMaps<T>& maps) {
    const std::size_t lines =
        (static_cast<std::size_t>(height) * static_cast<std::size_t>(width) + cache_line - 1) / cache_line;
    maps.resize(channels, height, width, 0, (lines + 1 - lines % 2) * cache_line);
  }

  /// Fills `output`, of the output's size and any layout, with finish(sum + bias) or finish(sum + bias, place).
  template <Executor E, class Finish>
  void forward(FeatureView<const T> input, FeatureView<T> output, Scratch& scratch, E& executor,
               const Finish& finish) const {
    COMPMARK_ASSERT(input.channels == shape_.in && output.channels == shape_.out &&
                        output.height == shape_.output_size(input.height) &&
                        output.width == shape_.output_size(input.width),
                    "WinogradConvolution: sizes");
    const std::size_t rows = static_cast<std::size_t>((output.height + Tile - 1) / Tile);
    const std::size_t columns = static_cast<std::size_t>((output.width + Tile - 1) / Tile) + 1;
    const std::size_t transformed = element_stride(shape_.in) * elements;
    const std::size_t products = element_stride(shape_.out) * elements;
    const std::size_t share = transformed + products + line_size + n * split_size;
    scratch.values.resize(executor.concurrency(), share);
    executor.for_chunks(rows * columns, block, [&](std::size_t begin, std::size_t end, std::size_t worker) {
      T* const own = scratch.values.row(worker);
      T* const sums = own + transformed;
      T* const line = sums + products;
      const Block at{begin, end, columns, static_cast<int>((end - begin + P::width - 1) / P::width)};
      for (int c = 0; c < shape_.in; ++c) {
        split_rows(at, input, c, line, line + line_size);
        transform_input(at, line + line_size, own + static_cast<std::size_t>(c) * block);
      }
      if (at.packs == tile_packs) {
        multiply<tile_packs>(own, sums);
      } else {
        for (int j = 0; j < at.packs; ++j) multiply<1>(own + j * P::width, sums + j * P::width);
      }
      for (int o = 0; o < shape_.out; ++o) {
        transform_back(at, sums + static_cast<std::size_t>(o) * block, bias_[static_cast<std::size_t>(o)],
                       line + line_size);
        join_rows(at, line + line_size, o, line, output, finish);
      }
    });
  }

 private:
  using P = Pack<T, native_width<T>>;
  static constexpr std::size_t cache_line = sizeof(T) < 64 ? 64 / sizeof(T) : 1;
  static constexpr std::size_t positions = block + P::width;   ///< the block, and the neighbour of its last tile
  static constexpr std::size_t line_size = Tile * positions;   ///< one row of the block's pixels
  static constexpr std::size_t split_size = Tile * positions;  ///< one row, by column modulo Tile

  struct Block {
    std::size_t begin;  ///< first tile
    std::size_t end;
    std::size_t columns;  ///< tiles a row, the last of them unused
    int packs;
  };

  [[nodiscard]] static std::size_t blocks_of(int channels) {
    return (static_cast<std::size_t>(channels) + channel_block - 1) / channel_block;
  }
  /// From one transform element to the next. A cache line more than a multiple of 4 KiB, lest the n^2 streams share one
  /// cache set.
  [[nodiscard]] static std::size_t element_stride(int channels) {
    return blocks_of(channels) * channel_block * block + cache_line;
  }

  template <class Weight>
  void transform_weights(const ConvShape& shape, const Weight& weight) {
    COMPMARK_ASSERT(shape.kernel == 3 && shape.stride == 1 && shape.padding >= 0,
                    "WinogradConvolution: 3 x 3 at stride 1");
    shape_ = shape;
    const std::size_t in = static_cast<std::size_t>(shape.in);
    const std::size_t element = blocks_of(shape.out) * in * channel_block;
    weights_.resize(element * elements, T(0));
    bias_.resize(static_cast<std::size_t>(shape.out), T(0));
    for (std::size_t o = 0; o < static_cast<std::size_t>(shape.out); ++o) {
      for (std::size_t c = 0; c < in; ++c) {
        double half[3][n];
        for (std::size_t x = 0; x < 3; ++x) {
          const double g[3] = {static_cast<double>(weight(o, c, x)), static_cast<double>(weight(o, c, 3 + x)),
                               static_cast<double>(weight(o, c, 6 + x))};
          Transform::filter(g, half[x]);
        }
        for (std::size_t r = 0; r < n; ++r) {
          const double g[3] = {half[0][r], half[1][r], half[2][r]};
          double u[n];
          Transform::filter(g, u);
          T* target =
              weights_.data() + r * n * element + (o / channel_block * in + c) * channel_block + o % channel_block;
          for (std::size_t j = 0; j < n; ++j) target[j * element] = static_cast<T>(u[j]);
        }
      }
    }
  }

  /// Row r of every tile of the block (and of one tile more): split[r][column modulo Tile][tile], zero outside of the
  /// input.
  void split_rows(const Block& at, FeatureView<const T> input, int channel, T* line, T* split) const {
    const std::size_t count = static_cast<std::size_t>(at.packs) * P::width + 1;
    for (int r = 0; r < n; ++r, split += split_size) {
      T* target = line;
      for (std::size_t t = at.begin; t < at.begin + count;) {
        const std::size_t next = std::min(at.begin + count, (t / at.columns + 1) * at.columns);
        const int y = static_cast<int>(t / at.columns) * Tile + r - shape_.padding;
        const int x = static_cast<int>(t % at.columns) * Tile - shape_.padding;
        const int run = static_cast<int>(next - t) * Tile;
        const bool inside = y >= 0 && y < input.height;
        const int first = inside ? std::clamp(-x, 0, run) : run;
        const int last = inside ? std::clamp(input.width - x, first, run) : run;
        std::fill_n(target, first, T(0));
        if (first < last) {
          const T* const source = input.row(channel, y) + x + first;
          std::copy_n(source, last - first, target + first);
          if (channel + 1 < input.channels) ask_for(source + input.plane_stride, last - first);
        }
        std::fill_n(target + last, run - last, T(0));
        target += run;
        t = next;
      }
      for (std::size_t i = 0; i < count; ++i) {
        for (std::size_t c = 0; c < Tile; ++c) split[c * positions + i] = line[i * Tile + c];
      }
    }
  }

  /// Rows of the next channel come while this one is transformed: runs of 800 bytes, a plane apart, are too short for
  /// the hardware to foresee.
  static COMPMARK_INLINE void ask_for(const T* run, int count) {
    for (int x = 0; x < count; x += static_cast<int>(cache_line)) __builtin_prefetch(run + x);
  }

  /// B^T d B of one channel.
  void transform_input(const Block& at, const T* split, T* target) const {
    const std::size_t element = element_stride(shape_.in);
    for (int j = 0; j < at.packs; ++j, split += P::width, target += P::width) {
      P half[n][n];
      for (int x = 0; x < n; ++x) {
        const T* source = split + static_cast<std::size_t>(x % Tile) * positions + static_cast<std::size_t>(x / Tile);
        P d[n], y[n];
        detail::unroll<n>([&](auto r) __attribute__((always_inline)) {
          d[r] = P::load(source + static_cast<std::size_t>(r) * split_size);
        });
        Transform::input(d, y);
        detail::unroll<n>([&](auto r) __attribute__((always_inline)) { half[r][x] = y[r]; });
      }
      T* place = target;
      for (int r = 0; r < n; ++r) {
        P y[n];
        Transform::input(half[r], y);
        detail::unroll<n>([&](auto x) __attribute__((always_inline)) {
          y[x].store(place);
          place += element;
        });
      }
    }
  }

  /// products[e] = weights[e] transformed[e] for every element: channel_block outputs by Packs packs of tiles in
  /// registers.
  template <int Packs>
  void multiply(const T* transformed, T* products) const {
    const std::size_t in = static_cast<std::size_t>(shape_.in);
    const T* weight = weights_.data();
    for (int e = 0; e < elements;
         ++e, transformed += element_stride(shape_.in), products += element_stride(shape_.out)) {
      T* target = products;
      for (std::size_t b = 0; b < blocks_of(shape_.out); ++b, target += channel_block * block) {
        P sum[channel_block][Packs];
#pragma GCC unroll 8
        for (int m = 0; m < channel_block; ++m) {
#pragma GCC unroll 3
          for (int j = 0; j < Packs; ++j) sum[m][j] = P(T(0));
        }
        const T* place = transformed;
        for (std::size_t c = 0; c < in; ++c, weight += channel_block, place += block) {
          P value[Packs];
#pragma GCC unroll 3
          for (int j = 0; j < Packs; ++j) value[j] = P::load(place + j * P::width);
#pragma GCC unroll 8
          for (int m = 0; m < channel_block; ++m) {
            const P w(weight[m]);
#pragma GCC unroll 3
            for (int j = 0; j < Packs; ++j) sum[m][j] = fma(w, value[j], sum[m][j]);
          }
        }
#pragma GCC unroll 8
        for (int m = 0; m < channel_block; ++m) {
#pragma GCC unroll 3
          for (int j = 0; j < Packs; ++j) sum[m][j].store(target + static_cast<std::size_t>(m) * block + j * P::width);
        }
      }
    }
  }

  /// A^T M A + bias of one output channel: split[row][column][tile].
  void transform_back(const Block& at, const T* sums, T bias_value, T* split) const {
    const std::size_t element = element_stride(shape_.out);
    const P bias(bias_value);
    for (int j = 0; j < at.packs; ++j, sums += P::width, split += P::width) {
      P half[Tile][n];
      for (int x = 0; x < n; ++x) {
        P m[n], column[Tile];
        detail::unroll<n>([&](auto r) __attribute__((always_inline)) {
          m[r] = P::load(sums + static_cast<std::size_t>(r * n + x) * element);
        });
        Transform::output(m, column);
        detail::unroll<Tile>([&](auto r) __attribute__((always_inline)) { half[r][x] = column[r]; });
      }
      for (int r = 0; r < Tile; ++r) {
        P y[Tile];
        Transform::output(half[r], y);
        detail::unroll<Tile>([&](auto c) __attribute__((always_inline)) {
          (y[c] + bias)
              .store(split + static_cast<std::size_t>(r) * split_size + static_cast<std::size_t>(c) * positions);
        });
      }
    }
  }

  /// Joins split[row][column][tile] to rows of pixels and stores what of them is output.
  template <class Finish>
  void join_rows(const Block& at, const T* split, int channel, T* line, FeatureView<T> output,
                 const Finish& finish) const {
    for (int r = 0; r < Tile; ++r, split += split_size) {
      for (std::size_t i = 0; i < block; ++i) {
        for (std::size_t c = 0; c < Tile; ++c) line[i * Tile + c] = split[c * positions + i];
      }
      const T* source = line;
      for (std::size_t t = at.begin; t < at.end;) {
        const std::size_t next = std::min(at.end, (t / at.columns + 1) * at.columns);
        const int y = static_cast<int>(t / at.columns) * Tile + r;
        const int x = static_cast<int>(t % at.columns) * Tile;
        const int count = y < output.height ? std::min(output.width - x, static_cast<int>(next - t) * Tile) : 0;
        if (count > 0) {
          ConvPlace<T> place{channel, static_cast<std::size_t>(output.row(channel, y) + x - output.data)};
          int i = 0;
          for (; i + P::width <= count; i += P::width, place.index += P::width)
            detail::finish_outputs<T>(finish, P::load(source + i), place).store(output.data + place.index);
          if (i < count) {
            place.lanes = Mask<T, P::width>::first(count - i);
            place.store(detail::finish_outputs<T>(finish, P::load(source + i), place), output.data);
          }
        }
        source += (next - t) * Tile;
        t = next;
      }
    }
  }

  ConvShape shape_;
  Buffer<T> weights_;  ///< [element][block of outputs][in][output of the block]
  Buffer<T> bias_;
};

/// The transposed linear map of a WinogradConvolution, calls as ConvInputGradient<T>.
template <class T, int Tile = 4, class Points = WinogradPoints<Tile>>
class WinogradInputGradient {
 public:
  using Scratch = WinogradScratch<T>;

  WinogradInputGradient() = default;
  /// The shape and weight [out, in, 3, 3] of the forward convolution.
  WinogradInputGradient(const ConvShape& shape, std::span<const T> weight) { assign(shape, weight); }
  void assign(const ConvShape& shape, std::span<const T> weight) {
    shape_ = shape;
    convolution_.assign_adjoint(shape, weight);
  }

  /// Of the forward convolution.
  [[nodiscard]] const ConvShape& shape() const { return shape_; }

  void resize_input_gradient(FeatureView<const T> /*output_gradient*/, int height, int width,
                             FeatureMaps<T>& input_gradient) const {
    WinogradConvolution<T, Tile, Points>::resize(shape_.in, height, width, input_gradient);
  }
  template <Executor E, class Finish = IdentityFinish>
  void backward(FeatureView<const T> output_gradient, FeatureView<T> input_gradient, Scratch& scratch, E& executor,
                const Finish& finish = {}) const {
    convolution_.forward(output_gradient, input_gradient, scratch, executor, finish);
  }

 private:
  ConvShape shape_;
  WinogradConvolution<T, Tile, Points> convolution_;
};

}  // namespace compmark
