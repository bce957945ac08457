// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The tables of the ablations as ablations.json, ablations.md and ablations.html. Which rows agree with the paper is
// said, not hidden. Cost: none.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "../../examples/compmark/plain_page.hpp"
#include "ablations/record.hpp"
#include "ablations/rows.hpp"
#include "ablations/tables.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"

namespace ablation {

struct SceneHead {
  std::string name;
  int width = 0, height = 0;
  std::size_t train_views = 0, test_views = 0;
};
struct ReportHead {
  std::int64_t iterations = 0;
  std::size_t seeds = 0;
  std::vector<SceneHead> scenes;
};

/// One finished training in a line.
[[nodiscard]] inline std::string record_text(const Record& r) {
  return tool::format_text(
      "bits %.3f before and %.3f after compression, %.2f and %.2f dB, %llu anchors, %llu bytes, %.0f s",
      r.before.accuracy, r.after.accuracy, r.before.psnr, r.after.psnr, static_cast<unsigned long long>(r.anchors),
      static_cast<unsigned long long>(r.file_bytes), r.seconds);
}

namespace detail {

[[nodiscard]] inline std::string text_of(const Spread& spread, double unit, int digits) {
  if (spread.count == 0) return "";
  if (spread.count == 1) return tool::format_text("%.*f", digits, unit * spread.mean);
  return tool::format_text("%.*f ± %.*f", digits, unit * spread.mean, digits, unit * spread.deviation);
}
[[nodiscard]] inline std::string difference_text(const Spread& spread, int digits) {
  if (spread.count == 0) return "";
  if (spread.count == 1) return tool::format_text("%+.*f", digits, spread.mean);
  return tool::format_text("%+.*f ± %.*f", digits, spread.mean, digits, spread.standard_error());
}

[[nodiscard]] inline tool::Table measured_table(const FilledTable& filled) {
  tool::Table table;
  table.columns = {"row",
                   "bits before, %",
                   "bits after, %",
                   "worst view after, %",
                   "PSNR before, dB",
                   "PSNR after, dB",
                   "lost before, dB",
                   "lost after, dB",
                   "SSIM before",
                   "SSIM after",
                   "anchors",
                   "file, KiB",
                   "runs"};
  for (const FilledLine& line : filled.lines) {
    const bool any = line.accuracy_before.count != 0;
    table.rows.push_back({line.line.title, text_of(line.accuracy_before, 100, 1), text_of(line.accuracy_after, 100, 1),
                          any ? tool::format_text("%.1f", 100 * line.worst_after) : "", text_of(line.psnr_before, 1, 2),
                          text_of(line.psnr_after, 1, 2), text_of(line.lost_before, 1, 2),
                          text_of(line.lost_after, 1, 2), text_of(line.ssim_before, 1, 3),
                          text_of(line.ssim_after, 1, 3), text_of(line.anchors, 1, 0),
                          text_of(line.bytes, 1.0 / 1024, 0), std::to_string(line.accuracy_before.count)});
  }
  return table;
}

/// Row minus the method, here and in the paper.
[[nodiscard]] inline tool::Table direction_table(const FilledTable& filled) {
  tool::Table table;
  table.columns = {"row minus the method", "bits here, points", "in the paper",     "direction of the bits",
                   "PSNR here, dB",        "in the paper",      "direction of PSNR"};
  Published reference;
  for (const FilledLine& line : filled.lines) {
    if (line.reference) reference = line.line.paper;
  }
  for (const FilledLine& line : filled.lines) {
    if (line.reference) continue;
    const bool has_psnr = line.line.paper.psnr && reference.psnr;
    table.rows.push_back(
        {line.line.title, difference_text(line.accuracy_difference, 1),
         tool::format_text("%+.2f", line.line.paper.accuracy - reference.accuracy),
         std::string(direction_name(line.accuracy_direction)), difference_text(line.psnr_difference, 2),
         has_psnr ? tool::format_text("%+.2f", *line.line.paper.psnr - *reference.psnr) : std::string(),
         std::string(direction_name(line.psnr_direction))});
  }
  return table;
}

[[nodiscard]] inline std::string head_text(const ReportHead& head, const std::vector<Record>& records) {
  std::string text = std::to_string(head.iterations) + " iterations, " + std::to_string(head.seeds) +
                     (head.seeds == 1 ? " seed" : " seeds") + "; scenes:";
  for (const SceneHead& scene : head.scenes) {
    text += tool::format_text("%s %s (%d x %d, %zu training and %zu test views)", &scene == &head.scenes[0] ? "" : ",",
                              scene.name.c_str(), scene.width, scene.height, scene.train_views, scene.test_views);
  }
  return text + ". " + std::to_string(records.size()) +
         " trainings inside HAC; after compression means read from the file that its codec wrote.";
}

inline constexpr std::string_view note =
    "Mean ± standard deviation over scenes and seeds; the worst view of all of them. Lost: PSNR of the unmarked "
    "counterpart of the same scene, "
    "seed and schedule, minus that of the row. Differences are of pairs of the same scene and seed, ± standard error "
    "of their mean; one that is "
    "below twice its error is too close to say.";

[[nodiscard]] inline tool::Plot plot_of(const FilledTable& filled) {
  const bool capacity = filled.table.name == "T3";
  tool::Plot plot;
  plot.title = filled.table.name + ", " + filled.table.title;
  plot.x_label = capacity ? "bits" : "bit accuracy, %";
  plot.y_label = capacity ? "bit accuracy, %" : "PSNR, dB";
  tool::PlotSeries here{.label = "here", .points = {}, .names = {}, .color = 0, .line = capacity, .dots = true};
  tool::PlotSeries paper{.label = "paper", .points = {}, .names = {}, .color = 1, .line = capacity, .dots = true};
  for (const FilledLine& line : filled.lines) {
    const bool after = filled.table.after_compression;
    const Spread& accuracy = after ? line.accuracy_after : line.accuracy_before;
    const Spread& psnr = after ? line.psnr_after : line.psnr_before;
    if (capacity) {
      const double bits = std::strtod(line.line.title.c_str(), nullptr);
      here.points.push_back({bits, 100 * accuracy.mean});
      paper.points.push_back({bits, line.line.paper.accuracy});
      continue;
    }
    here.points.push_back({100 * accuracy.mean, psnr.mean});
    paper.points.push_back({line.line.paper.accuracy, line.line.paper.psnr.value_or(NAN)});
    here.names.push_back(line.line.title);
    paper.names.push_back(line.line.title);
  }
  plot.series = {here, paper};
  return plot;
}

[[nodiscard]] inline nlohmann::ordered_json line_json(const FilledLine& line) {
  const auto spread = [](const Spread& s) -> nlohmann::ordered_json {
    if (s.count == 0) return nullptr;
    return {{"mean", s.mean}, {"deviation", s.deviation}};
  };
  nlohmann::ordered_json json{{"row", line.line.row}, {"title", line.line.title}, {"runs", line.accuracy_before.count}};
  json["before_compression"] = {{"bit_accuracy", spread(line.accuracy_before)},
                                {"worst_view", line.worst_before},
                                {"psnr", spread(line.psnr_before)},
                                {"psnr_lost", spread(line.lost_before)},
                                {"ssim", spread(line.ssim_before)}};
  json["after_compression"] = {{"bit_accuracy", spread(line.accuracy_after)},
                               {"worst_view", line.worst_after},
                               {"psnr", spread(line.psnr_after)},
                               {"psnr_lost", spread(line.lost_after)},
                               {"ssim", spread(line.ssim_after)},
                               {"file_bytes", spread(line.bytes)}};
  json["anchors"] = spread(line.anchors);
  json["paper"] = {{"bit_accuracy", line.line.paper.accuracy / 100},
                   {"psnr", line.line.paper.psnr ? nlohmann::ordered_json(*line.line.paper.psnr) : nullptr}};
  if (!line.reference) {
    json["direction"] = {{"bit_accuracy", direction_name(line.accuracy_direction)},
                         {"psnr", direction_name(line.psnr_direction)}};
  }
  return json;
}

}  // namespace detail

[[nodiscard]] inline std::string report_markdown(const ReportHead& head, const std::vector<Record>& records) {
  std::string text = "# Ablations\n\n" + detail::head_text(head, records) + "\n\n" + std::string(detail::note) + "\n";
  for (const TableOfPaper& table : tables_of_paper()) {
    const FilledTable filled = fill(table, records);
    text += "\n## " + table.name + ": " + table.title + "\n\nPaper: " + table.source + ".\n\n" +
            detail::measured_table(filled).markdown() + "\n" + detail::direction_table(filled).markdown();
  }
  return text;
}

[[nodiscard]] inline nlohmann::ordered_json report_json(const ReportHead& head, const std::vector<Record>& records) {
  nlohmann::ordered_json json{{"schema", "compmark.ablations.1"},
                              {"iterations", head.iterations},
                              {"seeds", head.seeds},
                              {"scenes", nlohmann::ordered_json::array()},
                              {"tables", nlohmann::ordered_json::array()},
                              {"runs", nlohmann::ordered_json::array()}};
  for (const SceneHead& scene : head.scenes) {
    json["scenes"].push_back({{"name", scene.name},
                              {"image", {scene.width, scene.height}},
                              {"views", {scene.train_views, scene.test_views}}});
  }
  for (const TableOfPaper& table : tables_of_paper()) {
    nlohmann::ordered_json lines = nlohmann::ordered_json::array();
    for (const FilledLine& line : fill(table, records).lines) lines.push_back(detail::line_json(line));
    json["tables"].push_back({{"name", table.name}, {"title", table.title}, {"paper", table.source}, {"lines", lines}});
  }
  for (const Record& record : records) json["runs"].push_back(record_json(record));
  return json;
}

[[nodiscard]] inline std::string report_html(const ReportHead& head, const std::vector<Record>& records) {
  std::string body;
  for (const TableOfPaper& table : tables_of_paper()) {
    const FilledTable filled = fill(table, records);
    body += "<h2>" + table.name + ": " + tool::escape_html(table.title) +
            "</h2><p>Paper: " + tool::escape_html(table.source) + ".</p>" + tool::svg(detail::plot_of(filled)) +
            detail::measured_table(filled).html() + "<p></p>" + detail::direction_table(filled).html();
  }
  return tool::html_page("Ablations", detail::head_text(head, records), {}, std::string(detail::note), body);
}

/// Each file is replaced whole.
[[nodiscard]] inline compmark::Result<compmark::Done> write_report(const std::filesystem::path& out,
                                                                   const ReportHead& head,
                                                                   const std::vector<Record>& records) {
  if (auto r = compmark::write_json(out / "ablations.json", report_json(head, records)); !r) return r;
  if (auto r = compmark::write_file(out / "ablations.md", report_markdown(head, records)); !r) return r;
  return compmark::write_file(out / "ablations.html", report_html(head, records));
}

}  // namespace ablation
