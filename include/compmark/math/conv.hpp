// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Two-dimensional convolution (cross-correlation, as networks define it) of planar maps. The input is copied once into
// padded planes, one per channel and stride phase; then every tap is one fixed offset and every output position one
// place of a flat array:
//   out[o][n] = bias[o] + sum_k weight[o][k] input[n + offset[k]],   k = (channel, row, column) of the kernel.
// The values of 48 positions are copied side by side for every tap, and one register-blocked kernel (8 output channels
// by 3 packs of positions) walks over that panel once a block of channels: reading the planes in place instead costs a
// third of the speed. All sizes, strides and paddings are one code. Waste: kernel - 1 columns a row. Cost: 2 in out
// kernel^2 flop a pixel, at 70 to 80 % of the multiply-add rate from 64 channels up; with 3 input channels the writing
// of the output decides (benchmarks/math_convolution.bench.cpp). Gradients are in math/conv_backward.hpp;
// math/winograd.hpp is the same calling shape for 3 x 3 kernels at stride 1. Longer than 300 lines: the panel and the
// kernels that walk over it share one layout.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/per_worker.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

/// Planar maps [channels, height, width] whose rows and planes may lie apart.
template <class T>
struct FeatureView {
  T* data = nullptr;
  int channels = 0;
  int height = 0;
  int width = 0;
  std::size_t row_stride = 0;
  std::size_t plane_stride = 0;

  [[nodiscard]] T* row(int c, int y) const {
    return data + static_cast<std::size_t>(c) * plane_stride + static_cast<std::size_t>(y) * row_stride;
  }
  /// Channels [first, first + count).
  [[nodiscard]] FeatureView channel_range(int first, int count) const {
    return {row(first, 0), count, height, width, row_stride, plane_stride};
  }
  operator FeatureView<const T>() const  // NOLINT(google-explicit-constructor): a view to const is always safe
      requires(!std::is_const_v<T>) {
    return {data, channels, height, width, row_stride, plane_stride};
  }
};

/// Maps that own their memory, grow-only.
template <class T>
class FeatureMaps {
 public:
  /// Dense rows by default; `positions` reserves that many places a plane (for a convolution's output).
  void resize(int channels, int height, int width, std::size_t row_stride = 0, std::size_t positions = 0) {
    const std::size_t stride = row_stride == 0 ? static_cast<std::size_t>(width) : row_stride;
    const std::size_t plane = std::max(positions, stride * static_cast<std::size_t>(height));
    storage_.resize(plane * static_cast<std::size_t>(channels));
    view_ = {storage_.data(), channels, height, width, stride, plane};
  }
  [[nodiscard]] FeatureView<T> view() { return view_; }
  [[nodiscard]] FeatureView<const T> view() const { return view_; }

 private:
  Buffer<T> storage_;
  FeatureView<T> view_;
};

/// A square kernel [out, in, kernel, kernel] moved by `stride` over an input with `padding` zeros around it.
struct ConvShape {
  int in = 1;
  int out = 1;
  int kernel = 3;
  int stride = 1;
  int padding = 1;

  [[nodiscard]] constexpr int output_size(int input_size) const {
    return (input_size + 2 * padding - kernel) / stride + 1;
  }
  [[nodiscard]] constexpr std::size_t taps() const {
    return static_cast<std::size_t>(in) * static_cast<std::size_t>(kernel) * static_cast<std::size_t>(kernel);
  }
};

/// The copied input: plane (c, py, px) holds the padded pixels (stride i + py, stride j + px) of channel c.
template <class T>
struct ConvInput {
  Buffer<T> planes;
  int channels = 0;
  int height = 0;
  int width = 0;
  int stride = 1;
  int padding = 0;
  std::size_t row_stride = 0;    ///< columns of a phase plane
  std::size_t plane_stride = 0;  ///< places of a phase plane

