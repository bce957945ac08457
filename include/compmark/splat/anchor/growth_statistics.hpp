// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Statistics for growing and pruning, gathered over many views (docs/spec/method.md, 4.1). A slot is anchor * K +
// offset, as in DecodedStatistics. Adding one view costs about a nanosecond a Gaussian: one view names a slot at most
// once, so chunks never meet.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"
#include "compmark/splat/anchor/concept.hpp"

namespace compmark {

/// Plain data; the four buffers are all a checkpoint has to save. Counts are whole numbers below 2^24, exact in float.
template <class T>
struct GrowthStatistics {
  Buffer<T> opacity_sum;     ///< [N]   A_op: sum over views of the anchor's positive opacities
  Buffer<T> visits;          ///< [N]   n_vis: views in which the anchor was decoded
  Buffer<T> gradient_sum;    ///< [N K] A_g: sum over views of the norm of the screen-space gradient
  Buffer<T> gradient_count;  ///< [N K] n_g: views in which the Gaussian was on screen

  [[nodiscard]] std::size_t anchors() const { return visits.size(); }
  [[nodiscard]] std::size_t slots() const { return gradient_count.size(); }

  void prepare(std::size_t anchor_count, std::size_t offsets) {
    for (Buffer<T>* column : {&opacity_sum, &visits}) column->resize(anchor_count, T{});
    for (Buffer<T>* column : {&gradient_sum, &gradient_count}) column->resize(anchor_count * offsets, T{});
  }

  /// Adds one view. `gaussian_visible` and `gradient_norm` have one entry a decoded Gaussian; where visible is 0 the
  /// norm is not looked at.
  template <Executor E>
  void add_view(const DecodedStatistics<T>& decoded, std::span<const std::uint8_t> gaussian_visible,
                std::span<const T> gradient_norm, E& executor) {
    COMPMARK_ASSERT(decoded.opacity_sum.size() == decoded.visible.size(),
                    "GrowthStatistics: one opacity sum a visible anchor");
    COMPMARK_ASSERT(gaussian_visible.size() == decoded.gaussian_slot.size(),
                    "GrowthStatistics: one visibility a Gaussian");
    COMPMARK_ASSERT(gradient_norm.size() == decoded.gaussian_slot.size(),
                    "GrowthStatistics: one gradient norm a Gaussian");
    executor.for_chunks(decoded.visible.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) {
        opacity_sum[decoded.visible[i]] += decoded.opacity_sum[i];
        visits[decoded.visible[i]] += T(1);
      }
    });
    executor.for_chunks(decoded.gaussian_slot.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      const std::uint32_t* const slot = decoded.gaussian_slot.data();
      T* const sum = gradient_sum.data();
      T* const count = gradient_count.data();
      // No branch, because which Gaussians are on screen is not predictable: first what to add (SIMD), then where.
      constexpr std::size_t block = 64;
      T norm[block], one[block];
      for (std::size_t first = begin; first < end; first += block) {
        const std::size_t size = std::min(block, end - first);
        for (std::size_t i = 0; i < size; ++i) {
          const bool visible = gaussian_visible[first + i] != 0;
          const T value = gradient_norm[first + i];
          norm[i] = visible ? value : T{};
          one[i] = visible ? T(1) : T{};
        }
        for (std::size_t i = 0; i < size; ++i) {
          sum[slot[first + i]] += norm[i];
          count[slot[first + i]] += one[i];
        }
      }
    });
  }

  /// Follows a row edit of the anchors; statistics of appended anchors start at zero.
  void edit_rows(const RowEdit& edit) {
    const std::size_t offsets = anchors() == 0 ? 0 : slots() / anchors();
    for (Buffer<T>* column : {&opacity_sum, &visits}) move_column(*column, edit, 1);
    for (Buffer<T>* column : {&gradient_sum, &gradient_count}) move_column(*column, edit, offsets);
  }

  static constexpr std::size_t grain = std::size_t{1} << 15;

 private:
  static void move_column(Buffer<T>& column, const RowEdit& edit, std::size_t width) {
    Buffer<T> moved(edit.rows() * width);
    for (std::size_t row = 0; row < edit.kept.size(); ++row) {
      std::copy_n(column.data() + edit.kept[row] * width, width, moved.data() + row * width);
    }
    std::fill(moved.data() + edit.kept.size() * width, moved.data() + moved.size(), T{});
    column = std::move(moved);
  }
};

}  // namespace compmark
