// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// An entropy model is made for the anchors of its recipe: it reads as many offsets as they have.
// message: Recipe: EntropyModel codes another number of offsets
#include "compmark/codec/hac/hac_model.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"

using namespace compmark;

constexpr DecoderShape anchors = recipes::Scaffold::AnchorModel::shape;
struct Mine : recipes::Scaffold {
#ifdef COMPMARK_MUST_FAIL
  using EntropyModel = HacModel<float, anchors.feature_dim, 7>;
#else
  using EntropyModel = HacModel<float, anchors.feature_dim, anchors.offsets>;
#endif
};

Pipeline<Mine> pipeline;