  /// Copies `source` with `padding_` zeros around it. Several convolutions of one stride may share the copy, with
  /// kernels of less padding too.
  template <Executor E>
  void pack(FeatureView<const T> source, int stride_, int padding_, E& executor) {
    shape(source.channels, source.height, source.width, stride_, padding_);
    const std::size_t phases = static_cast<std::size_t>(stride * stride);
    executor.for_chunks(static_cast<std::size_t>(channels), 1, [&](std::size_t c, std::size_t, std::size_t) {
      T* channel = planes.data() + c * phases * plane_stride;
      std::fill_n(channel, phases * plane_stride, T(0));
      for (int y = 0; y < height; ++y) {
        const T* row = source.row(static_cast<int>(c), y);
        const int py = y + padding;
        T* phase_row = channel + static_cast<std::size_t>(py % stride * stride) * plane_stride +
                       static_cast<std::size_t>(py / stride) * row_stride;
        if (stride == 1) {
          std::copy_n(row, width, phase_row + padding);
          continue;
        }
        for (int px = 0; px < stride; ++px) {  // columns x = px - padding + stride i of the row
          const int first = std::max(0, (padding - px + stride - 1) / stride);
          const int x = first * stride + px - padding;
          if (x >= width) continue;
          T* target = phase_row + static_cast<std::size_t>(px) * plane_stride + first;
          const std::size_t count = static_cast<std::size_t>((width - x + stride - 1) / stride);
          if (stride == 4) {
            copy_every<4>(row + x, count, target);
          } else if (stride == 2) {
            copy_every<2>(row + x, count, target);
          } else {
            for (std::size_t i = 0; i < count; ++i) target[i] = row[x + static_cast<int>(i) * stride];
          }
        }
      }
    });
  }

 private:
  /// The planes of a copy, not yet filled but for the slack behind them.
  void shape(int channels_, int height_, int width_, int stride_, int padding_) {
    channels = channels_;
    height = height_;
    width = width_;
    stride = stride_;
    padding = padding_;
    const std::size_t phase_rows = static_cast<std::size_t>((height + 2 * padding + stride - 1) / stride);
    row_stride = static_cast<std::size_t>((width + 2 * padding + stride - 1) / stride);
    plane_stride = phase_rows * row_stride;
    const std::size_t used =
        plane_stride * static_cast<std::size_t>(stride * stride) * static_cast<std::size_t>(channels);
    planes.resize(used + slack());
    std::fill_n(planes.data() + used, slack(), T(0));
  }

  template <int Stride>
  static void copy_every(const T* source, std::size_t count, T* target) {
    for (std::size_t i = 0; i < count; ++i) target[i] = source[i * Stride];
  }
  /// Reads behind the last place: one tile of positions and the rows a kernel of up to 16 strides spans.
  [[nodiscard]] std::size_t slack() const { return 64 * 4 + 17 * (row_stride + 1); }
};

/// Where a pack of outputs goes, for a finish functor that is called as finish(value, place): it may read or write
/// other maps of the shape of the output at the same places, such as the activations a ReLU's gradient asks for or the
/// derivative that a forward pass keeps.
template <class T>
struct ConvPlace {
  using P = Pack<T, native_width<T>>;
  int channel = 0;
  std::size_t index = 0;  ///< of lane 0, from the first value of the output view
  Mask<T, native_width<T>> lanes = Mask<T, native_width<T>>::first(native_width<T>);  ///< those that are outputs

  [[nodiscard]] COMPMARK_INLINE P load(const T* maps) const {
    return all(lanes) ? P::load(maps + index) : P::load(maps + index, lanes);
  }
  COMPMARK_INLINE void store(P value, T* maps) const {
    if (all(lanes)) {
      value.store(maps + index);
    } else {
      value.store(maps + index, lanes);
    }
  }
};

namespace detail {
template <class T, class Finish>
COMPMARK_INLINE Pack<T, native_width<T>> finish_outputs(const Finish& finish, Pack<T, native_width<T>> value,
                                                        const ConvPlace<T>& place) {
  if constexpr (std::is_invocable_v<const Finish&, Pack<T, native_width<T>>, const ConvPlace<T>&>) {
    return finish(value, place);
  } else {
    return finish(value);
  }
}

/// Where tap (channel, row, column) of a kernel lies in a copied input, from the place of the output.
template <class T>
void fill_conv_offsets(const ConvShape& shape, const ConvInput<T>& input, Buffer<std::ptrdiff_t>& offsets) {
  offsets.resize(shape.taps());
  const int shift = input.padding - shape.padding;
  const std::size_t phases = static_cast<std::size_t>(input.stride * input.stride);
  std::size_t k = 0;
  for (int c = 0; c < shape.in; ++c) {
    for (int ky = 0; ky < shape.kernel; ++ky) {
      for (int kx = 0; kx < shape.kernel; ++kx) {
        const int y = ky + shift;
        const int x = kx + shift;
        const std::size_t phase = static_cast<std::size_t>(y % input.stride * input.stride + x % input.stride);
        offsets[k++] = static_cast<std::ptrdiff_t>((static_cast<std::size_t>(c) * phases + phase) * input.plane_stride +
                                                   static_cast<std::size_t>(y / input.stride) * input.row_stride +
                                                   static_cast<std::size_t>(x / input.stride));
      }
    }
  }
}
}  // namespace detail

