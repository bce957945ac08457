// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A run of a recipe that trains for compression.
#pragma once

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

}  // namespace compmark::detail
