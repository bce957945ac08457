// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of the loss of frequencies (watermark/loss/frequency.hpp). Growing may look at its error map, which is in
// the context's scratch (splat/anchor/frequency_growth.hpp). Cost: that of the loss.
#pragma once

#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/stages/image_loss.hpp"

namespace compmark {

template <class Loss>
class FrequencyStage : public ImageLossStage<FrequencyStage<Loss>, Loss> {
 public:
  void set_phase(const StageIteration& iteration,
                 typename ImageLossStage<FrequencyStage<Loss>, Loss>::Phase& phase) const {
    phase.weight = this->schedule_.weights(iteration.t).frequency;
  }
};

}  // namespace compmark
