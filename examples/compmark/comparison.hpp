// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Models of one scene side by side: before and after each codec, marked and not, over the same views. What compmark evaluate measures, and the tables,
// JSON, CSV and page it makes of it.
#pragma once

#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/owner_key.hpp>
#include <compmark/mark/message.hpp>
#include <compmark/mark/verify.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "evaluation.hpp"
#include "report.hpp"

namespace tool {

struct ComparisonInput {
  std::vector<std::filesystem::path> models;  ///< the first is what the others are compared with
  std::filesystem::path unmarked;             ///< the twin without a mark; may be empty
  std::filesystem::path key, decoder;         ///< whose message is read, and by what; both or none
  std::filesystem::path data;
  std::string split = "test";
  double downscale = 1;
  std::size_t threads = 0;
  LpipsFiles lpips;
  std::size_t shown = 0;  ///< views whose pictures are kept
};

struct ComparedModel {
  std::filesystem::path path;
  bool is_unmarked = false;
  std::uint64_t bytes = 0;                                      ///< of the file
  std::string codec;                                            ///< empty: not compressed
  std::vector<std::pair<std::string, std::uint64_t>> sections;  ///< of a compressed file, largest first
  std::size_t anchors = 0;
  Evaluation evaluation;
  std::optional<compmark::Verification> verification;
  std::vector<double> psnr_vs_unmarked;  ///< of every view, dB, between the two renders; empty without a twin
  std::vector<ReportView> views;         ///< pictures

  [[nodiscard]] double psnr() const;
  /// dB, mean over the views.
  [[nodiscard]] std::optional<double> mean_vs_unmarked() const;
};

struct Comparison {
  std::vector<ComparedModel> models;  ///< in the order they were given, then the twin
  std::string split;
  compmark::Message message;  ///< of the key; empty without one
  bool lpips_alex = false, lpips_squeeze = false;

  /// What the mark, and whatever was done since, cost: the twin's PSNR less this model's, dB.
  [[nodiscard]] std::optional<double> cost(const ComparedModel& model) const;
};

/// Loads, renders and measures every model. Cost: a render a view and model, one more of the twin.
compmark::Result<Comparison> compare_models(const ComparisonInput& input, compmark::ThreadExecutor& executor);

/// A line a model, with the columns that apply.
ReportGrid comparison_grid(const Comparison& comparison);
/// The grid as text.
std::string grid_text(const ReportGrid& grid);
/// Schema compmark.evaluation.1: figures of the first model, of its views, and of all models.
nlohmann::ordered_json comparison_json(const Comparison& comparison);
/// A line a view and model (RFC 4180).
std::string comparison_csv(const Comparison& comparison);
ReportInput comparison_report(const Comparison& comparison, const std::string& title);

}  // namespace tool
