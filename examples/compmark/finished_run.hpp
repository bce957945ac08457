// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Recognises a finished run. If a command with --resume asks for exactly that run, nothing is left to do. With other
// options it would be another run, which replaces the finished one only with --force.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/splat/training/settings.hpp>
#include <filesystem>
#include <string>

#include "train_run.hpp"

namespace tool {

/// The identity of a run beside its model, for results.json: JSON of its settings and of the files it read (SHA-256; a
/// key by its commitment).
compmark::Result<std::string> run_identity(const TrainOptions& options, const compmark::TrainSettings& settings);

/// Whether a finished run is in a folder: results of the files that are there, and no checkpoint.
bool holds_finished_run(const std::filesystem::path& folder);

/// Whether the run in options.out is finished and has the same options. An error names the options that differ; with
/// --force there is none.
compmark::Result<bool> is_finished(const TrainOptions& options, const RunData& run);

}  // namespace tool
