// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is shown of a comparison: the tables and the page.
#include <algorithm>
#include <compmark/io/atomic_file.hpp>
#include <compmark/watermark/proof/report.hpp>
#include <compmark/watermark/proof/verify.hpp>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common.hpp"
#include "comparison.hpp"
#include "comparison_measures.hpp"
#include "mark_plot.hpp"
#include "svg_plot.hpp"

namespace tool {
namespace {

using namespace compmark;

std::string cell(const Measure& measure, std::optional<double> value) {
  return value ? format_text(measure.format, *value) : std::string();
}
std::string title_of(const ComparedModel& model) { return model.name + (model.is_unmarked ? " (unmarked)" : ""); }

const std::vector<std::string> read_columns = {"bits a view", "worst view", "its p", "all views", "p"};
/// In these columns.
void add_read(std::vector<std::string>& row, const Verification& verification) {
  const BitAccuracy accuracy = bit_accuracy(verification);
  row.push_back(format_text("%.4f", accuracy.mean));
  row.push_back(format_text("%.4f", accuracy.min));
  row.push_back(format_text("%.1e", accuracy.largest_p));
  row.push_back(format_text("%zu of %zu", verification.evidence.matches, verification.bits));
  row.push_back(format_text("%.1e", verification.evidence.p_value));
}

/// The columns that have a value for these models.
std::vector<const Measure*> measures_of(const Comparison& comparison) {
  std::vector<const Measure*> found;
  for (const Measure& measure : measures) {
    if (applies(measure, comparison)) found.push_back(&measure);
  }
  return found;
}

}  // namespace

ReportGrid comparison_grid(const Comparison& comparison) {
  ReportGrid grid;
  grid.heading = "Models";
  const bool reads = comparison.models.front().verification.has_value(),
             counterparts = comparison.models.front().unmarked.has_value();
  const std::vector<const Measure*> shown = measures_of(comparison);
  grid.columns = {"model", "codec", "bytes", "anchors"};
  for (const Measure* measure : shown) grid.columns.emplace_back(measure->heading);
  if (counterparts) grid.columns.emplace_back("unmarked counterpart");
  if (reads) grid.columns.insert(grid.columns.end(), read_columns.begin(), read_columns.end());
  for (const ComparedModel& model : comparison.models) {
    std::vector<std::string> row{title_of(model), model.codec.empty() ? "none" : model.codec,
                                 std::to_string(model.bytes), std::to_string(model.anchors)};
    for (const Measure* measure : shown) row.push_back(cell(*measure, mean_of(*measure, comparison, model)));
    if (counterparts) row.push_back(model.unmarked ? comparison.models[*model.unmarked].name : std::string());
    if (reads) add_read(row, *model.verification);
    grid.rows.push_back(std::move(row));
  }
  return grid;
}

ReportGrid attack_grid(const Comparison& comparison) {
  ReportGrid grid;
  grid.heading = "Read after an edit of every render";
  grid.columns = {"model", "edit"};
  grid.columns.insert(grid.columns.end(), read_columns.begin(), read_columns.end());
  grid.columns.emplace_back("PSNR left, dB");
  for (const ComparedModel& model : comparison.models) {
    for (const compmark::ReadAfterAttack& after : model.attacked) {
      grid.rows.push_back({title_of(model), after.attack});
      add_read(grid.rows.back(), after.verification);
      grid.rows.back().push_back(after.psnr ? format_text("%.2f", *after.psnr) : std::string("–"));
    }
  }
  return grid;
}

ReportGrid view_grid(const Comparison& comparison, const ComparedModel& model) {
  ReportGrid grid;
  grid.heading = "Views of " + title_of(model);
  const std::vector<const Measure*> shown = measures_of(comparison);
  grid.columns = {"view"};
  for (const Measure* measure : shown) grid.columns.emplace_back(measure->heading);
  if (model.verification) grid.columns.insert(grid.columns.end(), {"bits", "share", "p"});
  for (std::size_t i = 0; i < model.evaluation.views.size(); ++i) {
    std::vector<std::string> row{model.evaluation.views[i].name};
    for (const Measure* measure : shown) row.push_back(cell(*measure, measure->of_view(comparison, model, i)));
    if (model.verification) {
      const Evidence& evidence = model.verification->views[i];
      row.push_back(format_text("%zu of %zu", evidence.matches, model.verification->bits));
      row.push_back(
          format_text("%.4f", static_cast<double>(evidence.matches) / static_cast<double>(model.verification->bits)));
      row.push_back(format_text("%.1e", evidence.p_value));
    }
    grid.rows.push_back(std::move(row));
  }
  return grid;
}

ReportGrid section_grid(const Comparison& comparison) {
  ReportGrid grid;
  grid.heading = "Bytes by section";
  grid.columns = {"section"};
  std::vector<const ComparedModel*> compressed;
  std::vector<std::string> names;  // as the first model orders them
  for (const ComparedModel& model : comparison.models) {
    if (model.sections.empty()) continue;
    compressed.push_back(&model);
    grid.columns.insert(grid.columns.end(), {title_of(model), "%"});
    for (const auto& [name, bytes] : model.sections) {
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  if (compressed.empty()) return grid;
  const auto add = [](std::vector<std::string>& row, std::uint64_t bytes, std::uint64_t of) {
    row.push_back(std::to_string(bytes));
    row.push_back(format_text("%.1f", 100 * static_cast<double>(bytes) / static_cast<double>(of)));
  };
  for (const std::string& name : names) {
    std::vector<std::string> row{name};
    for (const ComparedModel* model : compressed) {
      const auto section = std::find_if(model->sections.begin(), model->sections.end(),
                                        [&](const auto& one) { return one.first == name; });
      if (section != model->sections.end())
        add(row, section->second, model->bytes);
      else
        row.insert(row.end(), {"", ""});
    }
    grid.rows.push_back(std::move(row));
  }
  std::vector<std::string> sum{"all sections"};
  for (const ComparedModel* model : compressed) {
    std::uint64_t bytes = 0;
    for (const auto& [name, size] : model->sections) bytes += size;
    add(sum, bytes, model->bytes);
  }
  grid.rows.push_back(std::move(sum));
  return grid;
}

std::string grid_text(const ReportGrid& grid) {
  std::vector<std::size_t> width;
  for (std::size_t c = 0; c < grid.columns.size(); ++c) {
    width.push_back(grid.columns[c].size());
    for (const std::vector<std::string>& row : grid.rows) width[c] = std::max(width[c], row[c].size());
  }
  std::string text;
  const auto line = [&](const std::vector<std::string>& cells) {
    for (std::size_t c = 0; c < cells.size(); ++c) {
      const std::string space(width[c] - cells[c].size(), ' ');
      text += c == 0 ? cells[c] + space : "  " + space + cells[c];
    }
    text += "\n";
  };
  line(grid.columns);
  for (const std::vector<std::string>& row : grid.rows) line(row);
  return text;
}

ReportInput comparison_report(const Comparison& comparison, const std::vector<std::vector<ReportView>>& pictures,
                              const std::string& title) {
  ReportInput report;
  const ComparedModel& first = comparison.models.front();
  report.title = title;
  report.subtitle = std::to_string(first.evaluation.views.size()) + " " + split_name(comparison.split) + " views of " +
                    std::to_string(comparison.models.size()) + (comparison.models.size() == 1 ? " model" : " models");
  for (const ComparedModel& model : comparison.models) {
    if (model.is_unmarked) continue;
    const double psnr = model.evaluation.mean([](const ViewResult& v) { return v.psnr; });
    report.headline.emplace_back(format_text("%.2f dB", psnr), "PSNR, " + model.name);
    report.headline.emplace_back(format_text("%.1f KiB", static_cast<double>(model.bytes) / 1024),
                                 "size, " + model.name);
    if (model.verification) {
      report.headline.emplace_back(
          format_text("%zu of %zu", model.verification->evidence.matches, model.verification->bits),
          "bits read from all views, " + model.name);
    }
  }
  report.grids.push_back(comparison_grid(comparison));
  if (ReportGrid attacks = attack_grid(comparison); !attacks.rows.empty()) report.grids.push_back(std::move(attacks));
  if (ReportGrid sections = section_grid(comparison); !sections.rows.empty())
    report.grids.push_back(std::move(sections));
  for (const ComparedModel& model : comparison.models) report.grids.push_back(view_grid(comparison, model));
  for (std::size_t v = 0; v < pictures.front().size(); ++v) {
    for (std::size_t m = 0; m < comparison.models.size(); ++m) {
      report.views.push_back(pictures[m][v]);
      report.views.back().name += ", " + title_of(comparison.models[m]);
    }
  }
  for (const ComparedModel& model : comparison.models) {
    if (!model.verification) continue;
    report.plots.push_back(logit_plot(comparison.message, *model.verification, "Bits, " + title_of(model)));
  }
  return report;
}

std::string evaluation_text(const Comparison& comparison) {
  std::string text;
  const std::vector<ViewResult>& views = comparison.models[0].evaluation.views;
  if (comparison.models.size() == 1) {
    for (const ViewResult& view : views) {
      text += format_text("%-24s PSNR %6.2f dB  SSIM %.4f", view.name.c_str(), view.psnr, view.ssim);
      if (view.lpips_alex) text += format_text("  LPIPS-alex %.4f", *view.lpips_alex);
      if (view.lpips_squeeze) text += format_text("  LPIPS-squeeze %.4f", *view.lpips_squeeze);
      text += format_text("  %.1f ms\n", view.milliseconds);
    }
  }
  text += format_text("mean over %zu views\n", views.size()) + grid_text(comparison_grid(comparison));
  if (const ReportGrid attacks = attack_grid(comparison); !attacks.rows.empty()) text += grid_text(attacks);
  for (const ComparedModel& model : comparison.models) {
    if (model.sections.empty()) continue;
    text += model.name + "\n";
    for (const auto& [name, bytes] : model.sections) {
      text += format_text("  %-30s %10llu  %5.1f %%\n", name.c_str(), static_cast<unsigned long long>(bytes),
                          100 * static_cast<double>(bytes) / static_cast<double>(model.bytes));
    }
  }
  return text;
}

Result<Done> write_evaluation(const Comparison& comparison, const std::vector<std::vector<ReportView>>& pictures,
                              const std::filesystem::path& data, std::size_t threads, const EvaluationFiles& files) {
  if (!files.json.empty()) {
    if (Result<Done> written = write_file(files.json, comparison_json(comparison).dump(2) + "\n"); !written)
      return written;
  }
  if (!files.csv.empty()) {
    if (Result<Done> written = write_file(files.csv, comparison_csv(comparison)); !written) return written;
  }
  if (files.html.empty()) return Done{};
  ReportInput report = comparison_report(comparison, pictures, base_name(data));
  for (const ComparedModel& compared : comparison.models) {
    if (compared.verification)
      report.words.push_back({"Read from the renders of " + compared.name + (compared.is_unmarked ? " (unmarked)" : ""),
                              report_text(*compared.verification)});
  }
  report.tables.push_back(machine_table(static_cast<int>(threads)));
  return write_report(files.html, report);
}

}  // namespace tool
