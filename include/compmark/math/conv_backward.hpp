// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The gradients of Convolution<T>. With out[o][i] = bias[o] + sum w[o][c][a] in[c][s i + a - p] (a the tap, s the
// stride, p the padding):
//   d in[c][j]    = sum over o and the taps with s i + a - p = j of w[o][c][a] d out[o][i]      ConvInputGradient
//   d w[o][c][a]  = sum over i of d out[o][i] in[c][s i + a - p], d bias[o] = sum d out[o]  convolution_weight_gradient
// The first is a convolution again: pixel j = s q + r of phase r takes d out at q + l for l = ceil((p - k + 1) / s) ...
// floor((s - 1 + p) / s), with the tap a = r + p - s l (zero where there is none), so the s^2 phases are output
// channels of one stride-1 kernel, interleaved afterwards. At stride 1 this is the flipped, transposed kernel and is
// written in place. Cost: the multiplications of the forward pass at stride 1 and at kernel = stride; 1.8 times them
// for 3 x 3 at stride 2, 2.1 times for 11 x 11 at stride 4. The second multiplies planes of the copied input with
// planes of d out in registers (4 channels by 6 taps), over blocks of positions that fit the second-level cache, in at
// most 16 groups whose sums are added in order: the same bits at any thread count.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

/// The transposed linear map of a convolution (its bias plays no part).
template <class T>
class ConvInputGradient {
 public:
  struct Scratch {
    ConvInput<T> packed;
    ConvScratch<T> convolution;
    FeatureMaps<T> phases;
  };

  ConvInputGradient() = default;
  /// The shape and weight [out, in, kernel, kernel] of the forward convolution.
  ConvInputGradient(const ConvShape& shape, std::span<const T> weight) { assign(shape, weight); }

  /// New weights (while they train).
  void assign(const ConvShape& shape, std::span<const T> weight) {
    COMPMARK_ASSERT(weight.size() == static_cast<std::size_t>(shape.out) * shape.taps(), "ConvInputGradient: weights");
    shape_ = shape;
    const int s = shape.stride;
    const int last = (s - 1 + shape.padding) / s;
    first_ = -((shape.kernel - 1 - shape.padding) / s);  // ceil((p - k + 1) / s): division rounds towards zero
    if (shape.padding > shape.kernel - 1) first_ = (shape.padding - shape.kernel + 1 + s - 1) / s;
    const ConvShape adjoint{shape.out, shape.in * s * s, last - first_ + 1, 1, -first_};
    weights_.resize(static_cast<std::size_t>(adjoint.out) * adjoint.taps());
    std::size_t at = 0;
    for (int c = 0; c < shape.in; ++c) {
      for (int phase = 0; phase < s * s; ++phase) {
        for (int o = 0; o < shape.out; ++o) {
          for (int i = 0; i < adjoint.kernel; ++i) {
            for (int j = 0; j < adjoint.kernel; ++j) {
              const int y = phase / s + shape.padding - s * (first_ + i);
              const int x = phase % s + shape.padding - s * (first_ + j);
              const bool tap = y >= 0 && x >= 0 && y < shape.kernel && x < shape.kernel;
              weights_[at++] =
                  tap ? weight[static_cast<std::size_t>(((o * shape.in + c) * shape.kernel + y) * shape.kernel + x)]
                      : T(0);
            }
          }
        }
      }
    }
    convolution_.assign(adjoint, weights_.span(), {});
  }

  /// Of the forward convolution.
  [[nodiscard]] const ConvShape& shape() const { return shape_; }

  /// Shapes `input_gradient` for an input of height x width, so that stride 1 is written without another copy.
  void resize_input_gradient(FeatureView<const T> output_gradient, int height, int width,
                             FeatureMaps<T>& input_gradient) const {
    const std::size_t columns =
        static_cast<std::size_t>(output_gradient.width + 2 * border(output_gradient, height, width));
    if (shape_.stride == 1) {
      input_gradient.resize(shape_.in, height, width, columns, places(height, columns));
    } else {
      input_gradient.resize(shape_.in, height, width);
    }
  }

