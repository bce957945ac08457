// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Compares models of one scene over the same views: before and after each codec, marked and unmarked. These are the
// measurements of compmark evaluate, with its tables, JSON, CSV and page.
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
  /// Unmarked counterparts: none, one for all models, or one for each in their order, so that a compressed model is
  /// compared with the compressed unmarked one. A counterpart may be one of the models.
  std::vector<std::filesystem::path> unmarked;
  std::filesystem::path key, decoder;  ///< key and decoder of the message; both or none
  std::filesystem::path data;
  std::string split = "test";
  double downscale = 1;
  std::size_t threads = 0;
  LpipsFiles lpips;
  std::size_t shown = 0;  ///< views whose pictures are kept
};

/// The change that a mark and later processing made in a view: this model's render against its counterpart's, over all
/// pixels.
struct AgainstTwin {
  double psnr = 0;  ///< dB
  double ssim = 0;
  std::optional<double> lpips_alex, lpips_squeeze;
};

struct ComparedModel {
  std::filesystem::path path;
  std::string name;          ///< of the file, with as many folders as tell it from the others
  bool is_unmarked = false;  ///< the counterpart of a model
  std::uint64_t bytes = 0;   ///< of the file
  std::string codec;         ///< empty: not compressed
  std::vector<std::pair<std::string, std::uint64_t>> sections;  ///< of a compressed file, largest first
  std::size_t anchors = 0;
  Evaluation evaluation;
  std::optional<compmark::Verification> verification;
  std::optional<std::size_t> twin;        ///< in Comparison::models
  std::vector<AgainstTwin> against_twin;  ///< of every view; empty without a counterpart
  std::vector<ReportView> views;          ///< pictures
};

struct Comparison {
  std::vector<ComparedModel> models;  ///< in the order they were given, then the twins that are none of them
  std::string split;
  compmark::Message message;  ///< of the key; empty without one
};

/// Loads, renders and measures every model. Cost: a render for each view and model, and as many of the counterparts,
/// whose photographs stay in memory together.
compmark::Result<Comparison> compare_models(const ComparisonInput& input, compmark::ThreadExecutor& executor);

/// A line a model, with the columns that apply.
ReportGrid comparison_grid(const Comparison& comparison);
/// A line a view of one model.
ReportGrid view_grid(const Comparison& comparison, const ComparedModel& model);
/// A line a kind of section, a column a compressed model, and the sum, which is the file; empty without one.
ReportGrid section_grid(const Comparison& comparison);
/// The grid as text.
std::string grid_text(const ReportGrid& grid);
/// Schema compmark.evaluation.1: figures of the first model and of its views, and of all models and theirs.
nlohmann::ordered_json comparison_json(const Comparison& comparison);
/// A line a view and model, after them one of the model as a whole (RFC 4180).
std::string comparison_csv(const Comparison& comparison);
ReportInput comparison_report(const Comparison& comparison, const std::string& title);

}  // namespace tool
