// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The baseline GaussianMarker (Huang et al., NeurIPS 2024, "Uncertainty-Aware Copyright Protection of 3D Gaussian
// Splatting"), on anchors. The Fisher information of a finished model says which of its anchors the renders leave most
// uncertain (fisher_diagonal.hpp); those are copied, and the copies alone are trained, so that they are a perturbation
// that carries the mark. The loss of an iteration is
//   10 (0.8 L1 + 0.2 (1 - SSIM)) + cross entropy of the bits,
// render against photograph. Differs from the paper: anchors with all their Gaussians are copied, at their own place and
// not at one drawn from the Gaussian; features, offsets and sizes of the copies train, and the networks that decode them
// are frozen, as they belong to the originals too; one copied share is a number, where the released program compares
// with 0.002 of the mean. Its decoder of points is not here. docs/baselines.md says why, and what it measures.
//
//   recipes::GaussianMarker<Base, Decoder>   Base with a message and anchors that keep their bits
//   gaussianmarker_mark(), gaussianmarker_settings(settings)   its numbers
// Cost: a render and a backward pass a training view before the first iteration; an iteration is that of a training of
// the larger model, and a reading.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/baselines/anchor_copies.hpp"
#include "compmark/watermark/baselines/fisher_diagonal.hpp"
#include "compmark/watermark/baselines/frozen_model.hpp"
#include "compmark/watermark/baselines/frozen_originals.hpp"
#include "compmark/watermark/embed/base_model.hpp"

namespace compmark {

/// The share of the anchors that are seen which is copied.
inline constexpr double gaussianmarker_copied = 0.5;

/// The rows of the `share` of the anchors with an information above 0 that has the least, ascending; of equals the
/// first. Cost: a sort.
[[nodiscard]] inline std::vector<std::uint32_t> most_uncertain(std::span<const double> information, double share) {
  std::vector<std::uint32_t> rows;
  for (std::size_t i = 0; i < information.size(); ++i) {
    if (information[i] > 0) rows.push_back(static_cast<std::uint32_t>(i));
  }
  std::stable_sort(rows.begin(), rows.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return information[a] < information[b]; });
  rows.resize(static_cast<std::size_t>(std::llround(share * static_cast<double>(rows.size()))));
  std::sort(rows.begin(), rows.end());
  return rows;
}

namespace recipes {

/// Trained by Trainer, from begin(), on photographs. It has no Embedder: the copies carry the mark.
template <class BaseRecipe, class Decoder>
struct GaussianMarker : BaseRecipe {
  using Base = BaseRecipe;
  using MessageDecoder = Decoder;
  using Stages = StageList<FrozenOriginalsStage>;
  /// A training begins from begin() and not from the host as it is.
  static constexpr bool prepares_host = true;

  /// What is trained: `host`, and behind its anchors the copies. An Error where a view shows more than
  /// the rasterizer has memory for.
  template <class Views, Executor E>
  [[nodiscard]] static auto begin(const Model<BaseRecipe>& host, const Views& views, std::uint64_t seed, E& executor) {
    using Begun = Result<Model<GaussianMarker>>;
    FisherDiagonal<BaseRecipe> fisher(host);
    for (std::size_t i = 0; i < views.size(); ++i) {
      if (Result<Done> added = fisher.add_view(views.camera(i), i, seed, executor); !added) return Begun(added.error());
    }
    const std::vector<std::uint32_t> copied = most_uncertain(fisher.information(), gaussianmarker_copied);
    std::vector<std::uint32_t> all(host.anchor_count());
    std::iota(all.begin(), all.end(), std::uint32_t{0});
    Model<GaussianMarker> model = with_room_for_stages<GaussianMarker>(with_copies(host, all, copied), seed);
    FrozenOriginalsStage::train_from(model, all.size());
    return Begun(std::move(model));
  }
};

}  // namespace recipes

/// The mark's numbers; its logit scale is the decoder's, and residual.learning_rate that of the features.
[[nodiscard]] inline MarkNumbers gaussianmarker_mark() {
  MarkNumbers mark;
  mark.message.lambda = 1;
  mark.message.image_weight = 10;
  mark.message.after = mark.message.ramp = 0;
  mark.residual.learning_rate = 0.0075;
  return mark;
}
/// Settings of a run: the learning rates of anchors are the caller's, those of networks are 0.
[[nodiscard]] inline TrainSettings gaussianmarker_settings(TrainSettings settings) {
  const TrainSettings wanted = settings;
  settings = with_frozen_model(settings);
  settings.offset = wanted.offset;
  settings.feature = wanted.feature;
  settings.scaling = wanted.scaling;
  settings.grow_until = 0;
  settings.lambda_dssim = 0.2;
  settings.lambda_volume = 0;
  return settings;
}

}  // namespace compmark