  /// Fills `input_gradient`, of the input's size and any layout, with finish(gradient) or finish(gradient, place).
  template <Executor E, class Finish = IdentityFinish>
  void backward(FeatureView<const T> output_gradient, FeatureView<T> input_gradient, Scratch& scratch, E& executor,
                const Finish& finish = {}) const {
    COMPMARK_ASSERT(output_gradient.channels == shape_.out && input_gradient.channels == shape_.in &&
                        output_gradient.height == shape_.output_size(input_gradient.height) &&
                        output_gradient.width == shape_.output_size(input_gradient.width),
                    "ConvInputGradient: sizes");
    const int s = shape_.stride;
    scratch.packed.pack(output_gradient, 1, border(output_gradient, input_gradient.height, input_gradient.width),
                        executor);
    const std::size_t columns = scratch.packed.row_stride;
    const int rows = (input_gradient.height + s - 1) / s;
    if (s == 1 && input_gradient.row_stride == columns && input_gradient.plane_stride >= places(rows, columns)) {
      convolution_.forward(scratch.packed, input_gradient, scratch.convolution, executor, finish);
      return;
    }
    scratch.phases.resize(convolution_.shape().out, rows, (input_gradient.width + s - 1) / s, columns,
                          places(rows, columns));
    const FeatureView<T> phases = scratch.phases.view();
    convolution_.forward(scratch.packed, phases, scratch.convolution, executor, IdentityFinish{});
    const std::size_t height = static_cast<std::size_t>(input_gradient.height);
    executor.for_chunks(height * static_cast<std::size_t>(shape_.in), 8, [&](std::size_t begin, std::size_t end, auto) {
      for (std::size_t row = begin; row < end; ++row)
        interleave(phases, static_cast<int>(row / height), static_cast<int>(row % height), input_gradient, finish);
    });
  }

 private:
  using P = Pack<T, native_width<T>>;

  /// Zeros needed around d out: `first_` pixels before it, and behind it what the last pixel of the input reads.
  [[nodiscard]] int border(FeatureView<const T> output_gradient, int height, int width) const {
    const int s = shape_.stride;
    const int behind = convolution_.shape().kernel - 1 + first_;
    return std::max({0, -first_, (height + s - 1) / s + behind - output_gradient.height,
                     (width + s - 1) / s + behind - output_gradient.width});
  }
  [[nodiscard]] static std::size_t places(int rows, std::size_t columns) {
    constexpr std::size_t tile = Convolution<T>::tile;
    return (static_cast<std::size_t>(rows) * columns + tile - 1) / tile * tile;
  }

  template <class Finish>
  void interleave(FeatureView<T> phases, int c, int y, FeatureView<T> target, const Finish& finish) const {
    const int s = shape_.stride;
    T* const row = target.row(c, y);
    for (int px = 0; px < s; ++px) {
      const T* source = phases.row((c * s + y % s) * s + px, y / s);
      for (int x = px; x < target.width; x += s) row[x] = *source++;
    }
    for (int x = 0; x < target.width; x += P::width) {
      const ConvPlace<T> at{c, static_cast<std::size_t>(row + x - target.data),
                            Mask<T, P::width>::first(target.width - x)};
      at.store(detail::finish_outputs<T>(finish, at.load(target.data), at), target.data);
    }
  }

  ConvShape shape_;
  int first_ = 0;  ///< the first l
  Buffer<T> weights_;
  Convolution<T> convolution_;
};

/// Scratch of convolution_weight_gradient, grow-only: d out once, and the weights once a group.
template <class T>
struct ConvWeightScratch {
  Buffer<std::ptrdiff_t> offsets;
  Buffer<T> planes;
  Buffer<T> partial;
};

namespace detail {

template <class T>
struct ConvWeightKernel {
  using P = Pack<T, native_width<T>>;
  static constexpr bool wide = sizeof(T) * native_width<T> == 64;  // 32 registers, else 16
  static constexpr std::size_t rows = wide ? 4 : 2;
  static constexpr std::size_t columns = wide ? 6 : 4;
  static constexpr std::size_t block = 64 * native_width<T>;  ///< positions: 64 channels of both maps are 512 KiB
  static constexpr std::size_t most_groups = 16;

  /// sums[r][t] += sum over `packs` packs of planes[r] * input[offset[t]].
  static void multiply(const T* const (&plane)[rows], const T* const (&input)[columns], std::size_t packs,
                       T (&sums)[rows][columns]) {
    P sum[rows][columns];
#pragma GCC unroll 4
    for (std::size_t r = 0; r < rows; ++r) {
#pragma GCC unroll 6
      for (std::size_t t = 0; t < columns; ++t) sum[r][t] = P(T(0));
    }
    for (std::size_t n = 0; n < packs * P::width; n += P::width) {
      P value[columns];
#pragma GCC unroll 6
      for (std::size_t t = 0; t < columns; ++t) value[t] = P::load(input[t] + n);
#pragma GCC unroll 4
      for (std::size_t r = 0; r < rows; ++r) {
        const P gradient = P::load(plane[r] + n);
#pragma GCC unroll 6
        for (std::size_t t = 0; t < columns; ++t) sum[r][t] = fma(gradient, value[t], sum[r][t]);
      }
    }
    for (std::size_t r = 0; r < rows; ++r) {
      for (std::size_t t = 0; t < columns; ++t) sums[r][t] = reduce_add(sum[r][t]);
    }
  }
};

}  // namespace detail

