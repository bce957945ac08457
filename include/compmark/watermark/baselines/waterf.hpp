// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The baseline WateRF (Jang et al., CVPR 2024), made for radiance fields, on anchors as the CompMarkGS paper compares
// itself with it (ICLR 2026): everything in a finished model trains on, at small rates, without growing. The message
// is read through the low band of two wavelet levels. The loss of an iteration is
//   l (1 - SSIM) + (1 - l) cross entropy of the bits + the patch loss (patch_loss.hpp),
// render against photograph, with a share l = 0.1.
//
// Differs from the paper: l is a number here, the least that its learned one may become, and there it is learned by
// gradient ascent from the fifth epoch on; the image loss is 1 - SSIM, and there Watson-VGG, whose weights could not be
// had; patches are of the whole render, which needs no deferred pass (patch_loss.hpp). docs/baselines.md says why.
//
//   recipes::Waterf<Base, Decoder>   Base with a message read by Decoder, a WaveletDecoder, and the patch loss
//   waterf_mark()                    its numbers
//   waterf_settings(settings)        those of a run
// Cost an iteration: a render, a reading of a sixteenth of its pixels, two image losses, one backward pass.
#pragma once

#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/baselines/patch_loss.hpp"
#include "compmark/watermark/baselines/wavelet_decoder.hpp"

namespace compmark {

namespace recipes {

/// Trained by Trainer from a finished model (with_room_for_stages) on its photographs. It has no Embedder: every
/// parameter carries the mark.
template <class BaseRecipe, class Decoder>
struct Waterf : BaseRecipe {
  using Base = BaseRecipe;
  using MessageDecoder = Decoder;
  using Stages = StageList<PatchLossStage<typename BaseRecipe::Scalar>>;
};

}  // namespace recipes

/// The share l of the image loss.
inline constexpr double waterf_image_share = 0.1;

/// The mark's numbers; its logit scale is the decoder's, and residual.learning_rate that of the features.
[[nodiscard]] inline MarkNumbers waterf_mark() {
  MarkNumbers mark;
  mark.message.lambda = 1 - waterf_image_share;
  mark.message.image_weight = waterf_image_share;
  mark.message.after = mark.message.ramp = 0;
  mark.residual.learning_rate = 0.002;
  return mark;
}
/// The losses of a run; its learning rates are the caller's.
[[nodiscard]] inline TrainSettings waterf_settings(TrainSettings settings) {
  settings.grow_until = 0;
  settings.lambda_dssim = 1;
  settings.lambda_volume = 0;
  return settings;
}

}  // namespace compmark
