// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Training runs that hide a message. They are compiled apart from the others: each is a recipe of its own.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/pipeline/settings.hpp>
#include <string>

#include "mark_input.hpp"

namespace tool {

struct TrainOptions;

/// What is said where no message can be hidden in a recipe.
[[nodiscard]] compmark::Error no_message_in(const std::string& recipe);

/// Whether a finished model of options.recipe can be marked as options.mark says: what is wrong is said before hours of
/// work.
[[nodiscard]] compmark::Result<compmark::Done> can_mark_finished(const TrainOptions& options);

/// Trains options.recipe with a mark, or marks options.model by training on from it. Returns the exit code.
int train_marked(const TrainOptions& options, compmark::TrainSettings settings, const MarkInput& mark);

/// Marks options.model beside what it is: compmark embed. Without a decoder one is fitted into options.out. Returns the
/// exit code.
int embed_model(TrainOptions options);

}  // namespace tool
