// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Folders of runs: no other run writes into one at the same time, and a finished run, or a decoder without which marks
// cannot be read, is replaced only on request.
#pragma once

#include <filesystem>
#include <memory>

#include "compmark/app/compiled.hpp"
#include "compmark/app/observer.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

/// Creates a folder and checks that files can be written in it.
[[nodiscard]] Result<Done> make_folder(const std::filesystem::path& path);
/// Makes a folder and locks it against other runs, until the last copy of the returned value is gone.
[[nodiscard]] Result<std::shared_ptr<const void>> hold_folder(const std::filesystem::path& folder);
/// The same for a file that is written when the work is done.
[[nodiscard]] Result<std::shared_ptr<const void>> hold_file(const std::filesystem::path& file);

/// An error if the folder holds a finished run, unless it may be replaced or continued.
[[nodiscard]] Result<Done> check_unfinished(const std::filesystem::path& folder, bool wanted);
/// An error if a decoder is there, unless it may be moved aside.
[[nodiscard]] Result<Done> check_no_decoder(const std::filesystem::path& file, bool wanted);
/// Moves a decoder that is there to FILE.<beginning of its SHA-256>.old, and says so.
[[nodiscard]] Result<Done> move_decoder_aside(const std::filesystem::path& file, const SentenceSink& note);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/run_folder.hpp"
#endif
