// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of an AlphaLoss (splat/effect/concept.hpp): the coverage of the render against that of the photograph.
// Cost: that of the loss.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "compmark/core/config.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

template <class Loss>
class AlphaLossStage : public Stage<AlphaLossStage<Loss>> {
 public:
  using Scalar = typename Loss::Scalar;
  using Own = StageOfLoss<AlphaLossStage>;
  using Context = typename Loss::Context;
  struct Phase {
    double weight = 0;  ///< of the loss
  };
  static constexpr bool needs_target_planes = true, needs_alpha = true;

  template <class R>
  void configure(const TrainSettings& settings) {
    weight_ = settings.effects.lambda_alpha;
  }
  void set_phase(const StageIteration& /*iteration*/, Phase& phase) const { phase.weight = weight_; }

  template <class Pass, class Report>
  static void loss(const Pass& pass, const Own& own, Report& report) {
    COMPMARK_ASSERT(pass.target.alpha != nullptr, "AlphaLoss: this recipe compares alpha, and the target has none");
    const std::size_t pixels = pass.context.image.plane_size();
    // Pixels that do not count in the image do not count here.
    const Scalar* const counts = pass.stages_weigh_pixels ? pass.target.weight : nullptr;
    const double weight = pass.weights.image * own.phase.weight;
    report.alpha = Loss::forward_backward(std::span<const Scalar>(pass.context.raster.alpha.data(), pixels),
                                          std::span<const Scalar>(pass.target.alpha, pixels), counts,
                                          static_cast<Scalar>(weight), own.context, pass.executor);
    report.total += weight * report.alpha;
  }
  template <class Image>
  static void no_loss(const Own& own, const Image& image) {
    own.context.d_alpha.resize(image.plane_size());
    std::fill(own.context.d_alpha.begin(), own.context.d_alpha.end(), Scalar(0));
  }
  template <class Image, class Planes>
  static void plane_gradients(const Own& own, const Image& image, Planes& planes) {
    planes.alpha = {own.context.d_alpha.data(), 1, image.height, image.width};
  }

 private:
  double weight_ = 0;
};

}  // namespace compmark
