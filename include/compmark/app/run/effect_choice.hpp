// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the shipped recipe that models the effects of a capture.
#pragma once

#include <string>
#include <vector>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/probe.hpp"

namespace compmark {

/// What train_scene makes of the effects of a capture.
struct EffectChoice {
  std::string recipe;
  std::vector<std::string> simulated;  ///< effects that the recipe and the readers model
  std::vector<std::string> left_out;   ///< measured, but in no recipe of the list together with those
};

/// The recipe with the most of these effects and none besides (a principal point, a constant background and
/// forward-facing cameras need none); with LensTreatment::keep it is one that projects through the lens, if the effects
/// name one.
[[nodiscard]] EffectChoice choose_recipe(const std::vector<std::string>& effects, LensTreatment lens);

/// Effects by name, from a text ("auto": those that were measured, "none", or a list with commas).
[[nodiscard]] Result<std::vector<std::string>> wanted_effects(const std::string& option,
                                                              const std::vector<ProbedEffect>& probed);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/effect_choice.hpp"
#endif
