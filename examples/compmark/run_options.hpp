// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Options that the commands which train share: train, embed and fit-codec.
#pragma once

#include <array>
#include <compmark/app/run/run_settings.hpp>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "options.hpp"

namespace tool {

/// What is not of the run itself.
struct RunOptions {
  std::size_t threads = 0;
  std::filesystem::path json_log;
};

/// Options of a run that starts from a finished model, for any purpose.
void add_finished_model_options(Options& app, compmark::RunSettings& run, RunOptions& options);

/// --up, of splats that are looked at without cameras of their own; `otherwise` is taken where neither this nor the file
/// says it.
void add_splat_up(Options& app, std::optional<std::array<double, 3>>& up, const std::string& otherwise = "-y");

/// --recipient, of a key with recipients.
void add_recipient(Options& app, std::size_t& recipient);

/// --bits, --key, --recipient, --decoder, --period, --tone, --unmarked, --message-weight, --message-margin,
/// --message-power, --message-rate, --step-rate, --fidelity, --fidelity-fall, --sample-by-loss, --orbit, --photographs, --edits,
/// --lost-anchors, --spread, --calibrate-steps, --message-every, --for-compression
void add_mark_options(Options& app, compmark::MarkSettings& options, bool required);

/// The files of a run, from its options.
struct RunFiles {
  std::filesystem::path out, json_log;
  std::filesystem::path model;  ///< that it starts from; may be empty
  bool marks = false;
};
/// What a run leaves in a folder, whatever it trains, and what of the run of the model that it starts from it looks at.
void add_run_files(FileUse& use, const RunFiles& run, const std::filesystem::path& out);

}  // namespace tool
