// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The numbers of a training that fits a codec to a finished model (with_room_for_stages): its context and the masks of
// offsets are learned, and every other number of the model stays as it is, the mark in it too. Cost: none.
#pragma once

#include "compmark/splat/training/settings.hpp"

namespace compmark {

/// `settings` without growing and without learning rates but those of the codec, whose rate counts from the first
/// iteration on.
[[nodiscard]] inline TrainSettings codec_fit_settings(TrainSettings settings) {
  settings.grow_until = 0;
  settings.rate.noise_after = settings.rate.context_after = 0;
  for (LearningRate* rate :
       {&settings.offset, &settings.feature, &settings.scaling, &settings.mlp_opacity, &settings.mlp_covariance,
        &settings.mlp_color, &settings.feature_bank, &settings.appearance, &settings.effects.exposure}) {
    *rate = {0, 0};
  }
  return settings;
}

}  // namespace compmark
