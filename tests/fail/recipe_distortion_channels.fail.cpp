// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The distortion layer's network reads whole features: with another width than the anchors' it would read beyond them.
// message: Recipe: DistortionLayer distorts another number of feature channels
#include "compmark/recipes/scaffold.hpp"
#include "compmark/splat/quantizer/adaptive_quantizer.hpp"
#include "compmark/splat/training/pipeline.hpp"
#include "compmark/watermark/embed/distortion.hpp"

using namespace compmark;

#ifdef COMPMARK_MUST_FAIL
constexpr int channels = 50;
#else
constexpr int channels = recipes::Scaffold::AnchorModel::shape.feature_dim;
#endif

struct Mine : recipes::Scaffold {
  using Quantizer = AdaptiveQuantizer<float>;
  using DistortionLayer = QuantizationNoise<float, channels>;
};

Pipeline<Mine> pipeline;
