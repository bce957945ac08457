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

/// Calls a generic lambda with the recipe of a name (compmark/app/recipe_list.hpp). The lambda returns an exit code; a
/// name that is in no list gives an error.
template <class F>
struct ExitCode : F {
  explicit ExitCode(F f) : F(f) {}
  using F::operator();
  [[nodiscard]] int unknown(const compmark::Error& error) const { return fail(error); }
};

/// Warns, once, if there are fewer threads than `wanted` (0 asks for no number).
void tell_threads(const compmark::ThreadExecutor& executor, std::size_t wanted);

/// Recipe that a profile runs with unless --recipe says otherwise.
std::string default_recipe(std::string_view profile);
/// Whether a profile is one of the published method, whose mark trains with the scene.
inline bool is_published_profile(std::string_view profile) { return profile == "official" || profile == "paper"; }

/// Adds the file name to an Error of a function that does not know it.
[[nodiscard]] inline compmark::Error in_file(compmark::Error error, const std::filesystem::path& file) {
  error.file = file.string();
  return error;
}
/// The last name of a path, also of "scene/": the name of a dataset.
std::string base_name(const std::filesystem::path& path);
/// Creates a folder and checks that files can be written in it.
compmark::Result<compmark::Done> make_folder(const std::filesystem::path& path);

}  // namespace tool
