// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recipes that train for compression with ContextGS (Wang et al., NeurIPS 2024): any recipe, and the entropy model in
// which anchors predict anchors. Published numbers that differ from HAC's: a rate sample of 15 % (RateNumbers::sample),
// z at 0.0075, its prior at 0.005 to 0.00001.
//
//   ContextGs<Base>                       Base with anchor levels, hyperprior, adaptive steps and offset masks
//   ContextGsScaffold, ContextGsAlpha …   recipes of captures with the paper's anchors: D = 50, K = 10, distance input
//   ContextGsFitted, ContextGsFittedMasked …   a codec for a finished model of Scaffold, whose anchors stay as they are
#pragma once

#include "compmark/codec/context_gs/context_gs_model.hpp"
#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/recipes/scaffold.hpp"

namespace compmark::recipes {

template <class BaseRecipe>
struct ContextGs : BaseRecipe {
  using Base = BaseRecipe;
  using EntropyModel = ContextGsModel<typename BaseRecipe::Scalar, BaseRecipe::AnchorModel::shape.feature_dim,
                                      BaseRecipe::AnchorModel::shape.offsets>;
};

struct ContextGsScaffold : ContextGs<WithShape<Scaffold, coded_shape>> {};
struct ContextGsMasked : ContextGs<WithShape<ScaffoldMasked, coded_shape>> {};
struct ContextGsAlpha : ContextGs<WithShape<ScaffoldAlpha, coded_shape>> {};
struct ContextGsExposure : ContextGs<WithShape<ScaffoldExposure, coded_shape>> {};
struct ContextGsExposureMasked : ContextGs<WithShape<ScaffoldExposureMasked, coded_shape>> {};

struct ContextGsFitted : Fitted<ContextGs<Scaffold>> {};
struct ContextGsFittedMasked : Fitted<ContextGs<ScaffoldMasked>> {};
struct ContextGsFittedExposure : Fitted<ContextGs<ScaffoldExposure>> {};
struct ContextGsFittedExposureMasked : Fitted<ContextGs<ScaffoldExposureMasked>> {};

}  // namespace compmark::recipes
