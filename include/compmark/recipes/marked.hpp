// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recipes with a watermark: any base recipe, and the stages that put a message into its anchors. The stored model is
// one of the base recipe: the mark is baked into the features, and a reader of the file needs no recipe of this header
// (baked_model).
//   Marked<Base, Decoder>            f^w = f + tanh f', message read by Decoder, loss of saturated colours
//   MarkedForCompression<…>          the same with the noise of quantization in training, for a codec
#pragma once

#include "compmark/recipes/recipe_stages.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/quantizer/adaptive_quantizer.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/watermark/embed/base_model.hpp"
#include "compmark/watermark/embed/distortion.hpp"
#include "compmark/watermark/embed/mark_report.hpp"
#include "compmark/watermark/embed/residual.hpp"
#include "compmark/watermark/embed/stages/lost_anchors.hpp"
#include "compmark/watermark/loss/hsv.hpp"

namespace compmark {

namespace recipes {

/// CompMarkGS on `BaseRecipe`, without its distortion layer.
template <class BaseRecipe, class Decoder>
struct Marked : BaseRecipe {
  using Base = BaseRecipe;
  using Embedder = ResidualFeature<typename BaseRecipe::Scalar>;
  using MessageDecoder = Decoder;
  using HsvLoss = compmark::HsvLoss<typename BaseRecipe::Scalar>;
};

/// CompMarkGS on `BaseRecipe`.
template <class BaseRecipe, class Decoder, DistortionOptions distortion_options = DistortionOptions{}>
struct MarkedForCompression : Marked<BaseRecipe, Decoder> {
  using Quantizer = AdaptiveQuantizer<typename BaseRecipe::Scalar>;
  using DistortionLayer =
      QuantizationNoise<typename BaseRecipe::Scalar, BaseRecipe::AnchorModel::shape.feature_dim, distortion_options>;
};

/// A mark that is hidden in finished models alone (PosthocEmbedding): the recipe has no training with photographs.
template <class MarkedRecipe>
struct FinishedOnly : MarkedRecipe {
  static constexpr bool is_of_finished_models = true;
};

/// The same, learned in views that lack anchors (PosthocSettings::lost_anchors).
template <class MarkedRecipe>
struct WithLostAnchors : MarkedRecipe {
  using Stages = JoinStages<typename detail::OwnStages<MarkedRecipe>::type, StageList<LostAnchorsStage>>;
};

}  // namespace recipes

/// The model of the base recipe with the mark baked into its anchors: it renders the same bits as `marked` does outside
/// of training.
template <Recipe R>
[[nodiscard]] Model<typename R::Base> baked_model(const Model<R>& marked) {
  Model<R> baked = marked;
  baked.bake_stages();
  return base_model(baked);
}

}  // namespace compmark
