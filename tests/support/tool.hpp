// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Running the command-line tool from a test: what it printed, its exit code, and a folder for its files.
#pragma once

#include <doctest/doctest.h>

#include <sys/wait.h>

#include <unistd.h>
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

namespace compmark::testing {

struct Outcome {
  int code = -1;
  std::string text;  ///< stdout and stderr
};

/// Runs `program` with these arguments through the shell; `before` and `after` are words of the shell around the
/// command.
inline Outcome run_tool(const std::string& program, const std::string& arguments, const std::string& before = {},
                        const std::string& after = {}) {
  Outcome outcome;
  const std::string command = before + "\"" + program + "\" " + arguments + " 2>&1 " + after;
  std::FILE* pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  std::array<char, 4096> buffer{};
  for (std::size_t n = 0; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    outcome.text.append(buffer.data(), n);
  const int status = pclose(pipe);
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return outcome;
}

/// One error line with every piece in it; exit code 2.
inline void check_refused(const Outcome& outcome, const std::vector<std::string>& pieces) {
  INFO(outcome.text);
  CHECK(outcome.code == 2);
  CHECK(std::count(outcome.text.begin(), outcome.text.end(), '\n') == 1);
  CHECK(outcome.text.rfind("compmark: error: ", 0) == 0);
  for (const std::string& piece : pieces) {
    INFO(piece);
    CHECK(outcome.text.find(piece) != std::string::npos);
  }
}

/// A folder of one test program, removed at its end.
struct ScratchFolder {
  std::filesystem::path path;
  explicit ScratchFolder(const std::string& name)
      : path(std::filesystem::temp_directory_path() / (name + "-" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(path);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
};

}  // namespace compmark::testing
