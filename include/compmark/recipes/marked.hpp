// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recipes with a watermark: any host recipe, and the stages that put a message into its anchors. The stored model is
// one of the host recipe: the mark is baked into the features, and a reader of the file needs no recipe of this header
// (baked_host).
//   Marked<Host, Decoder>            f^w = f + tanh f', message read by Decoder, loss of saturated colours
//   MarkedForCompression<…>          the same with the noise of quantization in training, for a codec
#pragma once

#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/quantizer/adaptive_quantizer.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/watermark/embed/distortion.hpp"
#include "compmark/watermark/embed/finished_host.hpp"
#include "compmark/watermark/embed/mark_report.hpp"
#include "compmark/watermark/embed/residual.hpp"
#include "compmark/watermark/loss/hsv.hpp"

namespace compmark {

namespace recipes {

/// CompMarkGS on `HostRecipe`, without its distortion layer.
template <class HostRecipe, class Decoder>
struct Marked : HostRecipe {
  using Host = HostRecipe;
  using Embedder = ResidualFeature<typename HostRecipe::Scalar>;
  using MessageDecoder = Decoder;
  using HsvLoss = compmark::HsvLoss<typename HostRecipe::Scalar>;
};

/// CompMarkGS on `HostRecipe`.
template <class HostRecipe, class Decoder, DistortionOptions distortion_options = DistortionOptions{}>
struct MarkedForCompression : Marked<HostRecipe, Decoder> {
  using Quantizer = AdaptiveQuantizer<typename HostRecipe::Scalar>;
  using DistortionLayer =
      QuantizationNoise<typename HostRecipe::Scalar, HostRecipe::AnchorModel::shape.feature_dim, distortion_options>;
};

}  // namespace recipes

/// The model of the host recipe with the mark baked into its anchors: it renders the same bits as `marked` does outside
/// of training.
template <Recipe R>
[[nodiscard]] Model<typename R::Host> baked_host(const Model<R>& marked) {
  Model<R> baked = marked;
  baked.bake_stages();
  return host_alone(baked);
}

}  // namespace compmark
