// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// SIGINT and SIGTERM in a program that runs many cells. While a model trains, the run's observer watches for them: a
// checkpoint is written, and the program ends (examples/compmark/run_telling.hpp). At any other time they end it at
// once: what was not written yet is made again by the same command.
#pragma once

#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <cstddef>
#include <string>

namespace fidelity {

inline constexpr int stopped_exit = 130;  ///< the tool's, after Ctrl-C

namespace detail {
inline std::string stop_line;  // set before the handler is
inline std::atomic<bool> stop_held{false}, stop_waits{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a handler may touch it");

[[noreturn]] inline void stop_now() {
  static_cast<void>(!write(STDERR_FILENO, stop_line.data(), stop_line.size()));
  _exit(stopped_exit);
}
inline void on_stop(int) {
  if (stop_held) {
    stop_waits = true;
  } else {
    stop_now();
  }
}
}  // namespace detail

/// From here on.
inline void watch_stop(const char* program) {
  detail::stop_line =
      std::string(isatty(STDERR_FILENO) == 1 ? "\n" : "") + program + ": stopped; the same command goes on\n";
  struct sigaction action {};
  action.sa_handler = detail::on_stop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

/// A signal during its lifetime ends the program at the end of it: for files that belong together.
class HoldStop {
 public:
  HoldStop() { detail::stop_held = true; }
  ~HoldStop() {
    detail::stop_held = false;
    if (detail::stop_waits) detail::stop_now();
  }
  HoldStop(const HoldStop&) = delete;
  HoldStop& operator=(const HoldStop&) = delete;
};

}  // namespace fidelity
