// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The base recipes: plain anchor-based splatting, no watermark, no codec. Everything later inherits one of these and
// renames.
#pragma once

#include "compmark/codec/rate/concept.hpp"
#include "compmark/recipes/recipe_stages.hpp"
#include "compmark/splat/anchor/growth.hpp"
#include "compmark/splat/anchor/level_of_detail.hpp"
#include "compmark/splat/anchor/mlp_decoder.hpp"
#include "compmark/splat/anchor/scaffold_anchors.hpp"
#include "compmark/splat/anchor/space.hpp"
#include "compmark/splat/effect/concept.hpp"
#include "compmark/splat/loss/concept.hpp"
#include "compmark/splat/optim/adam.hpp"
#include "compmark/splat/quantizer/concept.hpp"
#include "compmark/splat/raster/tile.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/watermark/decoder/concept.hpp"

namespace compmark {

/// The tile rasterizer that also collects the statistics for growing.
template <class T = float, Accuracy raster_accuracy = accuracy::standard>
using TrainingRasterizer = TileRasterizer<T, raster_accuracy, RasterOutputs{.screen_statistics = true}>;

/// The base of every recipe: it has no optional stage.
template <class T = float, DecoderShape decoder_shape = DecoderShape{}, Accuracy raster_accuracy = accuracy::standard>
struct DefaultRecipe {
  using Scalar = T;
  using AnchorModel = ScaffoldAnchors<T, decoder_shape>;
  using GaussianDecoder = MlpDecoder<T, decoder_shape>;
  using Rasterizer = TrainingRasterizer<T, raster_accuracy>;
  using DensityControl = GradientGrowth<T>;
  using Space = EuclideanSpace;
  using Optimizer = Adam<T>;
  using Embedder = NoEmbedder;
  using DistortionLayer = NoDistortion;
  using Quantizer = NoQuantizer;
  using EntropyModel = NoEntropyModel;
  using MessageDecoder = NoMessageDecoder;
  using HsvLoss = NoHsvLoss;
  using FrequencyLoss = NoFrequencyLoss;
  using Exposure = NoExposure;
  using Background = ConstantBackground;
  using AlphaLoss = NoAlphaLoss;
  using PixelWeights = NoPixelWeights;
};

/// The five policy axes by position; the same type as a struct that inherits DefaultRecipe and renames them.
template <AnchorModel Anchors, Rasterizer Raster, DistortionLayer Distortion = NoDistortion,
          Quantizer Quantization = NoQuantizer, MessageDecoder Decoder = NoMessageDecoder>
struct Policies : DefaultRecipe<typename Anchors::Scalar, Anchors::shape> {
  using AnchorModel = Anchors;
  using Rasterizer = Raster;
  using DistortionLayer = Distortion;
  using Quantizer = Quantization;
  using MessageDecoder = Decoder;
};

namespace recipes {

/// A recipe whose renders leave out anchors that are too small to be seen (splat/anchor/level_of_detail.hpp). Its
/// blocks are those of the recipe, so that a model file of one is read as the other.
template <class Complete, DetailLimit limit = DetailLimit{}>
struct WithDetail : Complete {
  using AnchorModel = LevelOfDetail<typename Complete::AnchorModel, limit>;
};

/// Scaffold-GS as its authors run it: D = 32, K = 10, no distance input (profile "scaffold").
struct Scaffold : DefaultRecipe<float> {};

/// The model of the published CompMarkGS code: D = 50 (profile "official").
struct CompMarkBase : DefaultRecipe<float, DecoderShape{.feature_dim = 50}> {};

/// The same with the distance input that its paper describes (profile "paper").
struct CompMarkPaperBase : DefaultRecipe<float, DecoderShape{.feature_dim = 50, .distance = true}> {};

}  // namespace recipes

}  // namespace compmark
