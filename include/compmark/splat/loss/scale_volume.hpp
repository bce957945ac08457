// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Scale volume: mean over the P Gaussians given to the rasterizer (seen or not) of s0 s1 s2 (Scaffold-GS eq. 9;
// docs/spec/method.md, 3.1). Gradient: weight / P times the product of the other two scales, so that a scale of zero is
// no special case. Each Gaussian may count with a factor of its own (splat/training/space_volume.hpp); factors of one
// leave every bit. Cost: 12 bytes a Gaussian read, 24 more with the gradient, 4 more for factors; memory-bound.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

struct ScaleVolumeReport {
  double loss = 0;  ///< the mean, without weight; 0 for no Gaussians
};

template <class T>
class ScaleVolumeLoss {
 public:
  using Scalar = T;
  struct Settings {};
  struct Context {
    Buffer<double> partial;  ///< 8 bytes a chunk of 8192 Gaussians
  };

  template <Executor E>
  ScaleVolumeReport forward(const std::array<const T*, 3>& scale, std::size_t count, Context& context,
                            E& executor) const {
    return run<false, false>(scale, nullptr, count, T(0), {}, context, executor);
  }
  /// The mean of factor[i] s0 s1 s2.
  template <Executor E>
  ScaleVolumeReport forward(const std::array<const T*, 3>& scale, const T* factor, std::size_t count, Context& context,
                            E& executor) const {
    return run<false, true>(scale, factor, count, T(0), {}, context, executor);
  }
  /// ADDS weight dloss/dscale into the three columns of `d_scale`.
  template <Executor E>
  ScaleVolumeReport forward_backward(const std::array<const T*, 3>& scale, std::size_t count, T weight,
                                     const std::array<T*, 3>& d_scale, Context& context, E& executor) const {
    return run<true, false>(scale, nullptr, count, weight, d_scale, context, executor);
  }
  /// The same with factors, which are constants.
  template <Executor E>
  ScaleVolumeReport forward_backward(const std::array<const T*, 3>& scale, const T* factor, std::size_t count, T weight,
                                     const std::array<T*, 3>& d_scale, Context& context, E& executor) const {
    return run<true, true>(scale, factor, count, weight, d_scale, context, executor);
  }

 private:
  using P = Pack<T, native_width<T>>;
  static constexpr std::size_t grain = 8192;

  template <bool Backward, bool Factors, class E>
  ScaleVolumeReport run(const std::array<const T*, 3>& scale, [[maybe_unused]] const T* factor, std::size_t count,
                        T weight, const std::array<T*, 3>& d_scale, Context& context, E& executor) const {
    if (count == 0) return {};
    context.partial.resize(chunk_count(count, grain));
    const P mean_slope(weight / static_cast<T>(count));
    const double sum =
        ordered_sum<double>(executor, count, grain, context.partial.span(), [&](std::size_t begin, std::size_t end) {
          double total = 0;
          for (std::size_t i = begin; i < end; i += P::width) {
            const auto mask = P::MaskType::first(static_cast<std::ptrdiff_t>(end - i));
            const P a = P::load(scale[0] + i, mask);
            const P b = P::load(scale[1] + i, mask);
            const P c = P::load(scale[2] + i, mask);
            const P bc = b * c;
            P slope = mean_slope, volume = a * bc;
            if constexpr (Factors) {
              const P counts = P::load(factor + i, mask);
              slope = slope * counts;
              volume = volume * counts;
            }
            total +=
                static_cast<double>(reduce_add(volume));  // volumes span ten orders of magnitude: add them up in double
            if constexpr (Backward) {
              const P step = slope * a;
              fma(slope, bc, P::load(d_scale[0] + i, mask)).store(d_scale[0] + i, mask);
              fma(step, c, P::load(d_scale[1] + i, mask)).store(d_scale[1] + i, mask);
              fma(step, b, P::load(d_scale[2] + i, mask)).store(d_scale[2] + i, mask);
            }
          }
          return total;
        });
    return {sum / static_cast<double>(count)};
  }
};

}  // namespace compmark
