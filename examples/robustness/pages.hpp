// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The robustness tables as CSV, JSON, Markdown and a page with curves.
#pragma once

#include <compmark/io/atomic_file.hpp>
#include <compmark/io/json_file.hpp>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../compmark/plain_page.hpp"
#include "cells.hpp"

namespace robustness {

/// A cell that was measured.
struct Measured {
  std::string scene;
  Row row;
  RobustnessCell cell;
};

namespace detail {

using tool::format_text;

/// "jpeg" and 50 of "jpeg:50"; without a strength nothing.
[[nodiscard]] inline std::pair<std::string, std::optional<double>> parts_of(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) return {text, std::nullopt};
  return {text.substr(0, colon), std::strtod(text.c_str() + colon + 1, nullptr)};
}
[[nodiscard]] inline std::string psnr_text(const RobustnessCell& cell) {
  return cell.psnr ? format_text("%.2f", *cell.psnr) : std::string("–");
}

/// Mean bits, those of all views together and their p-value.
[[nodiscard]] inline std::string restored_text(const RobustnessCell& cell) {
  if (!cell.restored) return "–";
  return format_text("%.1f %%, %zu of %zu, p %.1e", 100 * cell.restored->mean, cell.restored->matches, cell.bits,
                     cell.restored->p_value);
}

[[nodiscard]] inline tool::Table table_of(const std::vector<Measured>& measured, const std::string& name) {
  tool::Table table;
  table.columns = {"attack",        "scene",    "bits, mean, %", "worst view, %", "all views", "p",
                   "PSNR left, dB", "restored", "informed",      "informed p",    "paper, %"};
  for (const Measured& m : measured) {
    if (m.row.table != name) continue;
    const RobustnessCell& cell = m.cell;
    const bool informed = cell.informed > 0;
    table.rows.push_back({m.row.attack.text, m.scene, format_text("%.1f", 100 * cell.mean),
                          format_text("%.1f", 100 * cell.worst), format_text("%zu of %zu", cell.matches, cell.bits),
                          format_text("%.1e", cell.p_value), psnr_text(cell), restored_text(cell),
                          informed ? format_text("%zu of %zu found", cell.found, cell.informed) : std::string("–"),
                          informed ? format_text("%.1e", cell.informed_p_value) : std::string("–"),
                          m.row.paper.empty() ? std::string("–") : m.row.paper});
  }
  return table;
}

/// Share of the bits over the strength, of each attack with three strengths or more.
[[nodiscard]] inline std::vector<tool::Plot> plots_of(const std::vector<Measured>& measured) {
  std::vector<std::string> order;
  std::map<std::string, std::map<std::string, tool::PlotSeries>> of;  // by attack, then by scene
  for (const Measured& m : measured) {
    const auto [name, strength] = parts_of(m.row.attack.text);
    if (!strength) continue;
    const std::string kind = m.row.table + ": " + name;
    if (of.find(kind) == of.end()) order.push_back(kind);
    of[kind][m.scene].points.push_back({*strength, 100 * m.cell.mean});
  }
  std::vector<tool::Plot> plots;
  for (const std::string& kind : order) {
    tool::Plot plot;
    plot.title = kind;
    plot.x_label = "strength";
    plot.y_label = "bits, mean over views, %";
    bool curve = false;
    for (auto& [scene, series] : of[kind]) {
      curve = curve || series.points.size() >= 3;
      std::sort(series.points.begin(), series.points.end());
      series.label = scene;
      series.dots = true;
      series.color = static_cast<int>(plot.series.size() % 6);
      plot.series.push_back(series);
    }
    if (curve) plots.push_back(std::move(plot));
  }
  return plots;
}

[[nodiscard]] inline std::vector<std::string> tables_of(const std::vector<Measured>& measured) {
  std::vector<std::string> names;
  for (const Measured& m : measured) {
    if (std::find(names.begin(), names.end(), m.row.table) == names.end()) names.push_back(m.row.table);
  }
  return names;
}

inline constexpr const char* page_note =
    "Bits: mean and worst view, and all views together with the p-value, of one test or, with --pruned, corrected for "
    "four. PSNR left: of attacked to "
    "unattacked renders, what the thief keeps; none where the size of the picture changes. Restored: an attacked model "
    "put back together in the unmarked one (--restored), as a reading of one test: bits in the mean, all views and p. "
    "Informed: by the unmarked "
    "model, from pictures of unknown camera, p-value corrected for its two tests. Paper: CompMarkGS over 25 scenes of "
    "three sets (HAC / ContextGS), which a few scenes are no copy of. docs/robustness.md says what each attack is.";

}  // namespace detail

/// Writes robustness.csv, .json, .md and .html into `out`.
[[nodiscard]] inline Result<Done> write_tables(const fs::path& out, const std::vector<Measured>& measured) {
  std::string csv =
      "table,attack,scene,views,bits,bits_mean,bits_worst_view,bits_right,p_value,worst_view_p_value,psnr,"
      "informed_pictures,informed_found,informed_p_value,restored_bits_mean,restored_bits_worst_view,"
      "restored_bits_right,restored_p_value,restored_anchors_found,paper\n";
  Json json{{"schema", "compmark.robustness.1"}, {"cells", Json::array()}};
  for (const Measured& m : measured) {
    const RobustnessCell& cell = m.cell;
    csv += "\"" + m.row.table + "\"," + m.row.attack.text + "," + m.scene +
           tool::format_text(",%zu,%zu,%.6f,%.6f,%zu,%.6e,%.6e,", cell.views, cell.bits, cell.mean, cell.worst,
                             cell.matches, cell.p_value, cell.worst_p_value) +
           (cell.psnr ? tool::format_text("%.4f", *cell.psnr) : std::string()) +
           (cell.informed > 0 ? tool::format_text(",%zu,%zu,%.6e", cell.informed, cell.found, cell.informed_p_value)
                              : std::string(",,,")) +
           (cell.restored
                ? tool::format_text(",%.6f,%.6f,%zu,%.6e,%zu", cell.restored->mean, cell.restored->worst,
                                    cell.restored->matches, cell.restored->p_value, cell.restored->features.found)
                : std::string(",,,,,")) +
           "," + m.row.paper + "\n";
    json["cells"].push_back({{"table", m.row.table}, {"attack", m.row.attack.text}, {"scene", m.scene}});
    json["cells"].back().update(cell_json(cell));
    if (!m.row.paper.empty()) json["cells"].back()["paper"] = m.row.paper;
  }
  std::string markdown = "# Robustness\n\n" + std::string(detail::page_note) + "\n", body;
  for (const std::string& name : detail::tables_of(measured)) {
    const tool::Table table = detail::table_of(measured, name);
    markdown += "\n## " + name + "\n\n" + table.markdown();
    body += "<h2>" + tool::escape_html(name) + "</h2>" + table.html();
  }
  if (Result<Done> written = compmark::write_file(out / "robustness.csv", csv); !written) return written;
  if (Result<Done> written = compmark::write_json(out / "robustness.json", json); !written) return written;
  if (Result<Done> written = compmark::write_file(out / "robustness.md", markdown); !written) return written;
  return compmark::write_file(out / "robustness.html",
                              tool::html_page("Robustness", "What attacks cost a mark, and what they cost the thief.",
                                              detail::plots_of(measured), detail::page_note, body));
}

}  // namespace robustness
