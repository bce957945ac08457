// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A Gaussian decoder that cannot say which anchors it decoded would be found out by growing alone.
// message: Recipe: GaussianDecoder lacks Scalar, shape, Handles, Context, add_parameters, initialise, forward, backward or statistics
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"

using namespace compmark;

struct Mine : recipes::Scaffold {
  struct GaussianDecoder : MlpDecoder<float, AnchorModel::shape> {
#ifdef COMPMARK_MUST_FAIL
    void statistics() const = delete;
#endif
  };
};

Pipeline<Mine> pipeline;
