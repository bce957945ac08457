// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs of every shipped recipe for HAC by name.
#pragma once

#include "compmark/app/recipe_list.hpp"
#include "compmark/app/run/detail/run_any.hpp"
#include "compmark/app/run/detail/run_coded.hpp"

namespace compmark::detail {

COMPMARK_APP_INLINE Result<RunOutcome> run_any_hac(const RunPlan& plan, const TrainSettings& settings,
                                                   const RunMark* mark) {
  return with_hac_recipe(plan.recipe, OrError([&](auto tag) -> Result<RunOutcome> {
                           return run_coded<typename decltype(tag)::Recipe>(plan, settings, mark);
                         }));
}

}  // namespace compmark::detail
