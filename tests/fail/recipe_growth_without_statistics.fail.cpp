// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Growing reads screen statistics; a rasterizer that was not asked for them would leave the anchors as they are,
// silently.
// message: Recipe: DensityControl reads screen statistics, which this Rasterizer does not collect
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/training/pipeline.hpp"

using namespace compmark;

#ifdef COMPMARK_MUST_FAIL
struct Mine : recipes::Scaffold {
  using Rasterizer = TileRasterizer<float>;
};
#else
struct Mine : recipes::Scaffold {
  using Rasterizer = TileRasterizer<float>;
  using DensityControl = NoGrowth;
};
#endif

Pipeline<Mine> pipeline;