/// Scratch of a convolution, grow-only: taps * 8 bytes, and taps * 48 scalars a worker.
template <class T>
struct ConvScratch {
  Buffer<std::ptrdiff_t> offsets;
  PerWorkerRows<T> panel;
};

/// Weights in kernel order and the kernel itself. T is float in production, double in tests.
template <class T>
class Convolution {
 public:
  static constexpr int position_packs = 3;
  static constexpr int channel_block = native_width<T> * sizeof(T) == 64 ? 8 : 4;  // 24 or 12 sums: 32 or 16 registers
  static constexpr std::size_t tile = static_cast<std::size_t>(position_packs * native_width<T>);

  Convolution() = default;
  /// `weight` [out, in, kernel, kernel], `bias` [out].
  Convolution(const ConvShape& shape, std::span<const T> weight, std::span<const T> bias) {
    assign(shape, weight, bias);
  }

  /// New weights (while they train). An empty bias is zero.
  void assign(const ConvShape& shape, std::span<const T> weight, std::span<const T> bias) {
    shape_ = shape;
    COMPMARK_ASSERT(weight.size() == static_cast<std::size_t>(shape.out) * shape.taps(), "Convolution: weight count");
    COMPMARK_ASSERT(bias.empty() || bias.size() == static_cast<std::size_t>(shape.out), "Convolution: bias count");
    const std::size_t taps = shape.taps();
    weights_.resize(blocks() * taps * channel_block, T(0));
    bias_.resize(blocks() * channel_block, T(0));
    for (std::size_t o = 0; o < static_cast<std::size_t>(shape.out); ++o) {
      if (!bias.empty()) bias_[o] = bias[o];
      for (std::size_t k = 0; k < taps; ++k)
        weights_[(o / channel_block * taps + k) * channel_block + o % channel_block] = weight[o * taps + k];
    }
  }

  /// What the calls from a view to a view need.
  struct Scratch {
    ConvInput<T> packed;
    ConvScratch<T> convolution;
  };

  [[nodiscard]] const ConvShape& shape() const { return shape_; }

  /// Shapes `output` for `channels` channels (0: this convolution's) over `input`.
  void resize_output(const ConvInput<T>& input, FeatureMaps<T>& output, int channels = 0) const {
    const int rows = shape_.output_size(input.height);
    const std::size_t positions = static_cast<std::size_t>(rows) * input.row_stride;
    output.resize(channels == 0 ? shape_.out : channels, rows, shape_.output_size(input.width), input.row_stride,
                  (positions + tile - 1) / tile * tile);
  }

  /// The same calls from a view, as WinogradConvolution<T> has them: the copy is made here.
  void resize_output(FeatureView<const T> input, FeatureMaps<T>& output, int channels = 0) const {
    ConvInput<T> extent;
    extent.height = input.height;
    extent.width = input.width;
    extent.row_stride =
        static_cast<std::size_t>((input.width + 2 * shape_.padding + shape_.stride - 1) / shape_.stride);
    resize_output(extent, output, channels);
  }
  template <Executor E, class Finish>
  void forward(FeatureView<const T> input, FeatureView<T> output, Scratch& scratch, E& executor,
               const Finish& finish) const {
    scratch.packed.pack(input, shape_.stride, shape_.padding, executor);
    forward(scratch.packed, output, scratch.convolution, executor, finish);
  }

  /// Fills `output` (shaped by resize_output, or a channel range of it) with finish(sum + bias), or finish(sum + bias,
  /// place). Columns behind output.width are scratch.
  template <Executor E, class Finish>
  void forward(const ConvInput<T>& input, FeatureView<T> output, ConvScratch<T>& scratch, E& executor,
               const Finish& finish) const {
    COMPMARK_ASSERT(input.channels == shape_.in && input.stride == shape_.stride && input.padding >= shape_.padding,
                    "Convolution: input");
    COMPMARK_ASSERT(output.channels == shape_.out && output.row_stride == input.row_stride, "Convolution: output");
    detail::fill_conv_offsets(shape_, input, scratch.offsets);
    const std::size_t taps = shape_.taps();
    scratch.panel.resize(executor.concurrency(), taps * tile);
    const std::size_t positions = static_cast<std::size_t>(output.height) * input.row_stride;
    executor.for_chunks(positions, tile, [&](std::size_t begin, std::size_t, std::size_t worker) {
      T* const panel = scratch.panel.row(worker);
      copy_panel(input.planes.data() + begin, scratch.offsets.data(), panel);
      for (std::size_t block = 0; block < blocks(); ++block) compute_tile(panel, output, block, begin, finish);
    });
  }

