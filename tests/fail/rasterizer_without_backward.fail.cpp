// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A Rasterizer that forgot backward is told so, by the concept.
// message: backward
#include "compmark/splat/raster/concept.hpp"
#include "compmark/testing/archetypes.hpp"

using namespace compmark;

struct Incomplete {
  using Scalar = float;
  struct Settings {};
  struct Context {};
  template <Executor E>
  RasterReport forward(GaussianColumns<const float>, const Camera<float>&, std::array<float, 3>, ImageView<float>,
                       Context&, E&) const {
    return {};
  }
  ScreenStatistics<float> screen(const Context&) const { return {}; }
};

#ifdef COMPMARK_MUST_FAIL
using Candidate = Incomplete;
#else
using Candidate = testing::RasterizerArchetype<float>;
#endif
static_assert(Rasterizer<Candidate>);
