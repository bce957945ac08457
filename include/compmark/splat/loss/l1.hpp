// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Mean absolute difference and its subgradient, sign(0) = 0 (docs/spec/numerics.md, LS9: copysign would push identical
// images apart). Cost: one pass, 12 bytes a sample forward and 16 with the gradient. Training uses the fused
// PhotometricLoss; this is for L1 alone.
#pragma once

#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

struct L1Report {
  double loss = 0;
};

template <class T>
class L1Loss {
 public:
  using Scalar = T;
  struct Settings {};
  struct Context {
    Buffer<double> partial;  ///< 8 bytes a chunk of 16384 samples
  };

  template <Executor E>
  L1Report forward(ImageView<const T> rendered, ImageView<const T> target, Context& context, E& executor) const {
    return run<false>(rendered, target, T(0), {}, context, executor);
  }
  /// ADDS weight dloss/drendered.
  template <Executor E>
  L1Report forward_backward(ImageView<const T> rendered, ImageView<const T> target, T weight, ImageView<T> d_rendered,
                            Context& context, E& executor) const {
    COMPMARK_ASSERT(d_rendered.size() == rendered.size(), "L1Loss: gradient and image differ in size");
    return run<true>(rendered, target, weight, d_rendered, context, executor);
  }

 private:
  using P = Pack<T, native_width<T>>;
  static constexpr std::size_t grain = 16384;

  template <bool Backward, class E>
  L1Report run(ImageView<const T> x, ImageView<const T> y, T weight, ImageView<T> d_x, Context& context,
               E& executor) const {
    COMPMARK_ASSERT(x.channels == y.channels && x.height == y.height && x.width == y.width, "L1Loss: two shapes");
    const std::size_t count = x.size();
    if (count == 0) return {};
    context.partial.resize(chunk_count(count, grain));
    const P slope(weight / static_cast<T>(count));
    const P zero(T(0));
    const double sum =
        ordered_sum<double>(executor, count, grain, context.partial.span(), [&](std::size_t begin, std::size_t end) {
          double total = 0;
          // Blocks of 64 packs: a float sum of that length keeps its digits, then goes to double.
          for (std::size_t block = begin; block < end; block += 64 * P::width) {
            const std::size_t block_end = block + 64 * P::width < end ? block + 64 * P::width : end;
            P l1 = zero;
            for (std::size_t i = block; i < block_end; i += P::width) {
              const auto mask = P::MaskType::first(static_cast<std::ptrdiff_t>(block_end - i));
              const P d = P::load(x.data + i, mask) - P::load(y.data + i, mask);
              l1 += abs(d);
              if constexpr (Backward) {
                const P step = select(d > zero, slope, select(d < zero, -slope, zero));
                (P::load(d_x.data + i, mask) + step).store(d_x.data + i, mask);
              }
            }
            total += static_cast<double>(reduce_add(l1));
          }
          return total;
        });
    return {sum / static_cast<double>(count)};
  }
};

}  // namespace compmark
