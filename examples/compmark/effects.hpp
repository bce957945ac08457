// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Chooses the recipe of the tool's closed list that models the effects of a capture.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/scene/dataset.hpp>
#include <compmark/scene/probe.hpp>
#include <string>
#include <vector>

namespace tool {

struct EffectChoice {
  std::string recipe;
  std::vector<std::string> simulated;  ///< effects that the recipe and the readers model
  std::vector<std::string> left_out;   ///< measured, but in no recipe of the list together with those
};

/// The recipe with the most of these effects and none besides (a principal point, a constant background and
/// forward-facing cameras need none); with LensTreatment::keep it is one that projects through the lens, if the effects
/// name one.
EffectChoice choose_recipe(const std::vector<std::string>& effects, compmark::LensTreatment lens);

/// Effects by name, from --effects ("auto": those that were measured, "none", or a list with commas).
compmark::Result<std::vector<std::string>> wanted_effects(const std::string& option,
                                                          const std::vector<compmark::ProbedEffect>& probed);

}  // namespace tool
