// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The page that the programs accuracy_vs_time… and ablations write: a heading, a line that says what was measured, plots, a table. No script, nothing loaded.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "../../examples/compmark/svg_plot.hpp"
#include "accuracy_rows.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/json_file.hpp"

namespace accuracy_bench {

/// `body` is HTML.
inline std::string html_page(const std::string& title, const std::string& head, const std::vector<tool::Plot>& plots,
                             const std::string& note, const std::string& body) {
  const std::string heading = tool::escape_html(title);
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
      std::string(tool::plot_style) + "</style></head><body><h1>" + heading + "</h1><p>" + tool::escape_html(head) +
      "</p>";
  for (const tool::Plot& plot : plots) page += tool::svg(plot);
  return page + "<p>" + tool::escape_html(note) + "</p>" + body + "</body></html>\n";
}
inline std::string html_page(const std::string& title, const std::string& head, const std::vector<tool::Plot>& plots,
                             const std::string& note, const Table& table) {
  return html_page(title, head, plots, note, table.html());
}

/// Writes what was asked for: the page, and its first plot alone.
inline compmark::Result<compmark::Done> write_pages(const std::filesystem::path& html, const std::filesystem::path& svg,
                                                    const std::string& page, const tool::Plot& plot) {
  if (!svg.empty()) {
    if (compmark::Result<compmark::Done> r = compmark::write_file(svg, tool::standalone_svg(plot)); !r) return r;
  }
  return html.empty() ? compmark::Result<compmark::Done>(compmark::Done{}) : compmark::write_file(html, page);
}

}  // namespace accuracy_bench
