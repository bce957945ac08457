// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of PixelWeights (splat/effect/concept.hpp): weights the pixels of the photometric loss and of its gradient.
// Cost: that of the weights.
#pragma once

#include "compmark/core/views.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

template <class Weights>
struct PixelWeightsStage : Stage<PixelWeightsStage<Weights>> {
  using Own = StageOfLoss<PixelWeightsStage>;
  using Context = typename Weights::Context;
  static constexpr bool needs_target_planes = true, needs_pixel_weights = true;

  template <class Pass>
  static void before_photometric(const Pass& pass, const Own& own,
                                 ImageView<const typename Weights::Scalar>& compared) {
    Weights::mix(compared, pass.target.image, pass.target.weight, own.context, pass.executor);
    compared.data = own.context.mixed.data();
  }
  template <class Pass, class Report>
  static void after_photometric(const Pass& pass, const Own& own, Report& report) {
    const double factor = own.context.factor;
    Weights::apply(pass.context.d_image, pass.target.weight, own.context, pass.executor);
    report = {report.l1 * factor, 1 - (1 - report.ssim) * factor, report.loss * factor};
  }
};

}  // namespace compmark
