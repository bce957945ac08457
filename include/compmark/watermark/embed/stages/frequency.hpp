// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of the loss of frequencies (watermark/loss/frequency.hpp). Growing may look at its error map, which is in
// the context's scratch (splat/anchor/frequency_growth.hpp). Cost: that of the loss.
#pragma once

#include "compmark/splat/training/run_policies.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/stages/image_loss.hpp"

namespace compmark {

template <class Loss>
class FrequencyStage : public ImageLossStage<FrequencyStage<Loss>, Loss> {
  using Base = ImageLossStage<FrequencyStage<Loss>, Loss>;

 public:
  template <class R>
  void configure(const TrainSettings& settings) {
    Base::template configure<R>(settings);
    this->image_loss = frequency_loss<R>(settings.mark);
  }
  void set_phase(const StageIteration& iteration, typename Base::Phase& phase) const {
    phase.weight = this->schedule_.weights(iteration.t).frequency;
  }
};

}  // namespace compmark
