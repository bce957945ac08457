// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs of every shipped recipe by name: plain, for a codec, and with a message. Each loop of a training is seconds of a
// compiler, so that compmark::app_run has these functions in files of their own (compmark/app/run/app_run*.cpp).
#pragma once

#include <string_view>

#include "compmark/app/compiled.hpp"
#include "compmark/app/recipe_names.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

struct TrainSettings;

namespace detail {

/// Whether a profile is one of the published method, whose mark trains with the scene.
[[nodiscard]] inline bool is_published_profile(std::string_view profile) {
  return profile == "official" || profile == "paper";
}

/// A recipe that trains for one of the two codecs; writes the compressed file too. `mark` may be null.
[[nodiscard]] Result<RunOutcome> run_any_hac(const RunPlan& plan, const TrainSettings& settings, const RunMark* mark);
[[nodiscard]] Result<RunOutcome> run_any_context_gs(const RunPlan& plan, const TrainSettings& settings,
                                                    const RunMark* mark);
/// … for the one that the recipe's name says.
[[nodiscard]] inline Result<RunOutcome> run_any_coded(const RunPlan& plan, const TrainSettings& settings,
                                                      const RunMark* mark) {
  return recipe_codec(plan.recipe) == std::string_view("context_gs") ? run_any_context_gs(plan, settings, mark)
                                                                     : run_any_hac(plan, settings, mark);
}

/// A recipe without a codec, and without a mark.
[[nodiscard]] Result<RunOutcome> run_any_plain(const RunPlan& plan, const TrainSettings& settings);

/// A recipe without a codec, with a mark: one that trains with the scene, or that is hidden in plan.model.
[[nodiscard]] Result<RunOutcome> run_any_marked(const RunPlan& plan, const TrainSettings& settings,
                                                const RunMark& mark);

}  // namespace detail
}  // namespace compmark
