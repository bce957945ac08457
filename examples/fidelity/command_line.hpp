// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Options that all programs for cells share, and the options that they pass on to compmark train.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "../compmark/numbers.hpp"
#include "cell.hpp"
#include "compmark/core/result.hpp"

namespace fidelity {

/// Says what is wrong; the exit code of it.
inline int fail(const char* program, const Error& error) {
  std::fprintf(stderr, "%s: error: %s\n", program, error.line().c_str());
  return 2;
}

/// --out, --threads. Unknown options are those of `compmark train`. --compmark named the tool that ran the trainings.
inline void add_settings(CLI::App& app, Settings& settings, const char* program) {
  app.add_option("--out", settings.out, "folder of the run")->required();
  app.add_option("--threads", settings.threads, "0: all; the result is the same for any number")
      ->capture_default_str()
      ->check(tool::in_range(tool::thread_range));
  app.add_option_function<std::string>("--compmark",
                                       [program](const std::string&) {
                                         std::fprintf(stderr,
                                                      "%s: warning: --compmark is not used: this program trains and "
                                                      "measures by itself now\n",
                                                      program);
                                       })
      ->group("");  // no longer in the help
  app.allow_extras();
}

/// --iterations and --codecs, of the programs that choose them by hand.
inline void add_iterations(CLI::App& app, Settings& settings) {
  app.add_option("--iterations", settings.iterations, "length of every training; every phase scales with it")
      ->capture_default_str()
      ->check(tool::in_range(tool::run_length));
}
/// `codecs` are those that the program knows, and the default.
inline void add_codecs(CLI::App& app, std::vector<std::string>& codecs) {
  std::string known;
  for (std::size_t i = 0; i < codecs.size(); ++i)
    known += (i == 0 ? "of " : i + 1 == codecs.size() ? " and " : ", ") + codecs[i];
  app.add_option("--codecs", codecs, known)->capture_default_str()->check(CLI::IsMember(codecs));
}
/// --bits, of the programs that hide a message.
inline void add_bits(CLI::App& app, Settings& settings) {
  app.add_option("--bits", settings.bits, "length of the message")
      ->capture_default_str()
      ->check(tool::in_range(tool::WholeRange{16, 128}));
}

/// The exit code where there is nothing to be run: help was asked for, or an option is wrong.
[[nodiscard]] inline std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(error);
    std::fprintf(stderr, "error: %s; --help says more\n", tool::parse_error_line(error).c_str());
    return 2;
  }
  return std::nullopt;
}

/// An option of `compmark train` that the user must not give, because every cell has its own, or all have the same;
/// `more` beside those of any cell.
[[nodiscard]] inline std::optional<std::string> word_of_the_cells(const std::vector<std::string>& words,
                                                                  const std::vector<std::string>& more = {}) {
  for (const std::string& word : words) {
    const std::string name = word.substr(0, word.find('='));
    for (const char* own : {"--decoder", "--key", "--out", "--unmarked", "--codec", "--recipe", "--for-compression",
                            "--preset", "--json-log", "--downscale"}) {
      if (name == own) return name;
    }
    if (std::find(more.begin(), more.end(), name) != more.end()) return name;
  }
  return std::nullopt;
}
/// The other options, as they were given, except those that hold always: an unfinished run is continued.
[[nodiscard]] inline std::vector<std::string> train_words(std::vector<std::string> words) {
  std::erase_if(words, [](const std::string& word) { return word == "--" || word == "--resume"; });
  return words;
}

}  // namespace fidelity
