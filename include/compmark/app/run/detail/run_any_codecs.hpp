// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs of every shipped recipe that trains for compression, by name.
#pragma once

#include <string>
#include <string_view>

#include "compmark/app/recipe_list.hpp"
#include "compmark/app/run/detail/run_any.hpp"
#include "compmark/app/run/detail/run_recipe.hpp"
#include "compmark/recipes/marked_codecs.hpp"

namespace compmark::detail {

/// A run of a recipe for compression, with a message or without.
template <class R>
Result<RunOutcome> run_coded(const RunPlan& plan, const TrainSettings& settings, const RunMark* mark) {
  if (mark == nullptr || mark->read_only) return run_recipe<R>(plan, settings, mark);
  if constexpr (present<typename R::Exposure>) {
    return no_message_in(plan.recipe);
  } else {
    if (!is_published_profile(settings.profile))
      return run_recipe<recipes::WithLostAnchors<recipes::Marked<R, MarkingDecoder>>>(plan, settings, mark);
    // The published captures have no effects, and each recipe is ten seconds of a compiler.
    if constexpr (present<typename R::AlphaLoss> || present<typename R::PixelWeights> || requires { R::is_fitted; }) {
      return Error{ErrorKind::unsupported,
                   {},
                   "--profile",
                   "\"" + settings.profile + "\" marks hac and context_gs only, not " + plan.recipe,
                   "leave out --recipe, or --profile"};
    } else {
      return run_recipe<recipes::WithFrequency<recipes::Marked<R, MarkingDecoder>>>(plan, settings, mark);
    }
  }
}

COMPMARK_APP_INLINE Result<RunOutcome> run_any_coded(const RunPlan& plan, const TrainSettings& settings,
                                                     const RunMark* mark) {
  const OrError run(
      [&](auto tag) -> Result<RunOutcome> { return run_coded<typename decltype(tag)::Recipe>(plan, settings, mark); });
  return recipe_codec(plan.recipe) == std::string_view("context_gs") ? with_context_gs_recipe(plan.recipe, run)
                                                                     : with_hac_recipe(plan.recipe, run);
}

}  // namespace compmark::detail
