// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/run/effect_choice.hpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/app/run/effect_choice.hpp"

namespace compmark {
namespace detail {

inline bool has_effect(const std::vector<std::string>& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// A recipe and what it simulates beyond the plain one.
struct EffectRecipe {
  const char* recipe;
  std::vector<std::string> effects;
};
inline const std::array<EffectRecipe, 12>& effect_recipes() {
  static const std::array<EffectRecipe, 12> recipes{{{"scaffold", {}},
                                                     {"scaffold+mask", {"masks"}},
                                                     {"scaffold+alpha", {"alpha"}},
                                                     {"scaffold+exposure+mask", {"exposure", "masks"}},
                                                     {"scaffold+antialiasing+mask", {"anti_aliasing", "masks"}},
                                                     {"scaffold+alpha+antialiasing", {"alpha", "anti_aliasing"}},
                                                     {"scaffold+exposure+farfield", {"exposure", "far_field"}},
                                                     {"scaffold+exposure", {"exposure"}},
                                                     {"scaffold+farfield", {"far_field"}},
                                                     {"scaffold+antialiasing", {"anti_aliasing"}},
                                                     {"scaffold+lens", {"lens_distortion"}},
                                                     {"scaffold+fisheye", {"fisheye"}}}};
  return recipes;
}

}  // namespace detail

COMPMARK_APP_INLINE EffectChoice choose_recipe(const std::vector<std::string>& effects, LensTreatment lens) {
  EffectChoice choice;
  std::vector<std::string> needed;  // of a recipe
  for (const std::string& effect : effects) {
    if (effect == "principal_point" || effect == "constant_background") {
      choice.simulated.push_back(effect);  // every camera and every render has one: no recipe needed
    } else if (effect == "forward_facing") {
      continue;  // says how far the cameras' rays reach, nothing that a render would have to do
    } else if (effect == "lens_distortion" || effect == "fisheye") {
      if (lens == LensTreatment::ignore) continue;
      if (lens == LensTreatment::keep) {  // a matter of the projection, and nothing is left empty
        if (!detail::has_effect(needed, effect)) needed.push_back(effect);
        continue;
      }
      choice.simulated.push_back(effect);  // taken out on load, which leaves borders that must not count
      if (!detail::has_effect(needed, "masks")) needed.emplace_back("masks");
    } else if (!detail::has_effect(needed, effect)) {
      needed.push_back(effect);
    }
  }
  const auto lens_effect = [](const std::string& name) { return name == "lens_distortion" || name == "fisheye"; };
  const bool lens_needed = std::any_of(needed.begin(), needed.end(), lens_effect);
  const detail::EffectRecipe* best = &detail::effect_recipes().front();
  for (const detail::EffectRecipe& recipe : detail::effect_recipes()) {
    const bool fits = std::all_of(recipe.effects.begin(), recipe.effects.end(),
                                  [&](const std::string& effect) { return detail::has_effect(needed, effect); });
    const bool projects = std::any_of(recipe.effects.begin(), recipe.effects.end(), lens_effect);
    if (!fits || projects != lens_needed) continue;
    if (recipe.effects.size() > best->effects.size()) best = &recipe;
  }
  choice.recipe = best->recipe;
  for (const std::string& effect : needed) {
    (detail::has_effect(best->effects, effect) ? choice.simulated : choice.left_out).push_back(effect);
  }
  return choice;
}

COMPMARK_APP_INLINE Result<std::vector<std::string>> wanted_effects(const std::string& option,
                                                                    const std::vector<ProbedEffect>& probed) {
  std::vector<std::string> effects;
  if (option == "none") return effects;
  if (option == "auto") {
    for (const ProbedEffect& effect : probed) effects.emplace_back(effect_name(effect.effect));
    return effects;
  }
  for (std::size_t begin = 0; begin <= option.size();) {
    const std::size_t end = std::min(option.find(',', begin), option.size());
    const std::string name = option.substr(begin, end - begin);
    bool known = false;
    for (int e = 0; e <= static_cast<int>(SceneEffect::masks); ++e)
      known = known || name == effect_name(static_cast<SceneEffect>(e));
    if (!known) {
      return Error{ErrorKind::invalid,
                   {},
                   "--effects",
                   "unknown effect \"" + name + "\"",
                   "give auto, none, or names that \"compmark probe\" prints, separated by commas"};
    }
    effects.push_back(name);
    begin = end + 1;
  }
  return effects;
}

}  // namespace compmark
