// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The tool as a process among others: signals that would end it in the middle of a file, standard streams that are
// closed or full, and what the parser says. An exit code says what was written; where the words could not be, it is
// that of an error.
#pragma once

#include <CLI/CLI.hpp>

namespace tool {

/// Call first. A pipe that nobody reads and a file that grew to its limit become errors of whoever writes; a standard
/// stream that is closed stays so for its writers, and no file that is opened later takes its place.
void prepare_process();
/// Call last: `code`, or that of an error where what was printed did not arrive.
int finish_output(int code);
/// Prints help, or one line of what is wrong with the command; returns the exit code.
int answer_parser(const CLI::App& app, const CLI::ParseError& error);

}  // namespace tool
