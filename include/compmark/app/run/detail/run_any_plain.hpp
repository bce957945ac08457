// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs of every shipped recipe without a codec and without a mark, by name.
#pragma once

#include "compmark/app/recipe_list.hpp"
#include "compmark/app/run/detail/run_any.hpp"
#include "compmark/app/run/detail/run_recipe.hpp"

namespace compmark::detail {

COMPMARK_APP_INLINE Result<RunOutcome> run_any_plain(const RunPlan& plan, const TrainSettings& settings) {
  return with_recipe(plan.recipe, OrError([&](auto tag) -> Result<RunOutcome> {
                       return run_recipe<typename decltype(tag)::Recipe>(plan, settings);
                     }));
}

}  // namespace compmark::detail
