// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The tables, JSON, CSV and page that compmark evaluate makes of models side by side (compmark/app/compare.hpp).
#pragma once

#include <compmark/app/compare.hpp>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "report.hpp"

namespace tool {

using compmark::ComparedModel;
using compmark::Comparison;

/// Warnings to stderr, and pictures of some views of every model for the page.
class ShownModels : public compmark::CompareObserver {
 public:
  explicit ShownModels(std::size_t shown) : shown_(shown) {}
  void on_warning(const std::string& sentence) override;
  void on_model(const std::filesystem::path& path, std::size_t view_count) override;
  bool on_view(const compmark::SeenView& view) override;

  std::vector<std::vector<ReportView>> pictures;  ///< of Comparison::models

 private:
  std::size_t shown_, count_ = 0;
};

[[nodiscard]] const char* split_name(compmark::Split split);
/// A line a model, with the columns that apply.
ReportGrid comparison_grid(const Comparison& comparison);
/// A line a view of one model.
ReportGrid view_grid(const Comparison& comparison, const ComparedModel& model);
/// A line a model and attack; empty without an attack.
ReportGrid attack_grid(const Comparison& comparison);
/// A line a kind of section, a column a compressed model, and the sum, which is the file; empty without one.
ReportGrid section_grid(const Comparison& comparison);
/// The grid as text.
std::string grid_text(const ReportGrid& grid);
/// Schema compmark.evaluation.1: figures of the first model and of its views, and of all models and theirs.
nlohmann::ordered_json comparison_json(const Comparison& comparison);
/// A line a view and model, after them one of the model as a whole (RFC 4180).
std::string comparison_csv(const Comparison& comparison);
ReportInput comparison_report(const Comparison& comparison, const std::vector<std::vector<ReportView>>& pictures,
                              const std::string& title);

/// What compmark evaluate prints.
std::string evaluation_text(const Comparison& comparison);
/// Its files; an empty path is not written.
struct EvaluationFiles {
  std::filesystem::path json, csv, html;
};
compmark::Result<compmark::Done> write_evaluation(const Comparison& comparison,
                                                  const std::vector<std::vector<ReportView>>& pictures,
                                                  const std::filesystem::path& data, std::size_t threads,
                                                  const EvaluationFiles& files);

}  // namespace tool
