// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The concept names the alias that is missing.
// message: (R::Optimizer|no type named 'Optimizer')
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;

#ifdef COMPMARK_MUST_FAIL
struct Mine {
  using Scalar = float;
  using AnchorModel = recipes::Scaffold::AnchorModel;
  using GaussianDecoder = recipes::Scaffold::GaussianDecoder;
  using Rasterizer = recipes::Scaffold::Rasterizer;
  using DensityControl = recipes::Scaffold::DensityControl;
};
#else
struct Mine : recipes::Scaffold {};
#endif

Pipeline<Mine> pipeline;
