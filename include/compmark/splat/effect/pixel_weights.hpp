// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Pixels that do not count, or count in part: the loss sees x' = w x + (1 - w) y instead of the render x, so that where
// the weight w is 0 the render agrees with the target y by definition, also in the windows of SSIM that reach in from
// outside, and no gradient comes back. The loss is divided by the mean weight (docs/spec/effects.md, 3): an image that
// is masked altogether gives the loss 0 and no gradient. Cost: one pass over the image before the loss, one after.
#pragma once

#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/effect/concept.hpp"

namespace compmark {

template <class T>
struct MaskedPixels {
  static constexpr bool is_absent = false;
  using Scalar = T;
  struct Settings {};
  struct Context {
    Buffer<T> mixed;         ///< [3, height, width] x'
    Buffer<double> partial;  ///< sum of weights a chunk
    double factor = 1;       ///< pixels / sum of weights; 0 if there is nothing to look at
  };

  /// Leaves x' in context.mixed and the loss's factor in context.factor. `weight` [height, width]; null: all ones.
  template <Executor E>
  static void mix(ImageView<const T> render, ImageView<const T> target, const T* weight, Context& context,
                  E& executor) {
    const std::size_t pixels = render.plane_size();
    const auto channels = static_cast<std::size_t>(render.channels);
    context.mixed.resize(render.size());
    context.partial.resize(chunk_count(pixels, grain));
    const double sum =
        ordered_sum<double>(executor, pixels, grain, context.partial.span(), [&](std::size_t begin, std::size_t end) {
          double total = 0;
          for (std::size_t i = begin; i < end; ++i) {
            const T w = weight == nullptr ? T(1) : weight[i];
            total += static_cast<double>(w);
            for (std::size_t c = 0; c < channels; ++c) {
              const T x = render.data[c * pixels + i], y = target.data[c * pixels + i];
              // Ends exactly at x and at y, and a render that is not finite does not reach through a weight of zero.
              context.mixed[c * pixels + i] = w == T(0) ? y : (w == T(1) ? x : y + w * (x - y));
            }
          }
          return total;
        });
    context.factor = sum > 0 ? static_cast<double>(pixels) / sum : 0;
  }

  /// dL/dx' in `d_image` becomes dL/dx.
  template <Executor E>
  static void apply(ImageView<T> d_image, const T* weight, Context& context, E& executor) {
    const std::size_t pixels = d_image.plane_size();
    const auto channels = static_cast<std::size_t>(d_image.channels);
    const T factor = static_cast<T>(context.factor);
    executor.for_chunks(pixels, grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        const T scale = (weight == nullptr ? T(1) : weight[i]) * factor;
        for (std::size_t c = 0; c < channels; ++c) {
          T& d = d_image.data[c * pixels + i];
          d = scale == T(0) ? T(0) : d * scale;
        }
      }
    });
  }

 private:
  static constexpr std::size_t grain = 16384;  // pixels
};

}  // namespace compmark
