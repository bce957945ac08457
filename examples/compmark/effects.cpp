// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "effects.hpp"

#include <algorithm>
#include <array>
#include <string_view>

namespace tool {
namespace {

using namespace compmark;
using Names = std::vector<std::string>;

bool has(const Names& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// A recipe and what it simulates beyond the plain one.
struct Listed {
  const char* recipe;
  Names effects;
};
const std::array<Listed, 6>& list() {
  static const std::array<Listed, 6> recipes{{{"scaffold", {}},
                                              {"scaffold+mask", {"masks"}},
                                              {"scaffold+alpha", {"alpha"}},
                                              {"scaffold+exposure+mask", {"exposure", "masks"}},
                                              {"scaffold+exposure", {"exposure"}},
                                              {"scaffold+antialiasing", {"anti_aliasing"}}}};
  return recipes;
}

}  // namespace

EffectChoice choose_recipe(const Names& effects, LensTreatment lens) {
  EffectChoice choice;
  Names needed;  // of a recipe
  for (const std::string& effect : effects) {
    if (effect == "principal_point") {
      choice.simulated.push_back(effect);  // every camera has one: no recipe needed
    } else if (effect == "lens_distortion" || effect == "fisheye") {
      if (lens == LensTreatment::ignore) continue;
      choice.simulated.push_back(effect);  // taken out on load, which leaves borders that must not count
      if (!has(needed, "masks")) needed.emplace_back("masks");
    } else if (!has(needed, effect)) {
      needed.push_back(effect);
    }
  }
  const Listed* best = &list().front();
  for (const Listed& recipe : list()) {
    const bool fits = std::all_of(recipe.effects.begin(), recipe.effects.end(),
                                  [&](const std::string& effect) { return has(needed, effect); });
    if (fits && recipe.effects.size() > best->effects.size()) best = &recipe;
  }
  choice.recipe = best->recipe;
  for (const std::string& effect : needed) {
    (has(best->effects, effect) ? choice.simulated : choice.left_out).push_back(effect);
  }
  return choice;
}

DatasetSettings settings_of(const ModelInfo& info) {
  DatasetSettings settings;
  if (has(info.effects, lens_ignored)) settings.lens = LensTreatment::ignore;
  return settings;
}

Result<Names> wanted_effects(const std::string& option, const std::vector<ProbedEffect>& probed) {
  Names effects;
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
                   "give auto, none, or names that \"compmark probe\" prints, with commas"};
    }
    effects.push_back(name);
    begin = end + 1;
  }
  return effects;
}

}  // namespace tool
