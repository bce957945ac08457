// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs of every shipped recipe by name: plain, for a codec, and with a message.
#pragma once

#include <string>
#include <string_view>

#include "compmark/app/recipe_list.hpp"
#include "compmark/app/run/detail/run_recipe.hpp"
#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/explicit.hpp"
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/recipes/scaffold.hpp"

namespace compmark::detail {

/// Whether a profile is one of the published method, whose mark trains with the scene.
[[nodiscard]] inline bool is_published_profile(std::string_view profile) {
  return profile == "official" || profile == "paper";
}

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

/// A recipe that trains for a codec; writes the compressed file too. `mark` may be null.
[[nodiscard]] inline Result<RunOutcome> run_any_coded(const RunPlan& plan, const TrainSettings& settings,
                                                      const RunMark* mark) {
  const OrError run(
      [&](auto tag) -> Result<RunOutcome> { return run_coded<typename decltype(tag)::Recipe>(plan, settings, mark); });
  return recipe_codec(plan.recipe) == std::string_view("context_gs") ? with_context_gs_recipe(plan.recipe, run)
                                                                     : with_hac_recipe(plan.recipe, run);
}

/// A recipe without a codec, and without a mark.
[[nodiscard]] inline Result<RunOutcome> run_any_plain(const RunPlan& plan, const TrainSettings& settings) {
  return with_recipe(plan.recipe, OrError([&](auto tag) -> Result<RunOutcome> {
                       return run_recipe<typename decltype(tag)::Recipe>(plan, settings);
                     }));
}

/// A recipe without a codec, with a mark: one that trains with the scene, or that is hidden in plan.model.
[[nodiscard]] inline Result<RunOutcome> run_any_marked(const RunPlan& plan, const TrainSettings& settings,
                                                       const RunMark& mark) {
  using recipes::Marked, recipes::WithLostAnchors;
  if (plan.recipe == "scaffold") {
    if (mark.for_compression)
      return run_recipe<recipes::MarkedForCompression<recipes::Scaffold, MarkingDecoder>>(plan, settings, &mark);
    return run_recipe<WithLostAnchors<Marked<recipes::Scaffold, MarkingDecoder>>>(plan, settings, &mark);
  }
  if (plan.recipe == "explicit" && !mark.for_compression)
    return run_recipe<WithLostAnchors<Marked<recipes::Explicit, MarkingDecoder>>>(plan, settings, &mark);
  // The whole published method, which has the noise of quantization in it.
  if (plan.recipe == "compmark-host")
    return run_recipe<recipes::CompMarkGs<recipes::CompMarkBase, MarkingDecoder>>(plan, settings, &mark);
  if (plan.recipe == "compmark-paper-host")
    return run_recipe<recipes::CompMarkGsPaper<MarkingDecoder>>(plan, settings, &mark);
  if (mark.for_compression) {
    return Error{ErrorKind::unsupported,
                 {},
                 "--for-compression",
                 "works with the recipe scaffold only",
                 "leave the option out, or choose --recipe scaffold"};
  }
  if (plan.recipe == "scaffold+mask")
    return run_recipe<WithLostAnchors<Marked<recipes::ScaffoldMasked, MarkingDecoder>>>(plan, settings, &mark);
  if (plan.recipe == "scaffold+alpha")
    return run_recipe<WithLostAnchors<Marked<recipes::ScaffoldAlpha, MarkingDecoder>>>(plan, settings, &mark);
  return no_message_in(plan.recipe);
}

}  // namespace compmark::detail
