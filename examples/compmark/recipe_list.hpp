// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The recipes that this tool is built with: the one place that maps their names to types. Include it only where the types are needed, since
// every stage of every recipe is compiled there.
#pragma once

#include <compmark/recipes/captures.hpp>
#include <compmark/recipes/context_gs.hpp>
#include <compmark/recipes/far_field.hpp>
#include <compmark/recipes/hac.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include "common.hpp"

namespace tool {

template <class R>
struct Tag {
  using Recipe = R;
};
/// The Error of a name that is in no list.
inline compmark::Error unknown_recipe(std::string_view name) {
  return {compmark::ErrorKind::invalid,
          {},
          "recipe",
          "unknown recipe \"" + std::string(name) + "\"",
          "this tool knows scaffold, scaffold with +mask, +alpha, +antialiasing, +antialiasing+mask, "
          "+alpha+antialiasing, +lens, +fisheye, +exposure, +exposure+mask, +farfield or +exposure+farfield, "
          "compmark-host, compmark-paper-host, and hac or context_gs, alone or with +mask, +alpha or +exposure"};
}
/// The Error of a name that is none of a recipe that trains for compression.
inline compmark::Error not_coded(std::string_view name) {
  return {
      compmark::ErrorKind::invalid,
      {},
      "recipe",
      "\"" + std::string(name) + "\" is not trained for compression",
      "this tool compresses hac and context_gs, alone or with +mask, +alpha or +exposure, and what fit-codec makes"};
}

template <class F>
auto with_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::Scaffold>{})) {
  if (name == "scaffold") return f(Tag<compmark::recipes::Scaffold>{});
  if (name == "scaffold+mask") return f(Tag<compmark::recipes::ScaffoldMasked>{});
  if (name == "scaffold+alpha") return f(Tag<compmark::recipes::ScaffoldAlpha>{});
  if (name == "scaffold+antialiasing") return f(Tag<compmark::recipes::ScaffoldAntiAliased>{});
  if (name == "scaffold+antialiasing+mask") return f(Tag<compmark::recipes::ScaffoldAntiAliasedMasked>{});
  if (name == "scaffold+alpha+antialiasing") return f(Tag<compmark::recipes::ScaffoldAlphaAntiAliased>{});
  if (name == "scaffold+lens") return f(Tag<compmark::recipes::ScaffoldLens>{});
  if (name == "scaffold+fisheye") return f(Tag<compmark::recipes::ScaffoldFisheye>{});
  if (name == "scaffold+exposure") return f(Tag<compmark::recipes::ScaffoldExposure>{});
  if (name == "scaffold+exposure+mask") return f(Tag<compmark::recipes::ScaffoldExposureMasked>{});
  if (name == "scaffold+farfield") return f(Tag<compmark::recipes::ScaffoldFarField>{});
  if (name == "scaffold+exposure+farfield") return f(Tag<compmark::recipes::ScaffoldFarFieldExposure>{});
  if (name == "compmark-host") return f(Tag<compmark::recipes::CompMarkHost>{});
  if (name == "compmark-paper-host") return f(Tag<compmark::recipes::CompMarkPaperHost>{});
  return f.unknown(unknown_recipe(name));
}

