// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of the loss of saturated colours (watermark/loss/hsv.hpp). Cost: that of the loss.
#pragma once

#include "compmark/splat/training/run_policies.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/embed/stages/image_loss.hpp"

namespace compmark {

template <class Loss>
class HsvStage : public ImageLossStage<HsvStage<Loss>, Loss> {
  using Base = ImageLossStage<HsvStage<Loss>, Loss>;

 public:
  template <class R>
  void configure(const TrainSettings& settings) {
    Base::template configure<R>(settings);
    this->image_loss = hsv_loss<R>(settings.mark);
  }
  void set_phase(const StageIteration& iteration, typename Base::Phase& phase) const {
    phase.weight = this->schedule_.weights(iteration.t).hsv;
  }
};

}  // namespace compmark
