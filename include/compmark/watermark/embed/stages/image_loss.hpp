// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The common part of stages with a loss between render and photograph (splat/loss/concept.hpp): a weight of the
// iteration, the call and its report. A weight of zero skips the call. Cost: that of the loss.
#pragma once

#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/mark_phases.hpp"

namespace compmark {

/// Base of the stage Self of a watermark's ImageLoss.
template <class Self, class Loss>
class ImageLossStage : public Stage<Self> {
 public:
  using Scalar = typename Loss::Scalar;
  struct Phase {
    double weight = 0;
  };
  struct Context {
    double loss = 0;  ///< the last one, without its weight
    typename Loss::Context scratch;

    [[nodiscard]] auto error_map() const requires requires(const typename Loss::Context& own) { own.error_map(); }
    { return scratch.error_map(); }
  };
  static constexpr bool keeps_error_map = requires(const Context& context) { context.error_map(); };

  Loss image_loss;

  template <class R>
  void configure(const TrainSettings& settings) {
    schedule_ = MarkPhases(settings.mark, settings.iterations);
  }
  void weigh_losses(const StageIteration& iteration, double& image_weight) const {
    image_weight = schedule_.weights(iteration.t).image;
  }

  /// ADDS the gradient of the weighted loss into d_image.
  template <class Pass, class Own, class Report>
  void loss(const Pass& pass, const Own& own, Report& report) const {
    own.context.loss = 0;
    if (own.phase.weight == 0) return;
    own.context.loss =
        image_loss
            .forward_backward(pass.context.image, pass.target.image, static_cast<Scalar>(own.phase.weight),
                              pass.context.d_image, own.context.scratch, pass.executor)
            .loss;
    report.total += own.phase.weight * own.context.loss;
  }

 protected:
  MarkPhases schedule_;
};

}  // namespace compmark
