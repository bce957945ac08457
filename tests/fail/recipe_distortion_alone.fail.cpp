// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A distortion layer simulates a quantizer: without one it has no amplitude.
// message: Recipe: a DistortionLayer needs a Quantizer
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;

#ifdef COMPMARK_MUST_FAIL
struct Noise {
  struct Settings {};
};
struct Mine : recipes::Scaffold {
  using DistortionLayer = Noise;
};
#else
struct Mine : recipes::Scaffold {};
#endif

Pipeline<Mine> pipeline;
