// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/any_model.hpp: the recipes are here.
#pragma once

#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "compmark/app/any_model.hpp"
#include "compmark/app/detail/held_recipe.hpp"
#include "compmark/app/detail/model_source.hpp"
#include "compmark/app/recipe_list.hpp"

namespace compmark {

COMPMARK_APP_INLINE Result<AnyModel> AnyModel::load(const ModelSource& source) {
  std::error_code status;
  const std::uintmax_t bytes = std::filesystem::file_size(source.path, status);
  Result<AnyModel> model = with_reading_recipe(source.recipe, OrError([&](auto tag) -> Result<AnyModel> {
                                                 using R = typename decltype(tag)::Recipe;
                                                 Result<LoadedModel<R>> loaded = source.load<R>();
                                                 if (!loaded) return loaded.error();
                                                 return detail::HeldAccess::made(
                                                     std::make_unique<detail::RecipeModel<R>>(std::move(*loaded)),
                                                     source.path, status ? 0 : bytes);
                                               }));
  if (model || !model.error().file.empty()) return model;
  Error error = model.error();
  error.file = source.path.string();
  return error;
}

COMPMARK_APP_INLINE Result<Done> AnyModel::make_up_for(double missing_share) {
  if (!(missing_share >= 0 && missing_share < 1)) {
    return Error{ErrorKind::invalid, file_.string(), "missing_share", "is not a number from 0 to below 1",
                 "give 0.2, or leave it out"};
  }
  held_->missing_share = missing_share;
  return Done{};
}

COMPMARK_APP_INLINE Result<AnyModel> AnyModel::open(const std::filesystem::path& path, ThreadExecutor& executor,
                                                    std::string* sha256) {
  const Result<ModelSource> source = ModelSource::open(path, executor, sha256);
  if (!source) return source.error();
  return load(*source);
}

}  // namespace compmark
