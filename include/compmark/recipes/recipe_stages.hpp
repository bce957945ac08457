// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stages of a recipe, in the order in which they are called: those of the policies that it names, and after them
// its own, if it has a list `Stages`. This is the one place that knows the stages of both wings. To add a stage of
// one's own, that list is all: `struct Mine : recipes::Scaffold { using Stages = StageList<MyStage>; };`. Cost: none.
#pragma once

#include <type_traits>

#include "compmark/codec/model/step_bias_calibration.hpp"  // with each list: a recipe must not lack it
#include "compmark/codec/rate/stages/rate.hpp"
#include "compmark/core/absent.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/splat/training/stages/alpha_loss.hpp"
#include "compmark/splat/training/stages/background.hpp"
#include "compmark/splat/training/stages/exposure.hpp"
#include "compmark/splat/training/stages/pixel_weights.hpp"
#include "compmark/watermark/embed/stages/distortion.hpp"
#include "compmark/watermark/embed/stages/embedder.hpp"
#include "compmark/watermark/embed/stages/frequency.hpp"
#include "compmark/watermark/embed/stages/hsv.hpp"
#include "compmark/watermark/embed/stages/message.hpp"

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
using NamedStage = typename StageOfPolicy<S, Policy, present<Policy> && complete>::type;
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

template <class R>
struct StagesOfRecipe {
  using type = JoinStages<
      detail::NamedStage<ExposureStage, typename R::Exposure, Exposure<typename R::Exposure>>,
      detail::NamedStage<PixelWeightsStage, typename R::PixelWeights, PixelWeights<typename R::PixelWeights>>,
      detail::NamedStage<BackgroundStage, typename R::Background, Background<typename R::Background>>,
      detail::NamedStage<AlphaLossStage, typename R::AlphaLoss, AlphaLoss<typename R::AlphaLoss>>,
      detail::NamedStage<EmbedderStage, typename R::Embedder, Embedder<typename R::Embedder>>,
      detail::NamedStage<MessageStage, typename R::MessageDecoder, MessageDecoder<typename R::MessageDecoder>>,
      detail::NamedStage<HsvStage, typename R::HsvLoss, ImageLoss<typename R::HsvLoss>>,
      detail::NamedStage<FrequencyStage, typename R::FrequencyLoss, ImageLoss<typename R::FrequencyLoss>>,
      detail::NamedStage<DistortionStage, RecipeDistortion<R>, DistortionLayer<RecipeDistortion<R>>>,
      detail::NamedStage<RateStage, RecipeEntropyModel<R>, EntropyModel<RecipeEntropyModel<R>>>,
      typename detail::OwnStages<R>::type>;
};

}  // namespace compmark
