// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One scalar everywhere.
// message: Recipe: Rasterizer has another Scalar than the recipe
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;

#ifdef COMPMARK_MUST_FAIL
struct Mine : recipes::Scaffold {
  using Rasterizer = testing::RasterizerArchetype<double>;
};
#else
struct Mine : recipes::Scaffold {};
#endif

Pipeline<Mine> pipeline;
