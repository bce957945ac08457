// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Alpha supervision: the mean absolute difference between the render's coverage (1 - final transmittance) and the
// photograph's alpha channel. Needs a rasterizer with RasterOutputs{.alpha = true}. Cost: one more channel of the
// render, and one pass over a plane.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/splat/effect/concept.hpp"

namespace compmark {

template <class T>
struct L1AlphaLoss {
  static constexpr bool is_absent = false;
  using Scalar = T;
  struct Settings {};
  struct Context {
    Buffer<T> d_alpha;       ///< [height, width] weight dloss/dalpha
    Buffer<double> partial;  ///< one sum a chunk
  };

  /// Returns the loss without weight and SETS context.d_alpha. `counts` says how much each pixel counts, as in
  /// MaskedPixels; null: all of them, whole.
  template <Executor E>
  static double forward_backward(std::span<const T> alpha, std::span<const T> target, const T* counts, T weight,
                                 Context& context, E& executor) {
    constexpr std::size_t grain = 16384;
    const std::size_t pixels = alpha.size();
    context.d_alpha.resize(pixels);
    if (pixels == 0) return 0;
    context.partial.resize(chunk_count(pixels, grain));
    double total_count = static_cast<double>(pixels);
    if (counts != nullptr) {
      total_count =
          ordered_sum<double>(executor, pixels, grain, context.partial.span(), [&](std::size_t begin, std::size_t end) {
            double total = 0;
            for (std::size_t i = begin; i < end; ++i) total += static_cast<double>(counts[i]);
            return total;
          });
    }
    const T slope = total_count > 0 ? weight / static_cast<T>(total_count) : T(0);
    const double sum =
        ordered_sum<double>(executor, pixels, grain, context.partial.span(), [&](std::size_t begin, std::size_t end) {
          double total = 0;
          for (std::size_t i = begin; i < end; ++i) {
            const T d = alpha[i] - target[i], count = counts == nullptr ? T(1) : counts[i];
            total += static_cast<double>(count * std::abs(d));
            context.d_alpha[i] = count * (d > T(0) ? slope : (d < T(0) ? -slope : T(0)));  // 0 at 0, as L1 (case LS9)
          }
          return total;
        });
    return total_count > 0 ? sum / total_count : 0;
  }
};

}  // namespace compmark
