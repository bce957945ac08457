// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stages of a recipe, in the order in which they are called: those of the policies that it names, and after them
// its own, if it has a list `Stages`. To add a stage of one's own, that list is all: `struct Mine : recipes::Scaffold {
// using Stages = StageList<MyStage>; };`. Cost: none.
#pragma once

#include <type_traits>

#include "compmark/core/absent.hpp"
#include "compmark/pipeline/recipe.hpp"
#include "compmark/pipeline/stage.hpp"
#include "compmark/pipeline/stages/alpha_loss.hpp"
#include "compmark/pipeline/stages/background.hpp"
#include "compmark/pipeline/stages/distortion.hpp"
#include "compmark/pipeline/stages/embedder.hpp"
#include "compmark/pipeline/stages/exposure.hpp"
#include "compmark/pipeline/stages/frequency.hpp"
#include "compmark/pipeline/stages/hsv.hpp"
#include "compmark/pipeline/stages/message.hpp"
#include "compmark/pipeline/stages/pixel_weights.hpp"
#include "compmark/pipeline/stages/rate.hpp"

namespace compmark {

namespace detail {
template <template <class...> class S, class Policy, bool usable>
struct StageOfPolicy {
  using type = StageList<>;
};
template <template <class...> class S, class Policy>
struct StageOfPolicy<S, Policy, true> {
  using type = StageList<S<Policy>>;
};
/// The stage of a policy that is there. One that lacks a member is left out, so that check_recipe's sentence is all
/// that the compiler says of it.
template <template <class...> class S, class Policy, bool complete = true>
using StagesOf = typename StageOfPolicy<S, Policy, present<Policy> && complete>::type;
template <class R>
struct OwnStages {
  using type = StageList<>;
};
template <class R>
  requires requires { typename R::Stages; }
struct OwnStages<R> {
  using type = typename R::Stages;
};
}  // namespace detail

template <Recipe R>
using RecipeStages =
    JoinStages<detail::StagesOf<ExposureStage, typename R::Exposure, Exposure<typename R::Exposure>>,
               detail::StagesOf<PixelWeightsStage, typename R::PixelWeights, PixelWeights<typename R::PixelWeights>>,
               detail::StagesOf<BackgroundStage, typename R::Background, Background<typename R::Background>>,
               detail::StagesOf<AlphaLossStage, typename R::AlphaLoss, AlphaLoss<typename R::AlphaLoss>>,
               detail::StagesOf<EmbedderStage, typename R::Embedder, Embedder<typename R::Embedder>>,
               detail::StagesOf<MessageStage, typename R::MessageDecoder, MessageDecoder<typename R::MessageDecoder>>,
               detail::StagesOf<HsvStage, typename R::HsvLoss, ImageLoss<typename R::HsvLoss>>,
               detail::StagesOf<FrequencyStage, typename R::FrequencyLoss, ImageLoss<typename R::FrequencyLoss>>,
               detail::StagesOf<DistortionStage, RecipeDistortion<R>, DistortionLayer<RecipeDistortion<R>>>,
               detail::StagesOf<RateStage, typename R::EntropyModel, EntropyModel<typename R::EntropyModel>>,
               typename detail::OwnStages<R>::type>;

}  // namespace compmark
