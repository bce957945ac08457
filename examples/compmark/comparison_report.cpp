// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is written of a comparison: the table, JSON, CSV and the page.
#include <algorithm>
#include <compmark/mark/report.hpp>
#include <compmark/mark/verify.hpp>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "comparison.hpp"
#include "mark_input.hpp"
#include "svg_plot.hpp"

namespace tool {
namespace {

using namespace compmark;

double milliseconds(const ComparedModel& model) {
  return model.evaluation.mean([](const ViewResult& v) { return v.milliseconds; });
}

nlohmann::ordered_json figures(const Comparison& comparison, const ComparedModel& model) {
  const Evaluation& evaluation = model.evaluation;
  nlohmann::ordered_json json{{"psnr", model.psnr()},
                              {"ssim", evaluation.mean([](const ViewResult& v) { return v.ssim; })}};
  if (comparison.lpips_alex) json["lpips_alex"] = evaluation.mean([](const ViewResult& v) { return *v.lpips_alex; });
  if (comparison.lpips_squeeze)
    json["lpips_squeeze"] = evaluation.mean([](const ViewResult& v) { return *v.lpips_squeeze; });
  if (const std::optional<double> fitted = evaluation.colour_fitted()) json["psnr_colour_fitted"] = *fitted;
  json["milliseconds"] = milliseconds(model);
  json["bytes"] = model.bytes;
  json["anchors"] = model.anchors;
  if (!model.codec.empty()) {
    json["codec"] = model.codec;
    for (const auto& [name, bytes] : model.sections) json["sections"][name] = bytes;
  }
  if (model.verification) {
    const BitAccuracy accuracy = bit_accuracy(*model.verification);
    json["bit_accuracy"] = {{"mean", accuracy.mean}, {"min", accuracy.min}, {"views", accuracy.views}};
    json["bits_right"] = model.verification->evidence.matches;
    json["p_value"] = model.verification->evidence.p_value;
    json["largest_view_p_value"] = accuracy.largest_p;
  }
  if (const std::optional<double> cost = comparison.cost(model)) {
    json["psnr_cost_vs_unmarked"] = *cost;
    json["psnr_vs_unmarked"] = *model.mean_vs_unmarked();
  }
  return json;
}

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

}  // namespace

ReportGrid comparison_grid(const Comparison& comparison) {
  ReportGrid grid;
  grid.heading = "Models";
  const bool twin = comparison.models.back().is_unmarked, reads = comparison.models.front().verification.has_value();
  grid.columns = {"model", "codec", "bytes", "anchors", "PSNR, dB", "SSIM"};
  if (comparison.lpips_alex) grid.columns.emplace_back("LPIPS-alex");
  if (comparison.lpips_squeeze) grid.columns.emplace_back("LPIPS-squeeze");
  if (twin) grid.columns.insert(grid.columns.end(), {"dB lost", "against unmarked, dB"});
  if (reads) grid.columns.insert(grid.columns.end(), {"bits a view", "worst view", "all views", "p"});
  grid.columns.emplace_back("ms a view");
  for (const ComparedModel& model : comparison.models) {
    const Evaluation& evaluation = model.evaluation;
    std::vector<std::string> row{model.path.filename().string() + (model.is_unmarked ? " (unmarked)" : ""),
                                 model.codec.empty() ? "none" : model.codec,
                                 std::to_string(model.bytes),
                                 std::to_string(model.anchors),
                                 format_text("%.3f", model.psnr()),
                                 format_text("%.4f", evaluation.mean([](const ViewResult& v) { return v.ssim; }))};
    if (comparison.lpips_alex)
      row.push_back(format_text("%.4f", evaluation.mean([](const ViewResult& v) { return *v.lpips_alex; })));
    if (comparison.lpips_squeeze)
      row.push_back(format_text("%.4f", evaluation.mean([](const ViewResult& v) { return *v.lpips_squeeze; })));
    if (twin) {
      const std::optional<double> cost = comparison.cost(model);
      row.push_back(cost ? format_text("%.3f", *cost) : "");
      row.push_back(cost ? format_text("%.2f", *model.mean_vs_unmarked()) : "");
    }
    if (reads) {
      const Verification& verification = *model.verification;
      const BitAccuracy accuracy = bit_accuracy(verification);
      row.push_back(format_text("%.4f", accuracy.mean));
      row.push_back(format_text("%.4f", accuracy.min));
      row.push_back(format_text("%zu of %zu", verification.evidence.matches, verification.bits));
      row.push_back(format_text("%.1e", verification.evidence.p_value));
    }
    row.push_back(format_text("%.1f", milliseconds(model)));
    grid.rows.push_back(std::move(row));
  }
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

nlohmann::ordered_json comparison_json(const Comparison& comparison) {
  nlohmann::ordered_json json{{"schema", "compmark.evaluation.1"}, {"split", comparison.split}};
  json.update(figures(comparison, comparison.models.front()));
  for (const ComparedModel& model : comparison.models) {
    nlohmann::ordered_json entry{{"file", model.path.filename().string()}, {"unmarked", model.is_unmarked}};
    entry.update(figures(comparison, model));
    json["models"].push_back(std::move(entry));
  }
  for (const ViewResult& view : comparison.models.front().evaluation.views) {
    nlohmann::ordered_json entry{
        {"name", view.name}, {"psnr", view.psnr}, {"ssim", view.ssim}, {"milliseconds", view.milliseconds}};
    if (view.psnr_colour_fitted) entry["psnr_colour_fitted"] = *view.psnr_colour_fitted;
    if (view.lpips_alex) entry["lpips_alex"] = *view.lpips_alex;
    if (view.lpips_squeeze) entry["lpips_squeeze"] = *view.lpips_squeeze;
    json["views"].push_back(std::move(entry));
  }
  return json;
}

std::string comparison_csv(const Comparison& comparison) {
  std::string text =
      "model,codec,bytes,view,psnr,ssim,lpips_alex,lpips_squeeze,psnr_vs_unmarked,bits_right,bits,p_value,milliseconds,"
      "gaussians\r\n";
  const auto number = [](std::optional<double> value) { return value ? format_text("%.9g", *value) : std::string(); };
  for (const ComparedModel& model : comparison.models) {
    for (std::size_t i = 0; i < model.evaluation.views.size(); ++i) {
      const ViewResult& view = model.evaluation.views[i];
      const Evidence* const evidence = model.verification ? &model.verification->views[i] : nullptr;
      std::optional<double> between;
      if (!model.psnr_vs_unmarked.empty()) between = model.psnr_vs_unmarked[i];
      const std::vector<std::string> cells{csv_text(model.path.filename().string()),
                                           model.codec,
                                           std::to_string(model.bytes),
                                           csv_text(view.name),
                                           number(view.psnr),
                                           number(view.ssim),
                                           number(view.lpips_alex),
                                           number(view.lpips_squeeze),
                                           number(between),
                                           evidence != nullptr ? std::to_string(evidence->matches) : "",
                                           evidence != nullptr ? std::to_string(model.verification->bits) : "",
                                           evidence != nullptr ? number(evidence->p_value) : "",
                                           number(view.milliseconds),
                                           std::to_string(view.gaussians)};
      for (std::size_t c = 0; c < cells.size(); ++c) text += (c == 0 ? "" : ",") + cells[c];
      text += "\r\n";
    }
  }
  return text;
}

ReportInput comparison_report(const Comparison& comparison, const std::string& title) {
  ReportInput report;
  const ComparedModel& first = comparison.models.front();
  report.title = title;
  report.subtitle = std::to_string(first.evaluation.views.size()) + " " + comparison.split + " views of " +
                    std::to_string(comparison.models.size()) + (comparison.models.size() == 1 ? " model" : " models");
  for (const ComparedModel& model : comparison.models) {
    if (model.is_unmarked) continue;
    const std::string name = model.path.filename().string();
    report.headline.emplace_back(format_text("%.2f dB", model.psnr()), "PSNR, " + name);
    report.headline.emplace_back(format_text("%.1f KiB", static_cast<double>(model.bytes) / 1024), "size, " + name);
    if (model.verification) {
      report.headline.emplace_back(
          format_text("%zu of %zu", model.verification->evidence.matches, model.verification->bits),
          "bits read from all views, " + name);
    }
  }
  report.grids.push_back(comparison_grid(comparison));
  for (const ComparedModel& model : comparison.models) {
    if (model.sections.empty()) continue;
    ReportTable table;
    table.heading = model.path.filename().string() + ", bytes by section";
    for (const auto& [name, bytes] : model.sections)
      table.rows.emplace_back(name, format_text("%.1f KiB", static_cast<double>(bytes) / 1024));
    report.tables.push_back(std::move(table));
  }
  for (std::size_t v = 0; v < first.views.size(); ++v) {
    for (const ComparedModel& model : comparison.models) report.views.push_back(model.views[v]);
  }
  for (const ComparedModel& model : comparison.models) {
    if (!model.verification) continue;
    report.plots.push_back(
        logit_plot(comparison.message, *model.verification, "Bits, " + model.path.filename().string()));
  }
  return report;
}

}  // namespace tool
