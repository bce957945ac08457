// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Information in the names of recipes: the codec that a recipe trains for, and the recipes that read or mark its
// finished models. Text alone: the types are in recipe_list.hpp.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace compmark {

/// The codec that a recipe trains for; "none" for the others.
inline const char* recipe_codec(std::string_view name) {
  const std::string_view head = name.substr(0, name.find('+'));
  return head == "hac" ? "hac" : head == "context_gs" ? "context_gs" : "none";
}
/// The codec whose stages a model trains for: HAC-plus codes what was trained for HAC.
inline std::string trained_codec(const std::string& codec) { return codec == "hac_plus" ? "hac" : codec; }
inline bool is_coded_recipe(std::string_view name) { return std::string_view(recipe_codec(name)) != "none"; }
/// A recipe's name without these effects.
inline std::string without_effects(std::string name, std::initializer_list<std::string_view> effects) {
  for (const std::string_view effect : effects) {
    if (const std::size_t at = name.find(effect); at != std::string::npos) name.erase(at, effect.size());
  }
  return name;
}
/// The recipe that renders a trained model of another recipe: masks and the loss on alpha belong to the training, the
/// far field's cells to the growing, and they leave nothing in a model. Its ModelInfo keeps the name.
inline std::string reading_recipe(std::string name) {
  return without_effects(std::move(name), {"+mask", "+alpha", "+farfield"});
}
/// The recipe that marks a finished model of another recipe. It leaves out the exposures of photographs: the mark is in
/// renders, and renders have no exposure.
inline std::string marking_recipe(std::string name) { return without_effects(std::move(name), {"+exposure"}); }
/// Whether fit-codec can fit a codec to a finished model of this recipe.
inline bool can_be_fitted(std::string_view name) {
  return marking_recipe(reading_recipe(std::string(name))) == "scaffold";
}
/// Whether a decoder can be fitted to a finished model of this recipe.
inline bool is_fittable_recipe(std::string_view name) {
  const std::string plain = marking_recipe(reading_recipe(std::string(name)));
  const std::string codec = recipe_codec(name);
  return codec == "none" ? plain == "scaffold" || plain == "explicit" : plain == codec || plain == codec + "+fitted";
}
/// Whether a message can be hidden in a finished model of this recipe, with a decoder that is there.
inline bool is_markable_recipe(std::string_view name) {
  const std::string plain = marking_recipe(reading_recipe(std::string(name)));
  return is_fittable_recipe(name) || plain == "scaffold+antialiasing" || plain == "scaffold+lens" ||
         plain == "scaffold+fisheye";
}
/// Whether a message can train together with a scene of this recipe.
inline bool marks_while_training(std::string_view name) {
  return name == "scaffold" || name == "scaffold+mask" || name == "scaffold+alpha";
}
/// True for the recipes that project through a lens.
inline bool projects_lens(std::string_view recipe) {
  return recipe.find("+lens") != std::string_view::npos || recipe.find("+fisheye") != std::string_view::npos;
}

}  // namespace compmark
