// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The loss that holds a free offset small: weight mean d^2 over all anchors and channels (GuardSplat, Chen et al., CVPR
// 2025; its weight of 10 is that of the released program). It belongs to the parameters and not to a render, so it adds
// its gradient to the offset's directly; the loss that a training reports does not have it. Cost: a multiplication and
// an addition an element of the offset.
#pragma once

#include <cstddef>
#include <type_traits>

#include "compmark/core/views.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/stages/embedder.hpp"

namespace compmark {

/// For recipes with an Embedder, whose residual it holds.
class OffsetPenaltyStage : public Stage<OffsetPenaltyStage> {
 public:
  double weight = 10;  ///< at least 0

  /// The loss of an offset; 0 of an empty one.
  template <class T>
  [[nodiscard]] double loss_of(MatrixView<T> offset) const {
    double sum = 0;
    for (const auto value : offset.flat()) sum += static_cast<double>(value) * static_cast<double>(value);
    return offset.size() == 0 ? 0 : weight * sum / static_cast<double>(offset.size());
  }

  template <class Pass, class Own>
  void attributes_backward(const Pass& pass, const Own& /*own*/) const {
    auto& arena = pass.model.arena;
    const auto residual = pass.model.template blocks<EmbedderStage>().residual;
    const auto values = arena.values(residual);
    const auto gradients = arena.gradients(residual);
    using T = std::remove_cvref_t<decltype(*values.data)>;
    if (values.size() == 0) return;
    const T slope = static_cast<T>(2 * weight / static_cast<double>(values.size()));
    pass.executor.for_chunks(values.size(), grain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) gradients.data[i] += slope * values.data[i];
    });
  }

 private:
  static constexpr std::size_t grain = std::size_t{1} << 14;
};

}  // namespace compmark
