// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The whole method, and the same inside the recipes that train for compression (docs/spec/method.md, 5.8): there the
// residual is added before the codec's own step of quantization, so that f^w is what is distorted, what is rated and
// what the file holds, and the message is read from what comes out.
//
//   CompMarkGs<Base, Decoder>  MarkedForCompression, with the frequency loss and the growing that looks at it
//   CompMarkGsPaper<Decoder>   the same as the paper's text has it
//   MarkedHac<Decoder>         in HAC        (HacScaffold, or another of hac.hpp)
//   MarkedContextGs<Decoder>   in ContextGS  (ContextGsScaffold, or another of context_gs.hpp)
//
// Differs from the paper inside a codec: the distortion layer is the codec's own, so its step is learned from the
// rate too; no second one is drawn.
#pragma once

#include "compmark/recipes/context_gs.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/recipes/marked.hpp"
#include "compmark/splat/anchor/frequency_growth.hpp"
#include "compmark/watermark/loss/frequency.hpp"

namespace compmark::recipes {

/// A marked recipe with the frequency loss and the growing that looks at it.
template <class MarkedRecipe>
struct WithFrequency : MarkedRecipe {
  using FrequencyLoss = compmark::FrequencyLoss<typename MarkedRecipe::Scalar>;
  using DensityControl = FrequencyGrowth<typename MarkedRecipe::Scalar, typename MarkedRecipe::Base::DensityControl>;
};

template <class BaseRecipe, class Decoder, DistortionOptions distortion_options = DistortionOptions{}>
struct CompMarkGs : WithFrequency<MarkedForCompression<BaseRecipe, Decoder, distortion_options>> {};
/// The paper's text has one step an anchor where the released program has one a channel.
template <class Decoder>
struct CompMarkGsPaper : CompMarkGs<CompMarkPaperBase, Decoder, DistortionOptions{.per_channel = false}> {};

template <class Decoder, class BaseRecipe = HacScaffold>
struct MarkedHac : WithFrequency<Marked<BaseRecipe, Decoder>> {};

template <class Decoder, class BaseRecipe = ContextGsScaffold>
struct MarkedContextGs : WithFrequency<Marked<BaseRecipe, Decoder>> {};

}  // namespace compmark::recipes
