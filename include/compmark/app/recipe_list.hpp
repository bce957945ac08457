// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The recipes that CompMark ships: the one place that maps their names to types. Include it only where the types are
// needed, since every stage of every recipe is compiled there.
#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "compmark/app/recipe_names.hpp"
#include "compmark/core/result.hpp"
#include "compmark/recipes/captures.hpp"
#include "compmark/recipes/context_gs.hpp"
#include "compmark/recipes/explicit.hpp"
#include "compmark/recipes/far_field.hpp"
#include "compmark/recipes/hac.hpp"
#include "compmark/recipes/scaffold.hpp"

namespace compmark {

template <class R>
struct RecipeTag {
  using Recipe = R;
};
/// The Error of a name that is in no list.
inline Error unknown_recipe(std::string_view name) {
  return {ErrorKind::invalid,
          {},
          "recipe",
          "unknown recipe \"" + std::string(name) + "\"",
          "this tool knows scaffold, scaffold with +mask, +alpha, +antialiasing, +antialiasing+mask, "
          "+alpha+antialiasing, +lens, +fisheye, +exposure, +exposure+mask, +farfield or +exposure+farfield, "
          "compmark-host, compmark-paper-host, and hac or context_gs, alone or with +mask, +alpha, +exposure or "
          "+exposure+mask"};
}
/// The Error of a name that is none of a recipe that trains for compression.
inline Error not_coded(std::string_view name) {
  return {ErrorKind::invalid,
          {},
          "recipe",
          "\"" + std::string(name) + "\" is not trained for compression",
          "this tool compresses hac and context_gs, alone or with +mask, +alpha, +exposure or +exposure+mask, and what "
          "fit-codec makes of scaffold, with +farfield too"};
}

template <class F>
auto with_recipe(std::string_view name, F&& f) -> decltype(f(RecipeTag<recipes::Scaffold>{})) {
  if (name == "scaffold") return f(RecipeTag<recipes::Scaffold>{});
  if (name == "scaffold+mask") return f(RecipeTag<recipes::ScaffoldMasked>{});
  if (name == "scaffold+alpha") return f(RecipeTag<recipes::ScaffoldAlpha>{});
  if (name == "scaffold+antialiasing") return f(RecipeTag<recipes::ScaffoldAntiAliased>{});
  if (name == "scaffold+antialiasing+mask") return f(RecipeTag<recipes::ScaffoldAntiAliasedMasked>{});
  if (name == "scaffold+alpha+antialiasing") return f(RecipeTag<recipes::ScaffoldAlphaAntiAliased>{});
  if (name == "scaffold+lens") return f(RecipeTag<recipes::ScaffoldLens>{});
  if (name == "scaffold+fisheye") return f(RecipeTag<recipes::ScaffoldFisheye>{});
  if (name == "scaffold+exposure") return f(RecipeTag<recipes::ScaffoldExposure>{});
  if (name == "scaffold+exposure+mask") return f(RecipeTag<recipes::ScaffoldExposureMasked>{});
  if (name == "scaffold+farfield") return f(RecipeTag<recipes::ScaffoldFarField>{});
  if (name == "scaffold+exposure+farfield") return f(RecipeTag<recipes::ScaffoldFarFieldExposure>{});
  if (name == "compmark-host") return f(RecipeTag<recipes::CompMarkBase>{});
  if (name == "compmark-paper-host") return f(RecipeTag<recipes::CompMarkPaperBase>{});
  return f.unknown(unknown_recipe(name));
}

/// Recipes that train for compression, which are the ones a .cmk holds; `f` as above.
template <class F>
auto with_hac_recipe(std::string_view name, F&& f) -> decltype(f(RecipeTag<recipes::HacScaffold>{})) {
  if (name == "hac") return f(RecipeTag<recipes::HacScaffold>{});
  if (name == "hac+mask") return f(RecipeTag<recipes::HacMasked>{});
  if (name == "hac+alpha") return f(RecipeTag<recipes::HacAlpha>{});
  if (name == "hac+exposure") return f(RecipeTag<recipes::HacExposure>{});
  if (name == "hac+exposure+mask") return f(RecipeTag<recipes::HacExposureMasked>{});
  if (name == "hac+fitted") return f(RecipeTag<recipes::HacFitted>{});
  if (name == "hac+fitted+mask") return f(RecipeTag<recipes::HacFittedMasked>{});
  if (name == "hac+fitted+exposure") return f(RecipeTag<recipes::HacFittedExposure>{});
  if (name == "hac+fitted+exposure+mask") return f(RecipeTag<recipes::HacFittedExposureMasked>{});
  return f.unknown(not_coded(name));
}
template <class F>
auto with_context_gs_recipe(std::string_view name, F&& f) -> decltype(f(RecipeTag<recipes::ContextGsScaffold>{})) {
  if (name == "context_gs") return f(RecipeTag<recipes::ContextGsScaffold>{});
  if (name == "context_gs+mask") return f(RecipeTag<recipes::ContextGsMasked>{});
  if (name == "context_gs+alpha") return f(RecipeTag<recipes::ContextGsAlpha>{});
  if (name == "context_gs+exposure") return f(RecipeTag<recipes::ContextGsExposure>{});
  if (name == "context_gs+exposure+mask") return f(RecipeTag<recipes::ContextGsExposureMasked>{});
  if (name == "context_gs+fitted") return f(RecipeTag<recipes::ContextGsFitted>{});
  if (name == "context_gs+fitted+mask") return f(RecipeTag<recipes::ContextGsFittedMasked>{});
  if (name == "context_gs+fitted+exposure") return f(RecipeTag<recipes::ContextGsFittedExposure>{});
  if (name == "context_gs+fitted+exposure+mask") return f(RecipeTag<recipes::ContextGsFittedExposureMasked>{});
  return f.unknown(not_coded(name));
}
/// For commands that only read models: `f` is compiled once for all recipes that render alike.
template <class F>
auto with_coded_reading_recipe(std::string_view name, F&& f) -> decltype(f(RecipeTag<recipes::HacScaffold>{})) {
  const std::string plain = reading_recipe(std::string(name));
  if (plain == "hac") return f(RecipeTag<recipes::HacScaffold>{});
  if (plain == "hac+exposure") return f(RecipeTag<recipes::HacExposure>{});
  if (plain == "hac+fitted") return f(RecipeTag<recipes::HacFitted>{});
  if (plain == "hac+fitted+exposure") return f(RecipeTag<recipes::HacFittedExposure>{});
  if (plain == "context_gs") return f(RecipeTag<recipes::ContextGsScaffold>{});
  if (plain == "context_gs+exposure") return f(RecipeTag<recipes::ContextGsExposure>{});
  if (plain == "context_gs+fitted") return f(RecipeTag<recipes::ContextGsFitted>{});
  if (plain == "context_gs+fitted+exposure") return f(RecipeTag<recipes::ContextGsFittedExposure>{});
  return f.unknown(not_coded(name));
}
template <class F>
auto with_reading_recipe(std::string_view name, F&& f) -> decltype(f(RecipeTag<recipes::Scaffold>{})) {
  if (is_coded_recipe(name)) return with_coded_reading_recipe(name, f);
  const std::string plain = reading_recipe(std::string(name));
  if (plain == "scaffold") return f(RecipeTag<recipes::Scaffold>{});
  if (plain == "scaffold+antialiasing") return f(RecipeTag<recipes::ScaffoldAntiAliased>{});
  if (plain == "scaffold+lens") return f(RecipeTag<recipes::ScaffoldLens>{});
  if (plain == "scaffold+fisheye") return f(RecipeTag<recipes::ScaffoldFisheye>{});
  if (plain == "scaffold+exposure") return f(RecipeTag<recipes::ScaffoldExposure>{});
  if (plain == "compmark-host") return f(RecipeTag<recipes::CompMarkBase>{});
  if (plain == "compmark-paper-host") return f(RecipeTag<recipes::CompMarkPaperBase>{});
  if (plain == "explicit") return f(RecipeTag<recipes::Explicit>{});  // what splat files are read as
  return f.unknown(unknown_recipe(name));
}

/// Calls a generic lambda that returns a Result; a name that is in no list gives an Error.
template <class F>
struct OrError : F {
  explicit OrError(F f) : F(f) {}
  using F::operator();
  [[nodiscard]] auto unknown(Error error) const {
    using Returned = decltype((*this)(RecipeTag<recipes::HacScaffold>{}));
    return Returned(std::move(error));
  }
};

}  // namespace compmark
