// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The whole method, and the same inside the hosts that train for compression (method sheet 5.8): there the residual is added before the codec's own
// step of quantization, so that f^w is what is distorted, what is rated and what the file holds, and the message is read from what comes out.
//
//   CompMarkGs<Host, Decoder>  Marked, with the frequency loss and the growing that looks at it
//   MarkedHac<Decoder>         in HAC        (HacScaffold, or another of hac.hpp)
//   MarkedContextGs<Decoder>   in ContextGS  (ContextGsScaffold, or another of context_gs.hpp)
//
// Differs from the paper: the distortion layer is the host's own, so its step is learned from the rate too; no second one is drawn.
#pragma once

#include "compmark/anchor/frequency_growth.hpp"
#include "compmark/loss/frequency.hpp"
#include "compmark/recipes/context_gs.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/recipes/marked.hpp"

namespace compmark::inline v0::recipes {

/// Without a distortion layer of its own; see MarkedForCompression for hosts that have none.
template <class HostRecipe, class Decoder>
struct CompMarkGs : Marked<HostRecipe, Decoder> {
  using FrequencyLoss = compmark::FrequencyLoss<typename HostRecipe::Scalar>;
  using DensityControl = FrequencyGrowth<typename HostRecipe::Scalar, typename HostRecipe::DensityControl>;
};

template <class Decoder, class HostRecipe = HacScaffold>
struct MarkedHac : CompMarkGs<HostRecipe, Decoder> {};

template <class Decoder, class HostRecipe = ContextGsScaffold>
struct MarkedContextGs : CompMarkGs<HostRecipe, Decoder> {};

}  // namespace compmark::inline v0::recipes
