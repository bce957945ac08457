// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The decoder reads the table that the anchor model stores.
// message: Recipe: GaussianDecoder reads another shape than AnchorModel stores
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;

#ifdef COMPMARK_MUST_FAIL
struct Mine : recipes::Scaffold {
  using GaussianDecoder = MlpDecoder<float, DecoderShape{.feature_dim = 50}>;
};
#else
struct Mine : recipes::Scaffold {};
#endif

Pipeline<Mine> pipeline;
