// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A message that is hidden by a baseline's method (docs/baselines.md): what it refuses, its numbers, and its run.
#pragma once

#include <array>
#include <string>
#include <utility>

#include "compmark/app/run/detail/run_mark.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/app/run/detail/run_recipe.hpp"
#include "compmark/app/run/embed_method.hpp"
#include "compmark/recipes/scaffold.hpp"
#include "compmark/watermark/baselines/gaussianmarker.hpp"
#include "compmark/watermark/baselines/guardsplat.hpp"
#include "compmark/watermark/baselines/threedgsw.hpp"
#include "compmark/watermark/baselines/waterf.hpp"
#include "compmark/watermark/edit/edit_chain.hpp"

namespace compmark::detail {

/// Whether a run hides its message by a baseline's method.
[[nodiscard]] inline bool by_baseline(const RunPlan& plan) {
  return plan.method && *plan.method != EmbedMethod::compmark;
}

/// An error if plan.mark has options that the baseline has no use for, or the model is one that it does not mark.
[[nodiscard]] inline Result<Done> can_mark_by_baseline(const RunPlan& plan, bool rounds) {
  const std::string method(name_of(*plan.method));
  const MarkSettings& mark = plan.mark;
  const std::array<std::pair<bool, const char*>, 12> others{{{mark.fidelity.has_value(), "--fidelity"},
                                                             {mark.fall.has_value(), "--fidelity-fall"},
                                                             {mark.by_cost.has_value(), "--sample-by-loss"},
                                                             {mark.orbit.has_value(), "--orbit"},
                                                             {mark.lost_anchors.has_value(), "--lost-anchors"},
                                                             {mark.spread.has_value(), "--spread"},
                                                             {mark.margin.has_value(), "--message-margin"},
                                                             {mark.power.has_value(), "--message-power"},
                                                             {mark.calibrate_steps.has_value(), "--calibrate-steps"},
                                                             {mark.step_rate.has_value(), "--step-rate"},
                                                             {mark.for_compression, "--for-compression"},
                                                             {!rounds, "--distortion"}}};
  for (const auto& [given, option] : others) {
    if (!given) continue;
    return Error{ErrorKind::unsupported,
                 {},
                 option,
                 "belongs to the method compmark, and --method is " + method,
                 "leave the option out, or give --method compmark"};
  }
  if (plan.recipe == "scaffold") return Done{};
  return Error{ErrorKind::unsupported, plan.model.string(), "--method",
               "is " + method + ", which marks models of the recipe scaffold, and this one is of " + plan.recipe,
               "train the model with --recipe scaffold, or give --method compmark"};
}

[[nodiscard]] inline MarkNumbers baseline_mark(EmbedMethod method) {
  switch (method) {
    case EmbedMethod::waterf:
      return waterf_mark();
    case EmbedMethod::gaussianmarker:
      return gaussianmarker_mark();
    case EmbedMethod::threedgsw:
      return threedgsw_mark();
    default:
      return guardsplat_mark();
  }
}

/// Hides `mark` in plan.model. `settings` are those of a mark in the loss of photographs: everything trains on.
[[nodiscard]] inline Result<RunOutcome> run_baseline(const RunPlan& plan, const TrainSettings& settings,
                                                     const RunMark& mark) {
  using LowBandDecoder = EditedDecoder<WaveletDecoder<FileDecoder>, CommonEdits>;
  using Host = recipes::Scaffold;
  switch (*plan.method) {
    case EmbedMethod::waterf:
      return run_recipe<recipes::Waterf<Host, LowBandDecoder>>(plan, waterf_settings(settings), &mark);
    case EmbedMethod::gaussianmarker:
      return run_recipe<recipes::GaussianMarker<Host, MarkingDecoder>>(plan, gaussianmarker_settings(settings), &mark);
    case EmbedMethod::threedgsw:
      return run_recipe<recipes::ThreeDGsw<Host, LowBandDecoder>>(plan, threedgsw_settings(settings), &mark);
    default:
      return run_recipe<recipes::GuardSplat<Host, MarkingDecoder>>(plan, guardsplat_settings(settings), &mark);
  }
}

}  // namespace compmark::detail
