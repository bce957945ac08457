// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Training runs for compression, with a message or without. They are compiled apart from the others: each is a recipe
// of its own.
#pragma once

#include <compmark/splat/training/settings.hpp>

#include "mark_input.hpp"

namespace tool {

struct TrainOptions;

/// Trains options.recipe, one that trains for a codec, and writes the compressed file too. `mark` may be null. Returns
/// the exit code.
int train_coded(const TrainOptions& options, compmark::TrainSettings settings, const MarkInput* mark);
/// Those of one codec, each compiled by itself.
int train_hac(const TrainOptions& options, compmark::TrainSettings settings, const MarkInput* mark);
int train_context_gs(const TrainOptions& options, compmark::TrainSettings settings, const MarkInput* mark);

}  // namespace tool
