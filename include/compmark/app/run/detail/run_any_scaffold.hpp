// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs of every shipped recipe without a codec, plain and with a message, by name.
#pragma once

#include "compmark/app/recipe_list.hpp"
#include "compmark/app/run/detail/run_any.hpp"
#include "compmark/app/run/detail/run_recipe.hpp"
#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/explicit.hpp"
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/recipes/scaffold.hpp"

namespace compmark::detail {

COMPMARK_APP_INLINE Result<RunOutcome> run_any_plain(const RunPlan& plan, const TrainSettings& settings) {
  return with_recipe(plan.recipe, OrError([&](auto tag) -> Result<RunOutcome> {
                       return run_recipe<typename decltype(tag)::Recipe>(plan, settings);
                     }));
}

COMPMARK_APP_INLINE Result<RunOutcome> run_any_marked(const RunPlan& plan, const TrainSettings& settings,
                                                      const RunMark& mark) {
  using recipes::Marked, recipes::WithLostAnchors, recipes::FinishedOnly;
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
  // Finished models of the others are marked as what they are read as.
  const std::string plain = marking_recipe(reading_recipe(plan.recipe));
  if (plain == "scaffold")
    return run_recipe<FinishedOnly<WithLostAnchors<Marked<recipes::Scaffold, MarkingDecoder>>>>(plan, settings, &mark);
  if (plain == "scaffold+antialiasing")
    return run_recipe<FinishedOnly<WithLostAnchors<Marked<recipes::ScaffoldAntiAliased, MarkingDecoder>>>>(
        plan, settings, &mark);
  if (plain == "scaffold+lens")
    return run_recipe<FinishedOnly<WithLostAnchors<Marked<recipes::ScaffoldLens, MarkingDecoder>>>>(plan, settings,
                                                                                                    &mark);
  if (plain == "scaffold+fisheye")
    return run_recipe<FinishedOnly<WithLostAnchors<Marked<recipes::ScaffoldFisheye, MarkingDecoder>>>>(plan, settings,
                                                                                                       &mark);
  return no_message_in(plan.recipe);
}

}  // namespace compmark::detail
