// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The contents of a run's page. If the run wrote a compressed file, the page is about that file, because others get it.
// A table has the figures of the model before the codec.
#pragma once

#include <compmark/core/result.hpp>
#include <cstddef>
#include <optional>
#include <vector>

#include "coded_run.hpp"
#include "evaluation.hpp"
#include "mark_input.hpp"
#include "report.hpp"
#include "results.hpp"
#include "train_run.hpp"

namespace tool {

/// A few views of those that are measured, evenly spaced, whose pictures the page has.
class ShownViews {
 public:
  explicit ShownViews(const compmark::DatasetViews& measured);
  /// Keeps the pictures of the views that are shown, whatever else is measured.
  [[nodiscard]] compmark::SeenViewObserver keep();
  /// Adds renders of the unmarked model at the same cameras.
  compmark::Result<compmark::Done> add_unmarked(const std::filesystem::path& twin, compmark::ThreadExecutor& executor);
  std::vector<ReportView> pictures;

 private:
  compmark::DatasetViews views_;     ///< those that are shown
  std::vector<std::size_t> number_;  ///< of each among those that are measured
};

/// The measurements of a run.
struct RunFindings {
  const TrainOptions& options;
  const RunData& run;
  const RunEnd& end;
  const Results& results;
  const compmark::Evaluation& evaluation;  ///< of model.safetensors
  const MarkInput* mark = nullptr;
  const std::optional<MarkMeasurement>& found;  ///< the message in model.safetensors
  const std::optional<CodedRun>& coded;
  bool has_test = true;  ///< whether it was measured in test views, not in those of the training
};
ReportInput run_page(const RunFindings& findings, std::vector<ReportView> pictures);

}  // namespace tool
