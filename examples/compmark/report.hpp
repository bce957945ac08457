// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// report.html: one file to open or send. It has the figures, the verdict on a message in words and bit by bit, curves,
// settings and, for chosen test views, ground truth, render and five times their difference side by side, with the
// unmarked counterpart's where there is one. Images are embedded PNGs, plots inline SVG; there is no script and nothing
// is loaded from elsewhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "progress.hpp"
#include "svg_plot.hpp"

namespace tool {

/// An 8-bit image, interleaved red, green, blue.
struct ReportImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;
};
/// Clamps to [0, 1] and rounds half up, as every metric of the library does.
ReportImage make_report_image(compmark::ImageView<const float> image);

/// A view of the model that has no mark.
struct UnmarkedView {
  std::string file;    ///< name of the model's
  ReportImage render;  ///< as large as the marked one
  double psnr = 0;
  double ssim = 0;
};

struct ReportView {
  std::string name;
  ReportImage ground_truth;
  ReportImage render;  ///< of the same size
  double psnr = 0;
  double ssim = 0;
  std::optional<double> lpips;
  std::optional<UnmarkedView> unmarked{};
};

/// The log of one run: of a training, or of what was done to its model afterwards.
struct ReportCurve {
  std::string heading;
  std::vector<ProgressLine> lines;  ///< Progress::curve() or read_progress_log()
  bool posthoc = false;             ///< post-hoc embedding: the PSNR is that against the unmarked renders
  std::string page{};               ///< address of the run's own page, relative to this one; empty: it is this one
};

/// A verdict for people who know no statistics.
struct ReportWords {
  std::string heading;
  std::string text;  ///< lines of report_text()
};

/// A table of two columns.
struct ReportTable {
  std::string heading;
  std::vector<std::pair<std::string, std::string>> rows;
};

/// A table with a header line (per-view figures, for instance). The first column is text, the others numbers.
struct ReportGrid {
  std::string heading;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
};

struct ReportInput {
  std::string title;     ///< e.g. "lego"
  std::string subtitle;  ///< e.g. "recipe scaffold, profile scaffold, 30,000 iterations"
  std::vector<std::pair<std::string, std::string>> headline;  ///< the few figures to see first: value, what it is
  std::vector<ReportWords> words{};                           ///< whether a message was found
  std::vector<ReportCurve> curves{};                          ///< in the order in which they were run
  std::vector<ReportTable> tables;                            ///< metrics, machine, settings …
  std::vector<ReportGrid> grids;
  std::vector<Plot> plots;  ///< of the message that was read
  std::vector<ReportView> views;
  std::string renders = "render";  ///< what the pictures are of
  int difference_gain = 5;
};

/// Plots of one log, under its heading; empty without lines.
std::string curves_html(const ReportCurve& curve);

/// The page as text, and written atomically. Cost: PNG compression of three images a view, five with an unmarked
/// counterpart (~0.1 s each at 800 x 800).
std::string make_report(const ReportInput& input);
compmark::Result<compmark::Done> write_report(const std::filesystem::path& path, const ReportInput& input);

/// Processor, cores, memory, compiler and instruction set of this build and machine, as rows of a table.
ReportTable machine_table(int threads);

}  // namespace tool
