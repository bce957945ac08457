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
#include <string>
#include <string_view>

#include "common.hpp"

namespace tool {

template <class R>
struct Tag {
  using Recipe = R;
};
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
  return f.unknown(compmark::Error{
      compmark::ErrorKind::invalid,
      {},
      "recipe",
      "unknown recipe \"" + std::string(name) + "\"",
      "this tool knows scaffold, scaffold with +mask, +alpha, +antialiasing, +antialiasing+mask, +alpha+antialiasing, "
      "+lens, +fisheye, +exposure, +exposure+mask, +farfield or +exposure+farfield, compmark-host and "
      "compmark-paper-host"});
}

/// Recipes that train for compression, which are the ones a .cmk holds; `f` as above.
template <class F>
auto with_hac_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::HacScaffold>{})) {
  if (name == "hac") return f(Tag<compmark::recipes::HacScaffold>{});
  if (name == "hac+mask") return f(Tag<compmark::recipes::HacMasked>{});
  if (name == "hac+alpha") return f(Tag<compmark::recipes::HacAlpha>{});
  if (name == "hac+exposure") return f(Tag<compmark::recipes::HacExposure>{});
  return f.unknown(
      compmark::Error{compmark::ErrorKind::invalid,
                      {},
                      "recipe",
                      "\"" + std::string(name) + "\" is not trained for compression",
                      "this tool compresses hac and context_gs, alone or with +mask, +alpha or +exposure"});
}
template <class F>
auto with_context_gs_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::ContextGsScaffold>{})) {
  if (name == "context_gs") return f(Tag<compmark::recipes::ContextGsScaffold>{});
  if (name == "context_gs+mask") return f(Tag<compmark::recipes::ContextGsMasked>{});
  if (name == "context_gs+alpha") return f(Tag<compmark::recipes::ContextGsAlpha>{});
  if (name == "context_gs+exposure") return f(Tag<compmark::recipes::ContextGsExposure>{});
  return f.unknown(
      compmark::Error{compmark::ErrorKind::invalid,
                      {},
                      "recipe",
                      "\"" + std::string(name) + "\" is not trained for compression",
                      "this tool compresses hac and context_gs, alone or with +mask, +alpha or +exposure"});
}
/// The codec that a recipe trains for; "none" for the others.
inline const char* recipe_codec(std::string_view name) {
  const std::string_view head = name.substr(0, name.find('+'));
  return head == "hac" ? "hac" : head == "context_gs" ? "context_gs" : "none";
}
inline bool is_coded_recipe(std::string_view name) { return std::string_view(recipe_codec(name)) != "none"; }
template <class F>
auto with_coded_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::HacScaffold>{})) {
  return recipe_codec(name) == std::string_view("context_gs") ? with_context_gs_recipe(name, f)
                                                              : with_hac_recipe(name, f);
}
/// Any list.
template <class F>
auto with_any_recipe(std::string_view name, F&& f) -> decltype(f(Tag<compmark::recipes::Scaffold>{})) {
  return is_coded_recipe(name) ? with_coded_recipe(name, f) : with_recipe(name, f);
}

/// A generic lambda and what to return for a name that is in no list.
template <class F>
struct ExitCode : F {
  explicit ExitCode(F f) : F(f) {}
  using F::operator();
  [[nodiscard]] int unknown(const compmark::Error& error) const { return fail(error); }
};

}  // namespace tool
