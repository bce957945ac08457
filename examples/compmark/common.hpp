// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Helpers that the subcommands of the tool share: one error line, exit codes, folders.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

namespace tool {

/// Exit codes of the tool.
enum : int { success = 0, not_detected = 1, failure = 2, inconclusive = 3, salvaged = 4, interrupted_exit = 130 };

/// Prints "compmark: error: <line>" and returns the exit code.
int fail(const compmark::Error& error);

/// Prints "compmark: warning: <sentence>".
void print_warning(const std::string& sentence);
/// Prints "compmark: <sentence>".
void print_note(const std::string& sentence);

/// Warns, once, if there are fewer threads than `wanted` (0 asks for no number).
void tell_threads(const compmark::ThreadExecutor& executor, std::size_t wanted);

/// The last name of a path, also of "scene/": the name of a dataset.
std::string base_name(const std::filesystem::path& path);

}  // namespace tool
