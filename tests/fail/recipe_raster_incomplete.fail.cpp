// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A recipe is checked at the door, in a sentence.
// message: Recipe: Rasterizer lacks forward, backward, screen, Settings or Context
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;

#ifdef COMPMARK_MUST_FAIL
struct Mine : recipes::Scaffold {
  struct Rasterizer {
    using Scalar = float;
    struct Settings {
      float near_plane, blur_variance;
    };
    struct Context {};
  };
};
#else
struct Mine : recipes::Scaffold {};
#endif

Pipeline<Mine> pipeline;
