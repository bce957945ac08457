// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Models without networks: a Gaussian an anchor, as the files of 3DGS store them (splat/anchor/explicit_decoder.hpp).
// They are exported and read without a loss (splat/export/explicit_splats.hpp), take more memory and bytes than
// Scaffold-GS for the same picture, and are decoded faster (docs/explicit_gaussians.md has figures).
#pragma once

#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/anchor/explicit_decoder.hpp"
#include "compmark/splat/anchor/explicit_gaussians.hpp"
#include "compmark/splat/anchor/split_and_clone.hpp"

namespace compmark {

/// Spherical harmonics of `sh_degree`, 0 to 3.
template <class T = float, int sh_degree = 3>
struct ExplicitRecipe : DefaultRecipe<T, ExplicitDecoder<T, sh_degree>::shape> {
  using AnchorModel = ExplicitGaussians<T, sh_degree>;
  using GaussianDecoder = ExplicitDecoder<T, sh_degree>;
  using DensityControl = SplitAndClone<T>;
};

namespace recipes {

struct Explicit : ExplicitRecipe<float, 3> {};

}  // namespace recipes

}  // namespace compmark
