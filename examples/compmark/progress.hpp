// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The progress of a training: a bar on a terminal, plain lines in a file or pipe, one JSON object a line in a log, and
// the flag that Ctrl-C sets. Values are means since the last output, so that a line describes the run and not a single
// view.
#pragma once

#include <signal.h>

#include <chrono>
#include <compmark/app/run/run_progress.hpp>
#include <compmark/core/result.hpp>
#include <compmark/io/atomic_file.hpp>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace tool {

/// One finished iteration, as it is shown and noted.
struct ProgressLine : compmark::RunProgress {
  double seconds = 0;               ///< since the start of this run; Progress fills it in
  std::optional<double> test_psnr;  ///< when the test views were measured after this iteration
};

/// How it is shown.
struct ProgressSettings {
  std::string label = "train";
  std::filesystem::path json_log;  ///< empty: none
  bool append = false;             ///< continue json_log (after --resume) instead of replacing it
  bool quiet = false;              ///< nothing on the screen
  std::optional<bool> terminal;    ///< bar or lines; not set: what stderr is
  std::int64_t log_every = 10;     ///< iterations between two lines of json_log and two points of history()
  double bar_seconds = 0.2;        ///< time between two refreshes of the bar
  double line_seconds = 10;        ///< time between two plain lines
  std::FILE* stream = stderr;
};

class Progress {
 public:
  /// Opens the log. Fails before anything is computed if it cannot be written.
  static compmark::Result<Progress> open(ProgressSettings settings);

  void show(const ProgressLine& line);
  /// Writes the text on a line of its own, above the bar.
  void note(const std::string& text);
  /// Ends the bar's line and flushes the log. Call once, also after an interrupted run.
  void finish();

  /// The points of the log, for the report; with `append` those of the sessions before too, as far as they count.
  [[nodiscard]] std::vector<ProgressLine> curve() const;
  /// The error that stopped the log. The run goes on without it.
  [[nodiscard]] const std::optional<compmark::Error>& log_failure() const { return log_failure_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  struct Mean {
    double loss = 0, l1 = 0, ssim = 0, psnr = 0;
    std::int64_t count = 0;
    void add(const ProgressLine& line);
    [[nodiscard]] ProgressLine of(const ProgressLine& last) const;
  };
  explicit Progress(ProgressSettings settings) : settings_(std::move(settings)) {}
  void draw(const ProgressLine& line);
  void print(const ProgressLine& line);
  void log(const std::string& text);

  ProgressSettings settings_;
  bool terminal_ = false;
  bool bar_visible_ = false;
  std::unique_ptr<std::FILE, Close> log_;
  std::optional<compmark::AtomicFile> stream_log_;  ///< a device or a pipe, which is written through and never read
  std::optional<compmark::Error> log_failure_;
  std::vector<ProgressLine> before_, history_;
  Mean logged_, shown_;
  std::optional<ProgressLine> pending_;  ///< last line, not yet shown
  std::int64_t first_ = 0;               ///< iteration before the first one shown
  Clock::time_point start_{}, last_shown_{};
  double seconds_before_ = 0;  ///< of the same run, before it was resumed
  double rate_ = 0;            ///< iterations per second, smoothed over about ten seconds
  std::int64_t rate_iteration_ = 0;
  Clock::time_point rate_time_{};
};

/// Reads a JSON-lines log back. Where an iteration appears twice (a resumed run), the later line holds; a last line cut
/// short is ignored.
compmark::Result<std::vector<ProgressLine>> read_progress_log(const std::filesystem::path& path);

/// "1:02:03" or "4:05".
std::string format_duration(double seconds);

/// Catches SIGINT and SIGTERM during its lifetime: the first one raises the flag, a second one ends the program at
/// once. The handler only stores to a lock-free atomic and restores the default action, both async-signal-safe. Use it
/// only for work that leaves a checkpoint. Later work (measuring, the page, the fit of a decoder) reads no flag and
/// must end at the first signal, as it does by default.
class InterruptWatch {
 public:
  InterruptWatch();  ///< lowers the flag
  ~InterruptWatch();
  InterruptWatch(const InterruptWatch&) = delete;
  InterruptWatch& operator=(const InterruptWatch&) = delete;

 private:
  using Action = struct sigaction;
  Action interrupt_{}, terminate_{};  ///< what was done before
};
/// Whether a signal came since the last watch began.
[[nodiscard]] bool interrupted();

}  // namespace tool
