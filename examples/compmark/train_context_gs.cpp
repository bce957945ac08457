// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <compmark/app/recipe_list.hpp>
#include "train_coded.hpp"
#include "train_recipe.hpp"

namespace tool {

int train_context_gs(const TrainOptions& options, TrainSettings settings, const MarkInput* mark) {
  return with_context_gs_recipe(options.recipe, ExitCode([&](auto tag) -> int {
                                  return run_coded<typename decltype(tag)::Recipe>(options, settings, mark);
                                }));
}

}  // namespace tool
