// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The contents of a run's page. If the run wrote a compressed file, the page is about that file, because others get it.
// A table has the figures of the model before the codec.
#pragma once

#include <compmark/app/run/run_observer.hpp>
#include <compmark/core/result.hpp>
#include <cstddef>
#include <vector>

#include "evaluation.hpp"
#include "report.hpp"

namespace tool {

/// A few views of those that are measured, evenly spaced, whose pictures the page has.
class ShownViews {
 public:
  explicit ShownViews(const compmark::DatasetViews& measured);
  /// Keeps the pictures of a view that is shown.
  void keep(const compmark::SeenView& view);
  /// Adds renders of the unmarked model at the same cameras.
  compmark::Result<compmark::Done> add_unmarked(const std::filesystem::path& counterpart,
                                                compmark::ThreadExecutor& executor);
  std::vector<ReportView> pictures;

 private:
  compmark::DatasetViews views_;     ///< those that are shown
  std::vector<std::size_t> number_;  ///< of each among those that are measured
};

/// `curve` is that of this run, its sessions before included.
ReportInput run_page(const compmark::RunFindings& findings, const std::vector<ProgressLine>& curve,
                     std::vector<ReportView> pictures);

}  // namespace tool
