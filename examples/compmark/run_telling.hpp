// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Shows a run to the person at the terminal: the bar, the log, warnings and notes, the page, and the figures at its
// end. Ctrl-C stops the run after a checkpoint.
#pragma once

#include <chrono>
#include <compmark/app/run/run_observer.hpp>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <set>
#include <string>

#include "machine_memory.hpp"
#include "progress.hpp"
#include "train_page.hpp"

namespace tool {

/// A figure on a terminal, a line every ten seconds elsewhere.
class FitLine {
 public:
  FitLine();
  void show(std::size_t done, std::size_t total);

 private:
  using Clock = std::chrono::steady_clock;
  bool terminal_ = false;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

class RunTelling final : public compmark::RunObserver {
 public:
  /// `json_log` is that of the run in `out`, empty for log.jsonl there; the unmarked model's run has its own. The
  /// figures of finished runs are printed to `figures`, which must outlive this; `memory` is of the runs alone.
  RunTelling(std::filesystem::path out, std::filesystem::path json_log, bool resume, std::FILE* figures = stdout,
             PeakMemory memory = {});

  void on_warning(const std::string& sentence) override;
  void on_note(const std::string& sentence) override;
  compmark::Result<compmark::Done> on_begin(const compmark::RunBeginning& beginning) override;
  bool on_iteration(const compmark::RunProgress& progress) override;
  void on_iterations_end() override;
  bool on_fit(std::size_t done, std::size_t total) override;
  void on_measure(const compmark::DatasetViews& measured) override;
  void on_view(const compmark::SeenView& view) override;
  compmark::Result<compmark::Done> on_findings(const compmark::RunFindings& findings,
                                               compmark::ThreadExecutor& executor) override;
  void on_finished(const compmark::RunOutcome& outcome) override;
  [[nodiscard]] double seconds() const override;
  [[nodiscard]] double free_memory_bytes() const override;
  [[nodiscard]] double peak_memory_mb() const override;

  /// Why a run that ended so failed: an incomplete log is named last, after everything else was written.
  [[nodiscard]] std::optional<compmark::Error> failure(const compmark::Result<compmark::RunOutcome>& outcome) const;
  /// The exit code of a run that ended so; prints the failure.
  int finish(const compmark::Result<compmark::RunOutcome>& outcome);

 private:
  std::filesystem::path out_, json_log_;
  bool resume_ = false;
  std::FILE* figures_;
  PeakMemory memory_;
  bool began_ = false;  ///< an iteration was shown
  std::optional<Progress> progress_;
  std::optional<InterruptWatch> watch_;
  std::optional<FitLine> fit_;
  std::optional<ShownViews> shown_;
  std::optional<compmark::Error> log_failure_;
  std::set<std::string> warned_;  ///< each is said once, whichever run of the command finds it
};

}  // namespace tool
