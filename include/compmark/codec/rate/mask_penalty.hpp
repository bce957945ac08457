// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The penalty that masks useless offsets (HAC eq. 9; docs/spec/compression.md, 1.7): the mean of sigmoid(logit) over
// all cells of the mask table, and its derivative. The table holds logit - 1 (offset_mask.hpp). Cost: an exponential a
// cell each way, in packs.
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

namespace detail {
/// body(index, sigmoid of the logits from there, lanes that exist); the others, and those of a NaN, are 0.
template <class T, class Body>
void for_mask_probabilities(const T* stored, std::size_t begin, std::size_t end, const Body& body) {
  constexpr int W = native_width<T>;
  using P = Pack<T, W>;
  for (std::size_t i = begin; i < end; i += static_cast<std::size_t>(W)) {
    const auto lanes = P::MaskType::first(static_cast<std::ptrdiff_t>(end - i));
    const P p = sigmoid(P::load(stored + i, lanes) + P(T(1)));
    body(i, keep(lanes & (p == p), p), lanes);
  }
}
inline constexpr std::size_t mask_grain = 4096;
}  // namespace detail

/// Mean over the cells; 0 of none.
template <class T, Executor E>
[[nodiscard]] double mask_penalty(MatrixView<const T> mask, Buffer<double>& partial, E& executor) {
  partial.resize(chunk_count(mask.size(), detail::mask_grain));
  const double sum = ordered_sum<double>(
      executor, mask.size(), detail::mask_grain, partial.span(), [&](std::size_t begin, std::size_t end) {
        double chunk = 0;
        detail::for_mask_probabilities(mask.data, begin, end,
                                       [&](std::size_t, auto p, auto) { chunk += static_cast<double>(reduce_add(p)); });
        return chunk;
      });
  return sum / static_cast<double>(std::max<std::size_t>(1, mask.size()));
}
/// Adds the derivative of weight * penalty.
template <class T, Executor E>
void mask_penalty_backward(MatrixView<const T> mask, double weight, MatrixView<T> d_mask, E& executor) {
  const T each = static_cast<T>(weight / static_cast<double>(std::max<std::size_t>(1, mask.size())));
  executor.for_chunks(mask.size(), detail::mask_grain, [&](std::size_t begin, std::size_t end, std::size_t) {
    detail::for_mask_probabilities(mask.data, begin, end, [&](std::size_t i, auto p, auto lanes) {
      using P = decltype(p);
      fma(P(each) * p, P(T(1)) - p, P::load(d_mask.data + i, lanes)).store(d_mask.data + i, lanes);
    });
  });
}

}  // namespace compmark