 private:
  using P = Pack<T, native_width<T>>;

  [[nodiscard]] std::size_t blocks() const {
    return (static_cast<std::size_t>(shape_.out) + channel_block - 1) / channel_block;
  }

  /// The tile's values of every tap, one after the other: read once from the planes, then by every block of channels in
  /// order.
  void copy_panel(const T* source, const std::ptrdiff_t* offsets, T* panel) const {
    for (std::size_t k = 0; k < shape_.taps(); ++k, panel += tile) {
      for (int j = 0; j < position_packs; ++j) P::load(source + offsets[k] + j * P::width).store(panel + j * P::width);
    }
  }

  template <class Finish>
  void compute_tile(const T* place, FeatureView<T> output, std::size_t block, std::size_t n,
                    const Finish& finish) const {
    constexpr int lanes = P::width;
    const std::size_t taps = shape_.taps();
    const T* weight = weights_.data() + block * taps * channel_block;
    P sum[channel_block][position_packs];
#pragma GCC unroll 8
    for (int m = 0; m < channel_block; ++m) {
#pragma GCC unroll 3
      for (int j = 0; j < position_packs; ++j)
        sum[m][j] = P(bias_[block * channel_block + static_cast<std::size_t>(m)]);
    }
    for (std::size_t k = 0; k < taps; ++k, weight += channel_block, place += tile) {
      P value[position_packs];
#pragma GCC unroll 3
      for (int j = 0; j < position_packs; ++j) value[j] = P::load(place + j * lanes);
#pragma GCC unroll 8
      for (int m = 0; m < channel_block; ++m) {
        const P w(weight[m]);
#pragma GCC unroll 3
        for (int j = 0; j < position_packs; ++j) sum[m][j] = fma(w, value[j], sum[m][j]);
      }
    }
    const std::size_t first = block * channel_block;
    const std::size_t count = std::min<std::size_t>(channel_block, static_cast<std::size_t>(shape_.out) - first);
#pragma GCC unroll 8
    for (int m = 0; m < channel_block; ++m) {
      if (static_cast<std::size_t>(m) >= count) break;
      T* target = output.data + (first + static_cast<std::size_t>(m)) * output.plane_stride + n;
#pragma GCC unroll 3
      for (int j = 0; j < position_packs; ++j) {
        const ConvPlace<T> at{static_cast<int>(first) + m,
                              static_cast<std::size_t>(target - output.data) + static_cast<std::size_t>(j * lanes)};
        detail::finish_outputs<T>(finish, sum[m][j], at).store(target + j * lanes);
      }
    }
  }

  ConvShape shape_;
  Buffer<T> weights_;  ///< [block][tap][channel of the block]
  Buffer<T> bias_;
};

/// finish functors of a convolution
struct ReluFinish {
  template <class P>
  COMPMARK_INLINE P operator()(P value) const {
    return max(value, P(typename P::Scalar(0)));
  }
};
struct IdentityFinish {
  template <class P>
  COMPMARK_INLINE P operator()(P value) const {
    return value;
  }
};

/// Maximum over 3 x 3 windows at stride 2, no padding. `ceil` lets a last window hang over the edge (a window then sees
/// what there is).
template <class T, Executor E>
void max_pool_3x3_stride_2(FeatureView<const T> input, bool ceil, FeatureMaps<T>& output, E& executor) {
  const auto size = [&](int n) { return (n - 3 + (ceil ? 1 : 0)) / 2 + 1; };
  output.resize(input.channels, size(input.height), size(input.width));
  const FeatureView<T> target = output.view();
  executor.for_chunks(static_cast<std::size_t>(input.channels), 1, [&](std::size_t channel, std::size_t, std::size_t) {
    const int c = static_cast<int>(channel);
    for (int y = 0; y < target.height; ++y) {
      const T* a = input.row(c, 2 * y);
      const T* b = input.row(c, std::min(2 * y + 1, input.height - 1));
      const T* d = input.row(c, std::min(2 * y + 2, input.height - 1));
      T* row = target.row(c, y);
      for (int x = 0; x < target.width; ++x) {
        const int x0 = 2 * x;
        const int x1 = std::min(x0 + 1, input.width - 1);
        const int x2 = std::min(x0 + 2, input.width - 1);
        const T left = std::max({a[x0], b[x0], d[x0]});
        const T middle = std::max({a[x1], b[x1], d[x1]});
        const T right = std::max({a[x2], b[x2], d[x2]});
        row[x] = std::max({left, middle, right});
      }
    }
  });
}

}  // namespace compmark
