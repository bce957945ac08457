// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Whether a mark can be hidden in a finished model, and what it may look at; asked before hours of work.
#pragma once

#include <string>

#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/app/spread.hpp"
#include "compmark/core/result.hpp"

namespace compmark::detail {

/// An error if the spread mark that plan.mark asks for cannot be hidden in a model of plan.recipe.
[[nodiscard]] inline Result<Done> can_spread(const RunPlan& plan) {
  if (!plan.mark.spread) return Done{};
  if (plan.recipe == "explicit") {
    return Error{
        ErrorKind::unsupported, plan.model.string(), "--spread",
        "is for models whose anchors have features, and splats of other programs have none",
        "hide the spread mark first, with compmark spread --out OUT, and then the message, with compmark embed "
        "--model OUT --data " +
            plan.data.string()};
  }
  return check_spread_psnr(*plan.mark.spread, "--spread");
}

/// Whether a mark in a finished model can be held to its photographs too. There are none of a splat file; renders do not
/// have their exposures; and what does not count in them has to be known to the recipe that marks it.
[[nodiscard]] inline bool sees_photographs(const std::string& recipe) {
  const auto names = [&](const char* part) { return recipe.find(part) != std::string::npos; };
  if (recipe == "explicit" || names("+exposure")) return false;
  return is_coded_recipe(recipe) || marks_while_training(recipe) || !(names("+mask") || names("+alpha"));
}

/// An error if plan.mark cannot be hidden in a finished model of plan.recipe; asked before hours of work.
[[nodiscard]] inline Result<Done> can_mark_finished(const RunPlan& plan) {
  const bool coded = is_coded_recipe(plan.recipe);
  // In the loss of the photographs their exposures would have to train on.
  const bool trains = plan.mark.fidelity && *plan.mark.fidelity == 0;
  if (!is_markable_recipe(plan.recipe) || (trains && !coded && !marks_while_training(plan.recipe)))
    return no_message_in(plan.recipe);
  if (plan.mark.decoder.empty() && plan.mark.universal.empty() && !is_fittable_recipe(plan.recipe)) {
    return Error{ErrorKind::unsupported,
                 {},
                 "--decoder",
                 "is fit, but no decoder is fitted to a model of " + plan.recipe,
                 "leave --decoder out: the decoder of the program reads every scene"};
  }
  if (plan.mark.photographs && *plan.mark.photographs > 0 && !sees_photographs(plan.recipe)) {
    return Error{
        ErrorKind::unsupported,
        {},
        "--photographs",
        "is above 0, but no mark in a model of " + plan.recipe +
            " is held to photographs: it has none, or they have exposures or parts that do not count, which the "
            "mark knows nothing of",
        "leave the option out"};
  }
  if (Result<Done> can = can_spread(plan); !can) return can.error();
  if (plan.mark.calibrate_steps && recipe_codec(plan.recipe) != std::string_view("context_gs")) {
    return Error{ErrorKind::unsupported,
                 {},
                 "--calibrate-steps",
                 "works with context_gs models only: in them a mark would change the quantizer steps",
                 "leave it out"};
  }
  if (!coded || !plan.mark.fidelity || *plan.mark.fidelity > 0) return Done{};
  return Error{ErrorKind::unsupported,
               {},
               "--fidelity",
               "is 0, but a model for a codec can only be marked post hoc, with its unmarked renders"
               " as the target",
               "leave the option out, or hide the message while training: compmark train --codec "
               "--key --decoder"};
}

}  // namespace compmark::detail
