// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A folder that a run has for itself: nobody else writes into it meanwhile, and what an earlier run finished there is
// not lost unasked.
#pragma once

#include <compmark/core/result.hpp>
#include <filesystem>
#include <memory>
#include <vector>

#include "file_use.hpp"

namespace tool {

/// Makes a folder and holds it against other runs, until the last copy of what is returned is gone.
compmark::Result<std::shared_ptr<const void>> hold_folder(const std::filesystem::path& folder);
/// The same for a file that is written when the work is done.
compmark::Result<std::shared_ptr<const void>> hold_file(const std::filesystem::path& file);
/// The same for all models, compressed files and splats among the outputs of a command.
compmark::Result<std::vector<std::shared_ptr<const void>>> hold_outputs(const FileUse& use);

/// An error if a finished run is in the folder; `wanted` says that it may be replaced.
compmark::Result<compmark::Done> check_unfinished(const std::filesystem::path& folder, bool wanted);
/// An error if a decoder is in the place of one that would be made: without it nobody reads what was marked for it.
compmark::Result<compmark::Done> check_no_decoder(const std::filesystem::path& file, bool wanted);
/// Moves a decoder that is there to <name>.<beginning of its SHA-256>.old.
compmark::Result<compmark::Done> move_decoder_aside(const std::filesystem::path& file);

}  // namespace tool
