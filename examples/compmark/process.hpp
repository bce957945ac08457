// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The tool as a process: signals that would end it in the middle of a file, standard streams that are closed or full,
// and messages of the parser. If its output could not be printed, the exit code is that of an error.
#pragma once

#include <CLI/CLI.hpp>
#include <compmark/core/result.hpp>
#include <string>
#include <vector>

namespace tool {

/// Call first. A closed pipe, and a file at its size limit, become write errors. A standard stream that is closed stays
/// closed for its writers: no file that is opened later takes its place.
void prepare_process();
/// Call last. Returns `code`, or the code of an error if the output was not printed completely.
int finish_output(int code);
/// What was thrown, as an error. Only in a handler.
[[nodiscard]] compmark::Error caught_error();
/// What is wrong with the words of a command, which is the first of them; the nearest known one where a word is mistyped.
[[nodiscard]] compmark::Error words_error(const CLI::App& app, const CLI::ParseError& error,
                                          const std::vector<std::string>& words);
/// Prints help, or that error in one line; returns the exit code.
int answer_parser(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& words);

}  // namespace tool
