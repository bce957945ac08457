// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recipes for captures with effects: the closed list that the effects of scene/probe.hpp are matched with. Each is
// Scaffold-GS and exactly the effects it names; docs/effects.md has their cost and gain.
#pragma once

#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/effect/alpha_loss.hpp"
#include "compmark/splat/effect/background.hpp"
#include "compmark/splat/effect/exposure.hpp"
#include "compmark/splat/effect/pixel_weights.hpp"
#include "compmark/splat/raster/effects.hpp"
#include "compmark/splat/raster/outputs.hpp"
#include "compmark/splat/raster/tile.hpp"

namespace compmark {

namespace recipes {

/// Photographs with pixels that do not count: masks, or borders that a lens taken out leaves empty.
struct ScaffoldMasked : Scaffold {
  using PixelWeights = MaskedPixels<float>;
};

/// Photographs with an alpha channel: a random background in every iteration, and the coverage itself is supervised.
struct ScaffoldAlpha : Scaffold {
  using Rasterizer = TileRasterizer<float, accuracy::standard, RasterOutputs{.alpha = true, .screen_statistics = true}>;
  using Background = RandomBackground;
  using AlphaLoss = L1AlphaLoss<float>;
};

/// Cameras at several distances or focal lengths: what is smaller than a pixel keeps its energy (with a blur variance
/// of 0.1 pixels^2, as published; antialiasing_blur_variance).
struct ScaffoldAntiAliased : Scaffold {
  using Rasterizer = EffectTileRasterizer<float, RasterEffects<PinholeLens, MipFilter>, accuracy::standard,
                                          RasterOutputs{.screen_statistics = true}>;
};
inline constexpr double antialiasing_blur_variance = 0.1;

/// The same with pixels that do not count: what a hand-held capture with a lens calls for most often. It shares the
/// rasterizer's code with ScaffoldAntiAliased.
struct ScaffoldAntiAliasedMasked : ScaffoldAntiAliased {
  using PixelWeights = MaskedPixels<float>;
};

/// Cut-out objects from several distances: alpha and the mip filter.
struct ScaffoldAlphaAntiAliased : ScaffoldAlpha {
  using Rasterizer = EffectTileRasterizer<float, RasterEffects<PinholeLens, MipFilter>, accuracy::standard,
                                          RasterOutputs{.alpha = true, .screen_statistics = true}>;
};

/// Photographs through a lens of the radial and tangential family, left as they are: Gaussians are projected through
/// the lens.
struct ScaffoldLens : Scaffold {
  using Rasterizer = EffectTileRasterizer<float, RasterEffects<RadialTangentialLens<float>>, accuracy::standard,
                                          RasterOutputs{.screen_statistics = true}>;
};
/// The same for a fisheye, which undistorting would crop.
struct ScaffoldFisheye : Scaffold {
  using Rasterizer = EffectTileRasterizer<float, RasterEffects<FisheyeLens<float>>, accuracy::standard,
                                          RasterOutputs{.screen_statistics = true}>;
};

/// Photographs whose exposure or white balance drifts.
struct ScaffoldExposure : Scaffold {
  using Exposure = AffineExposure<float>;
};
struct ScaffoldExposureMasked : ScaffoldMasked {
  using Exposure = AffineExposure<float>;
};

}  // namespace recipes

}  // namespace compmark
