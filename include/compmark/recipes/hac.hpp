// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recipes that train for compression with HAC (Chen et al., ECCV 2024): any recipe, and the entropy model whose rate is
// a loss. The model that comes out renders by itself; codec/hac/hac_encoder.hpp makes the small file of it.
//
//   Hac<Base>                 Base with hash-grid context, adaptive steps and offset masks
//   HacScaffold, HacAlpha …   the recipes of captures with the paper's anchors: D = 50, K = 10, distance input
//   HacFitted, HacFittedMasked …   a codec for a finished model of Scaffold, whose anchors stay (with_room_for_stages)
#pragma once

#include "compmark/codec/hac/hac_model.hpp"
#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/scaffold.hpp"

namespace compmark::recipes {

/// `grid`: levels of the context's hash grid; the published one has 1.77 million entries of one bit, 216 KB before
/// coding.
template <class BaseRecipe, HashGridShape grid = HashGridShape{}>
struct Hac : BaseRecipe {
  using Base = BaseRecipe;
  using EntropyModel = HacModel<typename BaseRecipe::Scalar, BaseRecipe::AnchorModel::shape.feature_dim,
                                BaseRecipe::AnchorModel::shape.offsets, grid>;
};

/// A capture's recipe with anchors and heads of another shape.
template <class Capture, DecoderShape decoder_shape>
struct WithShape : Capture {
  using AnchorModel = ScaffoldAnchors<typename Capture::Scalar, decoder_shape>;
  using GaussianDecoder = MlpDecoder<typename Capture::Scalar, decoder_shape>;
};
inline constexpr DecoderShape coded_shape{.feature_dim = 50, .distance = true};

struct HacScaffold : Hac<WithShape<Scaffold, coded_shape>> {};
struct HacMasked : Hac<WithShape<ScaffoldMasked, coded_shape>> {};
struct HacAlpha : Hac<WithShape<ScaffoldAlpha, coded_shape>> {};
struct HacExposure : Hac<WithShape<ScaffoldExposure, coded_shape>> {};
struct HacExposureMasked : Hac<WithShape<ScaffoldExposureMasked, coded_shape>> {};

/// A finished model and a codec that is fitted to it.
template <class CodedRecipe>
struct Fitted : CodedRecipe {
  static constexpr bool is_fitted = true;
};
struct HacFitted : Fitted<Hac<Scaffold>> {};
struct HacFittedMasked : Fitted<Hac<ScaffoldMasked>> {};
struct HacFittedExposure : Fitted<Hac<ScaffoldExposure>> {};
struct HacFittedExposureMasked : Fitted<Hac<ScaffoldExposureMasked>> {};

}  // namespace compmark::recipes
