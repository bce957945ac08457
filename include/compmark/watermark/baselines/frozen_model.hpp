// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Learning rates of a finished model that a mark is hidden in and that stays as it is: all are 0, but those of the
// stages of a recipe. Adam leaves a block with a rate of 0 out, so that its values keep their bits. Cost: none.
#pragma once

#include "compmark/splat/training/settings.hpp"

namespace compmark {

[[nodiscard]] inline TrainSettings with_frozen_model(TrainSettings settings) {
  for (LearningRate* rate :
       {&settings.offset, &settings.feature, &settings.scaling, &settings.mlp_opacity, &settings.mlp_covariance,
        &settings.mlp_color, &settings.feature_bank, &settings.appearance, &settings.effects.exposure}) {
    *rate = {0, 0};
  }
  return settings;
}

}  // namespace compmark
