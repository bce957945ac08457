// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The baseline GuardSplat (Chen et al., CVPR 2025) as the CompMarkGS paper (ICLR 2026) adapts it to anchors: a finished
// model is frozen, and offsets beside its features are learned. The loss of an iteration is
//   0.8 L1 + 0.2 (1 - SSIM) + 0.03 cross entropy of the bits + 10 mean d^2,
// render against the unmarked model's render of a training view (unmarked_views.hpp). Adam, rate 0.005, constant.
//
// Differs from the paper: its decoder reads CLIP features, ours is any MessageDecoder; its image loss has LPIPS beside
// L1 and SSIM, ours has none; it offsets spherical harmonics, and anchors have features. A trained feature reaches the
// shape and opacity of Gaussians too, which the paper's offsets leave alone. One view makes an iteration, not a batch
// of 16. docs/baselines.md says why, and what it measures.
//
//   recipes::GuardSplat<Base, Decoder>   Base with FeatureOffset, a message, and the loss that holds the offset
//   guardsplat_settings(settings)        its numbers
// Cost an iteration: two renders, a reading, one backward pass.
#pragma once

#include <cstdint>

#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/baselines/feature_offset.hpp"
#include "compmark/watermark/baselines/frozen_model.hpp"
#include "compmark/watermark/baselines/offset_penalty.hpp"

namespace compmark {

namespace recipes {

/// Trained by Trainer from a finished model (with_room_for_stages) on UnmarkedViews.
template <class BaseRecipe, class Decoder>
struct GuardSplat : BaseRecipe {
  using Base = BaseRecipe;
  using Embedder = FeatureOffset<typename BaseRecipe::Scalar>;
  using MessageDecoder = Decoder;
  using Stages = StageList<OffsetPenaltyStage>;
  /// What it is trained on: renders of the unmarked model, not photographs.
  static constexpr bool targets_unmarked = true;
};

}  // namespace recipes

/// The mark's numbers; its logit scale is the decoder's.
[[nodiscard]] inline MarkNumbers guardsplat_mark() {
  MarkNumbers mark;
  mark.message.lambda = 0.03;
  mark.message.after = mark.message.ramp = 0;
  mark.residual.learning_rate = 0.005;
  return mark;
}
/// Settings of a run whose mark has those numbers, or others: everything but the offsets is frozen, and nothing grows.
[[nodiscard]] inline TrainSettings guardsplat_settings(TrainSettings settings) {
  settings = with_frozen_model(settings);
  settings.grow_until = 0;
  settings.lambda_dssim = 0.2;
  settings.lambda_volume = 0;
  return settings;
}

}  // namespace compmark