/// Adds the gradients to `weight` [out, in, kernel, kernel] and `bias` [out] (empty: none wanted). `input` is the copy
/// that forward() read, `output_gradient` of forward's output size, in any layout.
template <class T, Executor E>
void convolution_weight_gradient(const ConvShape& shape, const ConvInput<T>& input,
                                 FeatureView<const T> output_gradient, std::span<T> weight, std::span<T> bias,
                                 ConvWeightScratch<T>& scratch, E& executor) {
  using Kernel = detail::ConvWeightKernel<T>;
  using P = typename Kernel::P;
  COMPMARK_ASSERT(input.channels == shape.in && input.stride == shape.stride && input.padding >= shape.padding,
                  "convolution_weight_gradient: input");
  COMPMARK_ASSERT(output_gradient.channels == shape.out && output_gradient.height == shape.output_size(input.height) &&
                      output_gradient.width == shape.output_size(input.width),
                  "convolution_weight_gradient: output gradient");
  COMPMARK_ASSERT(weight.size() == static_cast<std::size_t>(shape.out) * shape.taps() &&
                      (bias.empty() || bias.size() == static_cast<std::size_t>(shape.out)),
                  "convolution_weight_gradient: weight count");
  constexpr std::size_t lanes = P::width;
  const std::size_t out = static_cast<std::size_t>(shape.out);
  const std::size_t taps = shape.taps();
  const std::size_t width = static_cast<std::size_t>(output_gradient.width);
  const std::size_t packs = (static_cast<std::size_t>(output_gradient.height) * input.row_stride + lanes - 1) / lanes;
  detail::fill_conv_offsets(shape, input, scratch.offsets);

  // d out in the places of the copied input, zero in the columns behind each row.
  const std::size_t plane = packs * lanes;
  scratch.planes.resize(out * plane);
  executor.for_chunks(out, 1, [&](std::size_t o, std::size_t, std::size_t) {
    T* target = scratch.planes.data() + o * plane;
    T total = 0;
    for (int y = 0; y < output_gradient.height; ++y, target += input.row_stride) {
      std::copy_n(output_gradient.row(static_cast<int>(o), y), width, target);
      const std::size_t behind = y + 1 == output_gradient.height
                                     ? plane - static_cast<std::size_t>(y) * input.row_stride - width
                                     : input.row_stride - width;
      std::fill_n(target + width, behind, T(0));
      P sum(T(0));
      for (std::size_t x = 0; x < width; x += lanes)
        sum += P::load(target + x, Mask<T, P::width>::first(static_cast<std::ptrdiff_t>(width - x)));
      total += reduce_add(sum);
    }
    if (!bias.empty()) bias[o] += total;
  });

  const std::size_t blocks = chunk_count(plane, Kernel::block);
  const std::size_t group = chunk_count(blocks, Kernel::most_groups) * Kernel::block;
  const std::size_t groups = chunk_count(plane, group);
  scratch.partial.resize(groups * out * taps);
  executor.for_chunks(plane, group, [&](std::size_t begin, std::size_t end, std::size_t) {
    T* const partial = scratch.partial.data() + begin / group * out * taps;
    std::fill_n(partial, out * taps, T(0));
    for (std::size_t n = begin; n < end; n += Kernel::block) {
      const std::size_t count = (std::min(end, n + Kernel::block) - n) / lanes;
      for (std::size_t k = 0; k < taps; k += Kernel::columns) {
        const T* source[Kernel::columns];  // the last tap stands in for those behind it
        for (std::size_t t = 0; t < Kernel::columns; ++t)
          source[t] = input.planes.data() + n + scratch.offsets[std::min(k + t, taps - 1)];
        for (std::size_t o = 0; o < out; o += Kernel::rows) {
          const T* gradient[Kernel::rows];
          for (std::size_t r = 0; r < Kernel::rows; ++r)
            gradient[r] = scratch.planes.data() + std::min(o + r, out - 1) * plane + n;
          T sums[Kernel::rows][Kernel::columns];
          Kernel::multiply(gradient, source, count, sums);
          for (std::size_t r = 0; r < std::min(Kernel::rows, out - o); ++r) {
            for (std::size_t t = 0; t < std::min(Kernel::columns, taps - k); ++t)
              partial[(o + r) * taps + k + t] += sums[r][t];
          }
        }
      }
    }
  });
  executor.for_chunks(out * taps, 1024, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t g = 0; g < groups; ++g) {
      for (std::size_t i = begin; i < end; ++i) weight[i] += scratch.partial[g * out * taps + i];
    }
  });
}

}  // namespace compmark
