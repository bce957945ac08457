// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The curves of a run's page.
#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "report.hpp"
#include "svg_plot.hpp"

namespace tool {
namespace {

/// At most about `wanted` points: means over blocks, so that noise does not draw a band.
template <class Value>
PlotSeries thinned(const std::vector<ProgressLine>& curve, std::size_t wanted, std::string label, int color,
                   const Value& value) {
  PlotSeries series;
  series.label = std::move(label);
  series.color = color;
  const std::size_t block = std::max<std::size_t>(1, curve.size() / wanted);
  for (std::size_t begin = 0; begin < curve.size(); begin += block) {
    const std::size_t end = std::min(curve.size(), begin + block);
    double x = 0, y = 0;
    for (std::size_t i = begin; i < end; ++i) {
      x += static_cast<double>(curve[i].iteration);
      y += value(curve[i]);
    }
    series.points.push_back({x / static_cast<double>(end - begin), y / static_cast<double>(end - begin)});
  }
  return series;
}

/// Where anchors come and go: their number, and how many Gaussians a view has of them.
std::string growth(const std::vector<ProgressLine>& lines) {
  Plot anchors{.title = "Anchors", .x_label = "iteration", .y_label = "anchors", .series = {}, .from_zero = true};
  anchors.series.push_back(
      thinned(lines, 300, "anchors", 2, [](const ProgressLine& l) { return static_cast<double>(l.anchors); }));
  Plot gaussians{
      .title = "Gaussians of a view", .x_label = "iteration", .y_label = "Gaussians", .series = {}, .from_zero = true};
  gaussians.series.push_back(
      thinned(lines, 300, "Gaussians", 3, [](const ProgressLine& l) { return static_cast<double>(l.gaussians); }));
  return svg(anchors) + svg(gaussians);
}

}  // namespace

std::string curves_html(const ReportCurve& curve) {
  const std::vector<ProgressLine>& lines = curve.lines;
  if (lines.empty()) return {};
  Plot loss{.title = "Loss", .x_label = "iteration", .y_label = "loss (log)", .series = {}, .log_y = true};
  loss.series.push_back(thinned(lines, 300, "total", 0, [](const ProgressLine& l) { return l.loss; }));
  Plot psnr{.title = "PSNR", .x_label = "iteration", .y_label = "dB", .series = {}};
  if (curve.posthoc) {  // no photograph is looked at
    psnr.title = "PSNR of marked against unmarked renders";
    psnr.series.push_back(thinned(lines, 300, "sampled novel views", 0, [](const ProgressLine& l) { return l.psnr; }));
  } else {
    loss.series.push_back(thinned(lines, 300, "L1", 1, [](const ProgressLine& l) { return l.l1; }));
    psnr.series.push_back(thinned(lines, 300, "training views", 0, [](const ProgressLine& l) { return l.psnr; }));
  }
  PlotSeries test{.label = "test views", .points = {}, .names = {}, .color = 1, .line = true, .dots = true};
  for (const ProgressLine& line : lines) {
    if (line.test_psnr) test.points.push_back({static_cast<double>(line.iteration), *line.test_psnr});
  }
  if (!test.points.empty()) psnr.series.push_back(std::move(test));
  std::string text = "<h2>" + escape_html(curve.heading) + "</h2>";
  if (!curve.page.empty())
    text += "<p class=\"sub\">It has a page of its own: <a href=\"" + escape_html(curve.page) + "\">" +
            escape_html(curve.page) + "</a></p>";
  text += "<div class=\"plots\">" + svg(loss);
  std::vector<ProgressLine> read;
  std::copy_if(lines.begin(), lines.end(), std::back_inserter(read),
               [](const ProgressLine& line) { return line.bit_accuracy.has_value(); });
  if (!read.empty()) {
    Plot bits{.title = "Bits that are right", .x_label = "iteration", .y_label = "share of a view's", .series = {}};
    bits.series.push_back(
        thinned(read, 300, "views of the training", 0, [](const ProgressLine& l) { return *l.bit_accuracy; }));
    text += svg(bits);
  }
  text += svg(psnr);
  if (!curve.posthoc) text += growth(lines);
  return text + "</div>\n";
}

}  // namespace tool
