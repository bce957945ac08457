// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of the loss of frequencies (loss/frequency.hpp), of which growing may look at the error map
// (anchor/frequency_growth.hpp). Cost: that of the loss; a weight of zero skips it.
#pragma once

#include "compmark/pipeline/mark_phases.hpp"
#include "compmark/pipeline/run_policies.hpp"
#include "compmark/pipeline/settings.hpp"
#include "compmark/pipeline/stage.hpp"

namespace compmark {

template <class Loss>
class FrequencyStage : public Stage<FrequencyStage<Loss>> {
 public:
  using Scalar = typename Loss::Scalar;
  using Own = StageOfLoss<FrequencyStage>;
  struct Phase {
    double weight = 0;
  };
  struct Context {
    double loss = 0;  ///< the last one, without its weight
    typename Loss::Context frequency;
  };

  Loss image_loss;

  template <class R>
  void configure(const TrainSettings& settings) {
    phases_ = MarkPhases(settings.mark, settings.iterations);
  }
  void set_phase(const StageIteration& iteration, Phase& phase) const {
    phase.weight = phases_.weights(iteration.t).frequency;
  }
  void weigh_losses(const StageIteration& iteration, double& image_weight) const {
    image_weight = phases_.weights(iteration.t).image;
  }

  /// ADDS the gradient of the weighted loss into d_image.
  template <class Pass, class Report>
  void loss(const Pass& pass, const Own& own, Report& report) const {
    own.context.loss = 0;
    if (own.phase.weight == 0) return;
    own.context.loss =
        image_loss
            .forward_backward(pass.context.image, pass.target.image, static_cast<Scalar>(own.phase.weight),
                              pass.context.d_image, own.context.frequency, pass.executor)
            .loss;
    report.total += own.phase.weight * own.context.loss;
  }

 private:
  MarkPhases phases_;
};

}  // namespace compmark
