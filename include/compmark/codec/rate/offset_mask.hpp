// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Masks of offsets (HAC; docs/spec/compression.md, 1.5): offset k of an anchor is unmasked while
// sigmoid(logit) > 0.01, with gradients straight through to sigmoid(logit). A masked offset is neither
// rendered (its Gaussian's opacity is set to 0, which the rasterizer drops) nor coded, and an anchor without an
// unmasked offset is not coded at all. The table holds logit - 1, so that the zeros of a new row are the initial logit
// 1. Cost: a few operations a Gaussian.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// The learning rate of the logits (docs/spec/compression.md, 1.8).
inline constexpr LearningSchedule offset_mask_schedule{0.01, 0.0001, RateUnit::scene_extent};

/// ln(0.01 / 0.99) - 1: a stored logit above it is unmasked. Compared in double, so that training and coding agree.
inline constexpr double mask_threshold = -4.59511985013459 - 1;

/// `stored` is logit - 1. A NaN is masked.
template <class T>
[[nodiscard]] constexpr bool is_unmasked(T stored) {
  return static_cast<double>(stored) > mask_threshold;
}
template <class T>
[[nodiscard]] inline T mask_probability(T stored) {
  return 1 / (1 + std::exp(-(stored + 1)));
}
/// The straight-through slope, of sigmoid(logit). 0 for a NaN.
template <class T>
[[nodiscard]] inline T mask_slope(T stored) {
  const T p = mask_probability(stored);
  return stored == stored ? p * (1 - p) : T(0);
}
/// Whether any of `count` offsets is unmasked.
template <class T>
[[nodiscard]] constexpr bool any_unmasked(const T* stored, std::size_t count) {
  for (std::size_t k = 0; k < count; ++k) {
    if (is_unmasked(stored[k])) return true;
  }
  return false;
}

/// Gaussian g came from cell slot[g] = anchor row * K + k of the table [N, K]: its opacity becomes 0 where that cell is
/// masked.
template <class T, Executor E>
void mask_opacity(MatrixView<const T> mask, std::span<const std::uint32_t> slot, T* opacity, E& executor) {
  executor.for_chunks(slot.size(), std::size_t{4096}, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t g = begin; g < end; ++g) opacity[g] = is_unmasked(mask.data[slot[g]]) ? opacity[g] : T(0);
  });
}
/// Adds d_opacity * opacity * slope into the gradients of the masks. `opacity` is that after mask_opacity: masked
/// offsets are not in a render, so they have no gradient. Each cell belongs to one Gaussian at most.
template <class T, Executor E>
void mask_opacity_backward(MatrixView<const T> mask, std::span<const std::uint32_t> slot, const T* opacity,
                           const T* d_opacity, MatrixView<T> d_mask, E& executor) {
  executor.for_chunks(slot.size(), std::size_t{4096}, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t g = begin; g < end; ++g) {
      if (opacity[g] > T(0)) d_mask.data[slot[g]] += d_opacity[g] * opacity[g] * mask_slope(mask.data[slot[g]]);
    }
  });
}

}  // namespace compmark
