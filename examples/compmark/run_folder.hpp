// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Locks the folder of a run: no other run writes into it at the same time, and a finished run there is replaced only on
// request.
#pragma once

#include <compmark/core/result.hpp>
#include <filesystem>
#include <memory>
#include <vector>

#include "file_use.hpp"

namespace tool {

/// Makes a folder and locks it against other runs, until the last copy of the returned value is gone.
compmark::Result<std::shared_ptr<const void>> hold_folder(const std::filesystem::path& folder);
/// The same for a file that is written when the work is done.
compmark::Result<std::shared_ptr<const void>> hold_file(const std::filesystem::path& file);
/// The same for all models, compressed files and splats among the outputs of a command.
compmark::Result<std::vector<std::shared_ptr<const void>>> hold_outputs(const FileUse& use);

/// An error if a finished run is in the folder; `wanted` says that it may be replaced.
compmark::Result<compmark::Done> check_unfinished(const std::filesystem::path& folder, bool wanted);
/// An error if an existing decoder would be replaced: without it its marks cannot be read.
compmark::Result<compmark::Done> check_no_decoder(const std::filesystem::path& file, bool wanted);
/// Moves a decoder that is there to <name>.<beginning of its SHA-256>.old.
compmark::Result<compmark::Done> move_decoder_aside(const std::filesystem::path& file);

}  // namespace tool