/// Recipes that train for compression, which are the ones a .cmk holds; `f` as above.
template <class F>
auto with_hac_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::HacScaffold>{})) {
  if (name == "hac") return f(Tag<compmark::recipes::HacScaffold>{});
  if (name == "hac+mask") return f(Tag<compmark::recipes::HacMasked>{});
  if (name == "hac+alpha") return f(Tag<compmark::recipes::HacAlpha>{});
  if (name == "hac+exposure") return f(Tag<compmark::recipes::HacExposure>{});
  if (name == "hac+fitted") return f(Tag<compmark::recipes::HacFitted>{});
  if (name == "hac+fitted+mask") return f(Tag<compmark::recipes::HacFittedMasked>{});
  if (name == "hac+fitted+exposure") return f(Tag<compmark::recipes::HacFittedExposure>{});
  return f.unknown(not_coded(name));
}
template <class F>
auto with_context_gs_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::ContextGsScaffold>{})) {
  if (name == "context_gs") return f(Tag<compmark::recipes::ContextGsScaffold>{});
  if (name == "context_gs+mask") return f(Tag<compmark::recipes::ContextGsMasked>{});
  if (name == "context_gs+alpha") return f(Tag<compmark::recipes::ContextGsAlpha>{});
  if (name == "context_gs+exposure") return f(Tag<compmark::recipes::ContextGsExposure>{});
  if (name == "context_gs+fitted") return f(Tag<compmark::recipes::ContextGsFitted>{});
  if (name == "context_gs+fitted+mask") return f(Tag<compmark::recipes::ContextGsFittedMasked>{});
  if (name == "context_gs+fitted+exposure") return f(Tag<compmark::recipes::ContextGsFittedExposure>{});
  return f.unknown(not_coded(name));
}
/// The codec that a recipe trains for; "none" for the others.
inline const char* recipe_codec(std::string_view name) {
  const std::string_view head = name.substr(0, name.find('+'));
  return head == "hac" ? "hac" : head == "context_gs" ? "context_gs" : "none";
}
inline bool is_coded_recipe(std::string_view name) { return std::string_view(recipe_codec(name)) != "none"; }
/// A recipe's name without these effects.
inline std::string without_effects(std::string name, std::initializer_list<std::string_view> effects) {
  for (const std::string_view effect : effects) {
    if (const std::size_t at = name.find(effect); at != std::string::npos) name.erase(at, effect.size());
  }
  return name;
}
/// The recipe that a trained model of another one is read as: masks and the loss on alpha are of training alone, and leave nothing in a
/// model. Its ModelInfo keeps the name.
inline std::string reading_recipe(std::string name) { return without_effects(std::move(name), {"+mask", "+alpha"}); }
/// The recipe that a finished model of another one is marked as: the exposures of the photographs are in no render, which is where a mark is.
inline std::string marking_recipe(std::string name) { return without_effects(std::move(name), {"+exposure"}); }
/// Whether a message can be hidden in a finished model of this recipe.
inline bool is_markable_recipe(std::string_view name) {
  const std::string plain = marking_recipe(reading_recipe(std::string(name)));
  const std::string codec = recipe_codec(name);
  return codec == "none" ? plain == "scaffold" : plain == codec || plain == codec + "+fitted";
}
/// For commands that only read models: `f` is compiled for every recipe that renders otherwise than the others.
template <class F>
auto with_coded_reading_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::HacScaffold>{})) {
  const std::string plain = reading_recipe(std::string(name));
  if (plain == "hac") return f(Tag<compmark::recipes::HacScaffold>{});
  if (plain == "hac+exposure") return f(Tag<compmark::recipes::HacExposure>{});
  if (plain == "hac+fitted") return f(Tag<compmark::recipes::HacFitted>{});
  if (plain == "hac+fitted+exposure") return f(Tag<compmark::recipes::HacFittedExposure>{});
  if (plain == "context_gs") return f(Tag<compmark::recipes::ContextGsScaffold>{});
  if (plain == "context_gs+exposure") return f(Tag<compmark::recipes::ContextGsExposure>{});
  if (plain == "context_gs+fitted") return f(Tag<compmark::recipes::ContextGsFitted>{});
  if (plain == "context_gs+fitted+exposure") return f(Tag<compmark::recipes::ContextGsFittedExposure>{});
  return f.unknown(not_coded(name));
}
template <class F>
auto with_reading_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::Scaffold>{})) {
  if (is_coded_recipe(name)) return with_coded_reading_recipe(name, f);
  const std::string plain = reading_recipe(std::string(name));
  if (plain == "scaffold") return f(Tag<compmark::recipes::Scaffold>{});
  if (plain == "scaffold+antialiasing") return f(Tag<compmark::recipes::ScaffoldAntiAliased>{});
  if (plain == "scaffold+lens") return f(Tag<compmark::recipes::ScaffoldLens>{});
  if (plain == "scaffold+fisheye") return f(Tag<compmark::recipes::ScaffoldFisheye>{});
  if (plain == "scaffold+exposure") return f(Tag<compmark::recipes::ScaffoldExposure>{});
  if (plain == "scaffold+farfield") return f(Tag<compmark::recipes::ScaffoldFarField>{});
  if (plain == "scaffold+exposure+farfield") return f(Tag<compmark::recipes::ScaffoldFarFieldExposure>{});
  if (plain == "compmark-host") return f(Tag<compmark::recipes::CompMarkHost>{});
  if (plain == "compmark-paper-host") return f(Tag<compmark::recipes::CompMarkPaperHost>{});
  return f.unknown(unknown_recipe(name));
}

/// A generic lambda and what to return for a name that is in no list.
template <class F>
struct ExitCode : F {
  explicit ExitCode(F f) : F(f) {}
  using F::operator();
  [[nodiscard]] int unknown(const compmark::Error& error) const { return fail(error); }
};

}  // namespace tool
