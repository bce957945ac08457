// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "mark_plot.hpp"

#include <cstddef>
#include <utility>

namespace tool {

using namespace compmark;

Plot logit_plot(const Message& message, const Verification& verification, const std::string& title) {
  Plot plot{.title = title, .x_label = "bit", .y_label = "logit towards the key's bit", .series = {}};
  PlotSeries right{.label = "right", .points = {}, .names = {}, .color = 0, .line = false, .dots = true};
  PlotSeries wrong{.label = "wrong", .points = {}, .names = {}, .color = 1, .line = false, .dots = true};
  for (std::size_t b = 0; b < verification.fused.size(); ++b) {
    const double towards = message[b] ? verification.fused[b] : -verification.fused[b];
    (verification.read[b] == message[b] ? right : wrong).points.push_back({static_cast<double>(b), towards});
  }
  PlotSeries zero{.label = "", .points = {}, .names = {}, .color = 5};
  zero.points = {{0, 0}, {static_cast<double>(verification.fused.size()) - 1, 0}};
  for (PlotSeries* series : {&zero, &right, &wrong}) {
    if (!series->points.empty()) plot.series.push_back(std::move(*series));
  }
  return plot;
}

}  // namespace tool
