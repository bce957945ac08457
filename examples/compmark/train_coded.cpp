// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "train_coded.hpp"

#include "recipe_list.hpp"
#include "train_run.hpp"

namespace tool {

int train_coded(const TrainOptions& options, TrainSettings settings, const MarkInput* mark) {
  return with_coded_recipe(options.recipe, ExitCode([&](auto tag) -> int {
                             using R = typename decltype(tag)::Recipe;
                             if (mark == nullptr) return run<R>(options, settings);
                             if constexpr (present<typename R::Exposure>) {
                               return fail({ErrorKind::unsupported,
                                            {},
                                            "--recipe",
                                            "\"" + options.recipe + "\" is not built with a message",
                                            "choose hac, hac+mask or hac+alpha"});
                             } else {
                               return run<recipes::Marked<R, Decoder>>(options, settings, mark);
                             }
                           }));
}

}  // namespace tool
