// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Access to the type inside an AnyModel: with_model calls a generic lambda with the Model<R>. The lambda is compiled
// for every recipe that a model is read as.
#pragma once

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/held_recipe.hpp"
#include "compmark/app/recipe_list.hpp"

namespace compmark {

/// f(Model<R>&), a generic lambda that returns a Result, on the model that is held.
template <class F>
[[nodiscard]] auto with_model(AnyModel& model, F&& f) {
  return with_reading_recipe(model.info().recipe, OrError([&](auto tag) {
                               using R = typename decltype(tag)::Recipe;
                               return f(static_cast<detail::RecipeModel<R>&>(detail::HeldAccess::held(model)).model());
                             }));
}

}  // namespace compmark
