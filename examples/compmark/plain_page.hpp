// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Pages of figures without pictures, as the programs of the benchmarks and of the fidelity table write them: a heading,
// a line that says what was measured, plots, tables (as Markdown too). No script, nothing loaded. The page of a run,
// with its pictures, is report.hpp's.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "svg_plot.hpp"

namespace tool {

/// The first column is text, the others numbers.
struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
  /// Aligned Markdown.
  [[nodiscard]] std::string markdown() const {
    const auto escaped = [](const std::string& cell) {
      std::string text;
      for (const char c : cell) text += c == '|' ? std::string("\\|") : std::string(1, c);
      return text;
    };
    // In letters, not in bytes of UTF-8.
    const auto size = [&](const std::string& cell) {
      const std::string text = escaped(cell);
      return static_cast<std::size_t>(std::count_if(
          text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
    };
    std::vector<std::size_t> width;
    for (const std::string& column : columns) width.push_back(size(column));
    for (const std::vector<std::string>& row : rows) {
      for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], size(row[c]));
    }
    const auto line = [&](const std::vector<std::string>& cells) {
      std::string text = "|";
      for (std::size_t c = 0; c < cells.size(); ++c) {
        const std::string space(width[c] - size(cells[c]), ' '), cell = escaped(cells[c]);
        text.append(" ").append(c == 0 ? cell : space).append(c == 0 ? space : cell).append(" |");
      }
      return text + "\n";
    };
    std::string text = line(columns) + "|";
    for (std::size_t c = 0; c < width.size(); ++c) {
      text.append(c == 0 ? ":" : "-").append(width[c], '-').append(c == 0 ? "-|" : ":|");
    }
    text += "\n";
    for (const std::vector<std::string>& row : rows) text += line(row);
    return text;
  }
  [[nodiscard]] std::string html() const {
    std::string text = "<table><tr>";
    for (const std::string& column : columns) text += "<th>" + escape_html(column) + "</th>";
    text += "</tr>";
    for (const std::vector<std::string>& row : rows) {
      text += "<tr>";
      for (const std::string& cell : row) text += "<td>" + escape_html(cell) + "</td>";
      text += "</tr>";
    }
    return text + "</table>\n";
  }
};

/// `body` is HTML.
inline std::string html_page(const std::string& title, const std::string& head, const std::vector<Plot>& plots,
                             const std::string& note, const std::string& body) {
  const std::string heading = escape_html(title);
  std::string page =
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>" + heading +
      "</title><style>"
      ":root{--ink:#16202c;--soft:#5b6878;--line:#dfe4ea;--paper:#fff;color-scheme:light dark}"
      "@media(prefers-color-scheme:dark){:root{--ink:#e6ebf1;--soft:#98a5b5;--line:#2d3742;--paper:#12171d}}"
      "body{margin:0 auto;max-width:1240px;padding:28px 20px;background:var(--paper);color:var(--ink);font:15px/1.5 "
      "system-ui,sans-serif}"
      "table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}td,th{padding:3px 10px 3px "
      "0;text-align:right;"
      "border-bottom:1px solid var(--line)}td:first-child,th:first-child{text-align:left}" +
      std::string(plot_style) + "</style></head><body><h1>" + heading + "</h1><p>" + escape_html(head) + "</p>";
  for (const Plot& plot : plots) page += svg(plot);
  return page + "<p>" + escape_html(note) + "</p>" + body + "</body></html>\n";
}
inline std::string html_page(const std::string& title, const std::string& head, const std::vector<Plot>& plots,
                             const std::string& note, const Table& table) {
  return html_page(title, head, plots, note, table.html());
}

/// Writes what was asked for: the page, and `plots` of it alone.
inline compmark::Result<compmark::Done> write_pages(const std::filesystem::path& html, const std::filesystem::path& svg,
                                                    const std::string& page, const std::vector<Plot>& plots) {
  if (!svg.empty()) {
    if (compmark::Result<compmark::Done> r = compmark::write_file(svg, standalone_svg(plots)); !r) return r;
  }
  return html.empty() ? compmark::Result<compmark::Done>(compmark::Done{}) : compmark::write_file(html, page);
}

}  // namespace tool
