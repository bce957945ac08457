// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stages of a recipe, in the order in which they are called: those of the policies that it names, and after them its own, if it has a list
// `Stages`. To add a stage of one's own, that list is all: `struct Mine : recipes::Scaffold { using Stages = StageList<MyStage>; };`.
// Cost: none.
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
template <template <class...> class S, class Policy>
struct StageOfPolicy {
  using type = StageList<>;
};
template <template <class...> class S, class Policy>
  requires present<Policy>
struct StageOfPolicy<S, Policy> {
  using type = StageList<S<Policy>>;
};
template <template <class...> class S, class Policy>
using StagesOf = typename StageOfPolicy<S, Policy>::type;

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
using RecipeStages = JoinStages<
    detail::StagesOf<ExposureStage, typename R::Exposure>,
    detail::StagesOf<PixelWeightsStage, typename R::PixelWeights>,
    detail::StagesOf<BackgroundStage, typename R::Background>, detail::StagesOf<AlphaLossStage, typename R::AlphaLoss>,
    detail::StagesOf<EmbedderStage, typename R::Embedder>, detail::StagesOf<MessageStage, typename R::MessageDecoder>,
    detail::StagesOf<HsvStage, typename R::HsvLoss>, detail::StagesOf<FrequencyStage, typename R::FrequencyLoss>,
    detail::StagesOf<DistortionStage, RecipeDistortion<R>>,
    detail::StagesOf<RateStage, typename R::EntropyModel>, typename detail::OwnStages<R>::type>;

}  // namespace compmark
