// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The baseline 3D-GSW (Jang et al., CVPR 2025, "Robust Watermark for 3D Gaussian Splatting"), on anchors. Before a
// finished model is marked, anchors that carry next to nothing of its error are removed, and of those that carry little
// the ones that draw where a render has much detail are split. Then everything trains on; the message is read through
// the low band of two wavelet levels. The loss of an iteration is
//   0.2 L1 + (1 - SSIM) + 0.3 wavelet subbands (subband_loss.hpp) + 0.4 cross entropy of the bits,
// render against photograph. Thresholds, weights and the share of patches are those of the released script. Differs from
// the paper: an anchor goes, or is split, by the largest contribution of its Gaussians; 1 - SSIM is in the place of
// LPIPS-VGG, whose weights could not be had; its mask of the gradients is a constant factor of each number, which Adam
// divides out, and is left out. docs/baselines.md says why, and what it measures.
//
//   recipes::ThreeDGsw<Base, Decoder>   Base with a message read by Decoder, a WaveletDecoder, and the subband loss
//   threedgsw_mark(), threedgsw_settings(settings)   its numbers
// Cost: a render, a backward pass and the transforms of a picture a training view before the first iteration; an
// iteration is a render, a reading of a sixteenth of its pixels, two image losses, one backward pass.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/buffer.hpp"
#include "compmark/core/result.hpp"
#include "compmark/scene/image_point.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/baselines/anchor_copies.hpp"
#include "compmark/watermark/baselines/anchor_split.hpp"
#include "compmark/watermark/baselines/detail_patches.hpp"
#include "compmark/watermark/baselines/error_contribution.hpp"
#include "compmark/watermark/baselines/subband_loss.hpp"
#include "compmark/watermark/baselines/wavelet_decoder.hpp"
#include "compmark/watermark/embed/base_model.hpp"

namespace compmark {

/// What is removed, and what is split.
struct ThreeDGswNumbers {
  double removed = 1e-8;   ///< anchors with no larger contribution
  double split = 8e-8;     ///< of the others those with no larger one, in a patch with much detail
  double patches = 0.001;  ///< of a render, that have much detail
};

/// Rows of anchors, ascending.
struct ThreeDGswRows {
  std::vector<std::uint32_t> kept;
  std::vector<std::uint32_t> split;  ///< places in `kept`
};
/// `largest` by ErrorContribution; `detailed` not 0: an anchor draws where there is much detail. The anchor with the
/// largest contribution is always kept. Cost: linear.
[[nodiscard]] inline ThreeDGswRows threedgsw_rows(std::span<const double> largest,
                                                  std::span<const std::uint8_t> detailed,
                                                  const ThreeDGswNumbers& numbers) {
  ThreeDGswRows rows;
  double most = 0;
  for (const double one : largest) most = one > most ? one : most;
  for (std::size_t i = 0; i < largest.size(); ++i) {
    if (!(largest[i] > numbers.removed) && largest[i] < most) continue;
    if (detailed[i] != 0 && largest[i] <= numbers.split)
      rows.split.push_back(static_cast<std::uint32_t>(rows.kept.size()));
    rows.kept.push_back(static_cast<std::uint32_t>(i));
  }
  return rows;
}

namespace recipes {

/// Trained by Trainer, from begin(), on photographs. It has no Embedder: every parameter carries the mark.
template <class BaseRecipe, class Decoder>
struct ThreeDGsw : BaseRecipe {
  using Base = BaseRecipe;
  using MessageDecoder = Decoder;
  using Stages = StageList<SubbandLossStage<typename BaseRecipe::Scalar>>;
  /// A training begins from begin() and not from the host as it is.
  static constexpr bool prepares_host = true;

  /// What is trained: the anchors of `host` that are kept, some of them split. An Error is that of a photograph, or
  /// of a view that shows more than the rasterizer has memory for.
  template <class Views, Executor E>
  [[nodiscard]] static auto begin(const Model<BaseRecipe>& host, Views& views, std::uint64_t seed, E& executor) {
    using Begun = Result<Model<ThreeDGsw>>;
    using Scalar = typename BaseRecipe::Scalar;
    const ThreeDGswNumbers numbers;
    ErrorContribution<BaseRecipe> contribution(host);
    std::vector<std::uint8_t> detailed(host.anchor_count(), 0);
    Buffer<Scalar> photograph;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const auto camera = views.camera(i);
      photograph.resize(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
      const ImageView<Scalar> seen{photograph.data(), 3, camera.height, camera.width};
      if (Result<Done> loaded = views.load(i, seen); !loaded) return Begun(loaded.error());
      if (Result<Done> added = contribution.add_view(camera, i, seen, executor); !added) return Begun(added.error());
      const DetailPatches patches(contribution.image(), numbers.patches);
      contribution.for_gaussians([&](std::size_t anchor, const std::array<double, 3>& center) {
        if (detailed[anchor] == 0 && patches.holds(image_point<double>(camera, center))) detailed[anchor] = 1;
      });
    }
    const ThreeDGswRows rows = threedgsw_rows(contribution.largest(), detailed, numbers);
    std::vector<std::uint32_t> copied;
    for (const std::uint32_t place : rows.split) copied.push_back(rows.kept[place]);
    Model<BaseRecipe> changed = with_copies(host, rows.kept, copied);
    split_copies(changed, rows.split, seed);
    return Begun(with_room_for_stages<ThreeDGsw>(changed, seed));
  }
};

}  // namespace recipes

/// The mark's numbers; its logit scale is the decoder's, and residual.learning_rate that of the features.
[[nodiscard]] inline MarkNumbers threedgsw_mark() {
  MarkNumbers mark;
  mark.message.lambda = 0.4;
  mark.message.image_weight = 1.2;
  mark.message.after = mark.message.ramp = 0;
  mark.residual.learning_rate = 0.0075;
  return mark;
}
/// The losses of a run; its learning rates are the caller's.
[[nodiscard]] inline TrainSettings threedgsw_settings(TrainSettings settings) {
  settings.grow_until = 0;
  settings.lambda_dssim = 1 / 1.2;
  settings.lambda_volume = 0;
  return settings;
}

}  // namespace compmark
