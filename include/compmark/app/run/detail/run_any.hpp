// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs of every shipped recipe by name: plain, for a codec, and with a message. Each loop of a training is seconds of a
// compiler, so that compmark::app_run has those for codecs in a file of their own (app_run_codecs.cpp).
#pragma once

#include <string_view>

#include "compmark/app/compiled.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

struct TrainSettings;

namespace detail {

/// Whether a profile is one of the published method, whose mark trains with the scene.
[[nodiscard]] inline bool is_published_profile(std::string_view profile) {
  return profile == "official" || profile == "paper";
}

/// A recipe that trains for a codec; writes the compressed file too. `mark` may be null.
[[nodiscard]] Result<RunOutcome> run_any_coded(const RunPlan& plan, const TrainSettings& settings, const RunMark* mark);

/// A recipe without a codec, and without a mark.
[[nodiscard]] Result<RunOutcome> run_any_plain(const RunPlan& plan, const TrainSettings& settings);

/// A recipe without a codec, with a mark: one that trains with the scene, or that is hidden in plan.model.
[[nodiscard]] Result<RunOutcome> run_any_marked(const RunPlan& plan, const TrainSettings& settings,
                                                const RunMark& mark);

}  // namespace detail
}  // namespace compmark
