// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The fidelity table of finished cells as Markdown, JSON and a page: the figures of the paper's Table 1 beside its
// rows, and the cost of the mark and of the compression.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "../compmark/plain_page.hpp"
#include "cell.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/json_file.hpp"
#include "stopping.hpp"

namespace fidelity {

using tool::format_text;

struct Grid : tool::Table {
  std::string title;
};

namespace detail {

[[nodiscard]] inline std::string lpips_text(const Figures& before, const Figures& after) {
  return before.lpips && after.lpips ? format_text("%.3f / %.3f", *before.lpips, *after.lpips) : std::string("–");
}
/// Before / after; cells that were measured before there was such a figure have none.
[[nodiscard]] inline std::string between_text(const Row& row) {
  const std::optional<double>&before = row.models[marked].psnr_vs_unmarked,
        &after = row.models[marked_coded].psnr_vs_unmarked;
  return before && after ? format_text("%.2f / %.2f", *before, *after) : std::string("–");
}
[[nodiscard]] inline std::vector<std::string> pair_of(const std::string& name, const std::string& method,
                                                      const Figures& before, const Figures& after, bool marked) {
  return {name,
          method,
          marked ? format_text("%.2f / %.2f", 100 * before.accuracy, 100 * after.accuracy) : std::string("–"),
          format_text("%.2f / %.2f", before.psnr, after.psnr),
          format_text("%.3f / %.3f", before.ssim, after.ssim),
          lpips_text(before, after),
          format_text("%.2f / %.3f", before.bytes / 1e6, after.bytes / 1e6)};
}

/// Mean over rows of one codec.
[[nodiscard]] inline Row mean_of(const std::vector<const Row*>& rows) {
  Row mean = *rows[0];
  const double count = static_cast<double>(rows.size());
  for (std::size_t m = 0; m < mean.models.size(); ++m) {
    const auto average = [&](auto member) {
      double sum = 0;
      for (const Row* row : rows) sum += member(row->models[m]);
      return sum / count;
    };
    Figures& figures = mean.models[m];
    figures.psnr = average([](const Figures& f) { return f.psnr; });
    figures.ssim = average([](const Figures& f) { return f.ssim; });
    figures.bytes = average([](const Figures& f) { return f.bytes; });
    figures.accuracy = average([](const Figures& f) { return f.accuracy; });
    if (std::all_of(rows.begin(), rows.end(), [&](const Row* row) { return row->models[m].lpips.has_value(); }))
      figures.lpips = average([](const Figures& f) { return *f.lpips; });
    else
      figures.lpips.reset();
  }
  mean.scene = format_text("mean of %zu", rows.size());
  return mean;
}

[[nodiscard]] inline std::string codec_title(const Row& row) { return row.codec == "hac" ? "HAC" : "ContextGS"; }

inline void add_rows(Grid& grid, const Row& row) {
  grid.rows.push_back(
      pair_of(row.scene, codec_title(row) + ", unmarked", row.models[unmarked], row.models[unmarked_coded], false));
  grid.rows.push_back(
      pair_of(row.scene, codec_title(row) + ", marked", row.models[marked], row.models[marked_coded], true));
}

}  // namespace detail

/// As the paper's Table 1 is laid out: before / after compression. Its own rows are last: means over 25 scenes of three
/// sets at full length, of which a few shorter ones are no copy.
[[nodiscard]] inline Grid fidelity_grid(const std::vector<Row>& rows) {
  Grid grid;
  grid.title = "Before / after compression";
  grid.columns = {"scene", "method", "bits right, %", "PSNR, dB", "SSIM", "LPIPS-Alex", "size, MB"};
  for (const Row& row : rows) detail::add_rows(grid, row);
  for (const char* codec : {"hac", "context_gs"}) {
    std::vector<const Row*> of_codec;
    for (const Row& row : rows) {
      if (row.codec == codec) of_codec.push_back(&row);
    }
    if (of_codec.size() > 1) detail::add_rows(grid, detail::mean_of(of_codec));
  }
  grid.rows.push_back({"paper, 25 scenes", "HAC + CompMarkGS", "95.95 / 95.92", "27.68 / 27.65", "0.856 / 0.852",
                       "0.171 / 0.177 (VGG)", "208.96 / 12.23"});
  grid.rows.push_back({"paper, 25 scenes", "ContextGS + CompMarkGS", "94.36 / 94.03", "27.60 / 27.55", "0.845 / 0.844",
                       "0.172 / 0.173 (VGG)", "73.39 / 5.72"});
  return grid;
}

/// The cost of the mark, and the evidence for it.
[[nodiscard]] inline Grid cost_grid(const std::vector<Row>& rows) {
  Grid grid;
  grid.title = "What the mark costs, and what it proves";
  grid.columns = {"scene",
                  "codec",
                  "views",
                  "bits after, %",
                  "worst view, %",
                  "worst view's p",
                  "p of all views",
                  "unmarked file read, %",
                  "points lost to the codec",
                  "dB lost before / after",
                  "marked against unmarked, dB",
                  "bytes more, %",
                  "minutes: train, fit, mark"};
  for (const Row& row : rows) {
    const Figures& after = row.models[marked_coded];
    grid.rows.push_back(
        {row.scene, detail::codec_title(row), std::to_string(after.views), format_text("%.2f", 100 * after.accuracy),
         format_text("%.2f", 100 * after.worst), format_text("%.1e", after.worst_p_value),
         format_text("%.1e", after.p_value), format_text("%.2f", 100 * row.models[unmarked_coded].accuracy),
         format_text("%+.2f", row.lost_points()), format_text("%+.2f / %+.2f", row.lost(false), row.lost(true)),
         detail::between_text(row), format_text("%+.2f", 100 * row.more_bytes()),
         format_text("%.1f, %.1f, %.1f", row.train_seconds / 60, row.fit_seconds / 60, row.mark_seconds / 60)});
  }
  return grid;
}

[[nodiscard]] inline std::string settings_text(const Settings& settings) {
  std::string text = format_text("%lld iterations, λ = %g, %d bits", static_cast<long long>(settings.iterations),
                                 settings.rate_lambda, settings.bits);
  if (settings.fit_codec > 0)
    text += format_text(", the codec fitted afterwards in %lld", static_cast<long long>(settings.fit_codec));
  for (const std::string& word : words_that_count(settings.extra)) text += " " + word;
  return text + ". Every figure is a mean over the test views; after compression means read from the file.";
}

[[nodiscard]] inline std::string table_markdown(const Settings& settings, const std::vector<Row>& rows) {
  std::string text = "# Fidelity\n\n" + settings_text(settings) + "\n";
  for (const Grid& grid : {fidelity_grid(rows), cost_grid(rows)})
    text += "\n## " + grid.title + "\n\n" + grid.markdown();
  return text;
}

[[nodiscard]] inline nlohmann::ordered_json table_json(const Settings& settings, const std::vector<Row>& rows) {
  nlohmann::ordered_json json = {{"schema", "compmark.fidelity.1"},
                                 {"iterations", settings.iterations},
                                 {"lambda", settings.rate_lambda},
                                 {"bits", settings.bits},
                                 {"train", words_that_count(settings.extra)},
                                 {"rows", nlohmann::ordered_json::array()}};
  if (settings.fit_codec > 0) json["fit_codec"] = settings.fit_codec;
  static constexpr std::array<const char*, 4> names = {"unmarked_before", "unmarked_after", "marked_before",
                                                       "marked_after"};
  for (const Row& row : rows) {
    nlohmann::ordered_json entry = {{"scene", row.scene}, {"codec", row.codec}};
    for (std::size_t m = 0; m < names.size(); ++m) {
      const Figures& f = row.models[m];
      entry[names[m]] = {
          {"psnr", f.psnr},       {"ssim", f.ssim},
          {"bytes", f.bytes},     {"bit_accuracy", {{"mean", f.accuracy}, {"min", f.worst}, {"views", f.views}}},
          {"p_value", f.p_value}, {"largest_view_p_value", f.worst_p_value}};
      if (f.lpips) entry[names[m]]["lpips_alex"] = *f.lpips;
      if (f.psnr_vs_unmarked) entry[names[m]]["psnr_vs_unmarked"] = *f.psnr_vs_unmarked;
      if (f.ssim_vs_unmarked) entry[names[m]]["ssim_vs_unmarked"] = *f.ssim_vs_unmarked;
    }
    entry["psnr_cost_before"] = row.lost(false);
    entry["psnr_cost_after"] = row.lost(true);
    entry["more_bytes"] = row.more_bytes();
    entry["seconds"] = {{"train", row.train_seconds}, {"fit", row.fit_seconds}, {"mark", row.mark_seconds}};
    json["rows"].push_back(std::move(entry));
  }
  return json;
}

[[nodiscard]] inline std::string table_html(const Settings& settings, const std::vector<Row>& rows) {
  std::string body;
  for (const Grid& grid : {fidelity_grid(rows), cost_grid(rows)})
    body += "<h2>" + tool::escape_html(grid.title) + "</h2>" + grid.html();
  body += "<h2>Pages of the cells</h2><ul>";
  for (const Row& row : rows) {
    const std::string folder = tool::escape_html(row.scene + "_" + row.codec);
    body += "<li>" + folder + ": <a href=\"" + folder + "/evaluate.html\">the four models</a>, <a href=\"" + folder +
            "/report.html\">the marking</a>, <a href=\"" + folder + "/unmarked/report.html\">the training</a></li>";
  }
  return tool::html_page("Fidelity", settings_text(settings), {}, {}, body + "</ul>");
}

/// fidelity.json, .md and .html in the folder of the run.
[[nodiscard]] inline compmark::Result<compmark::Done> write_table(const Settings& settings,
                                                                  const std::vector<Row>& rows) {
  using compmark::write_file;
  const HoldStop hold;
  if (auto written = compmark::write_json(settings.out / "fidelity.json", table_json(settings, rows)); !written)
    return written;
  if (auto written = write_file(settings.out / "fidelity.md", table_markdown(settings, rows)); !written) return written;
  return write_file(settings.out / "fidelity.html", table_html(settings, rows));
}

}  // namespace fidelity
