// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "train_coded.hpp"

#include <compmark/app/recipe_list.hpp>
#include "train_recipe.hpp"

namespace tool {

int train_hac(const TrainOptions& options, TrainSettings settings, const MarkInput* mark) {
  return with_hac_recipe(options.recipe, ExitCode([&](auto tag) -> int {
                           return run_coded<typename decltype(tag)::Recipe>(options, settings, mark);
                         }));
}

int train_coded(const TrainOptions& options, TrainSettings settings, const MarkInput* mark) {
  return recipe_codec(options.recipe) == std::string_view("context_gs")
             ? train_context_gs(options, std::move(settings), mark)
             : train_hac(options, std::move(settings), mark);
}

}  // namespace tool
