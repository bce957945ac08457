// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs another program to its end, without a shell, so that no name of a folder is read as a command. If this program
// is told to stop, it tells the other one and waits until it has written its files.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "compmark/core/result.hpp"

namespace fidelity {

namespace detail {
inline volatile sig_atomic_t stopped = 0, child = 0;  // what a handler may touch
inline void on_stop(int signal) {
  stopped = 1;
  // A terminal sends Ctrl-C to the child itself; a second one would end it at once.
  if (signal == SIGTERM && child != 0) kill(static_cast<pid_t>(child), SIGTERM);
}
}  // namespace detail

/// From here on SIGINT and SIGTERM end the program between two steps.
inline void watch_stop() {
  struct sigaction action {};
  action.sa_handler = detail::on_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}
[[nodiscard]] inline bool stopped() { return detail::stopped != 0; }

/// Exit code of `command[0]` (a path, or a name that is looked up in PATH) with the other words as its arguments; 128
/// and the signal if one ended it. What it prints goes to the file `output`; its progress and errors to where ours go.
[[nodiscard]] inline compmark::Result<int> run_program(const std::vector<std::string>& command,
                                                       const std::filesystem::path& output) {
  using compmark::Error, compmark::ErrorKind;
  std::vector<std::string> words = command;  // execve wants them writable
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  pid_t child = 0;
  detail::child = 0;
  const int failed = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    return Error{ErrorKind::invalid, command[0], "program",
                 std::string("cannot be run, or ") + output.string() + " not be written: " + std::strerror(failed),
                 "name the tool with --compmark"};
  }
  detail::child = child;
  if (stopped()) kill(child, SIGTERM);  // between the question and the answer
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR)
      return Error{ErrorKind::invalid, command[0], "program", std::string("was lost: ") + std::strerror(errno), {}};
  }
  detail::child = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace fidelity
