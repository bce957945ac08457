// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Training runs that hide a message. They are compiled apart from the others: each is a recipe of its own.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/splat/training/settings.hpp>
#include <string>

#include "mark_input.hpp"

namespace tool {

struct TrainOptions;

/// The error for a recipe that cannot carry a message.
[[nodiscard]] compmark::Error no_message_in(const std::string& recipe);

/// Checks that options.mark is possible for a finished model of options.recipe, before hours of work.
[[nodiscard]] compmark::Result<compmark::Done> can_mark_finished(const TrainOptions& options);

/// Trains options.recipe with a mark, or marks options.model by training on from it. Returns the exit code.
int train_marked(const TrainOptions& options, compmark::TrainSettings settings, const MarkInput& mark);

/// Post-hoc embedding into options.model: compmark embed. Without a decoder one is fitted into options.out. Returns the
/// exit code.
int embed_model(TrainOptions options);

}  // namespace tool
