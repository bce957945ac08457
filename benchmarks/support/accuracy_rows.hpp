// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Figures of one row of accuracy_vs_time: differences of images and gradients from the references, medians of times; and a table of them as
// aligned Markdown or HTML.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "../../examples/compmark/svg_plot.hpp"

namespace accuracy_bench {

inline double psnr_of(double squares, std::size_t count) {
  return squares > 0 ? -10 * std::log10(squares / static_cast<double>(count)) : 999;
}

struct Difference {
  double squares = 0, largest = 0;
  std::size_t count = 0;
  void add(const std::vector<double>& a, const std::vector<double>& b) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double d = std::abs(a[i] - b[i]);
      squares += d * d;
      largest = std::max(largest, d);
    }
    count += a.size();
  }
  [[nodiscard]] double psnr() const { return psnr_of(squares, count); }
};

/// Sums that give relative L2 distance, cosine and signed bias of a gradient g against the reference r.
struct GradientDifference {
  double gg = 0, rr = 0, gr = 0, dd = 0;
  void add(const std::vector<double>& g, const std::vector<double>& r) {
    for (std::size_t i = 0; i < g.size(); ++i)
      gg += g[i] * g[i], rr += r[i] * r[i], gr += g[i] * r[i], dd += (g[i] - r[i]) * (g[i] - r[i]);
  }
  [[nodiscard]] double relative() const { return std::sqrt(dd / rr); }
  [[nodiscard]] double cosine() const { return gr / std::sqrt(gg * rr); }
  [[nodiscard]] double bias() const { return gr / rr - 1; }  // > 0: too long along the true direction
};

struct Row {
  std::vector<double> forward_ms, backward_ms;  // a repetition each, mean over views
  Difference to_exact, to_spec;
  std::array<GradientDifference, 5> gradient;
  std::ptrdiff_t bytes = 0;
  double pairs = 0;
  static double median(std::vector<double> values) {
    if (values.empty()) return NAN;
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  }
  [[nodiscard]] double forward() const { return median(forward_ms); }
  [[nodiscard]] double backward() const { return median(backward_ms); }
  [[nodiscard]] double total() const { return forward() + backward(); }
  template <class F>
  [[nodiscard]] double mean_of_groups(const F& f) const {
    double sum = 0;
    for (const GradientDifference& group : gradient) sum += f(group);
    return sum / static_cast<double>(gradient.size());
  }
  [[nodiscard]] double relative() const {
    return mean_of_groups([](const GradientDifference& g) { return g.relative(); });
  }
  [[nodiscard]] double cosine() const {
    return mean_of_groups([](const GradientDifference& g) { return g.cosine(); });
  }
  [[nodiscard]] double bias() const {
    return mean_of_groups([](const GradientDifference& g) { return g.bias(); });
  }
};

struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
  /// Aligned Markdown.
  [[nodiscard]] std::string markdown() const {
    std::vector<std::size_t> width;
    for (const std::string& column : columns) width.push_back(column.size());
    for (const std::vector<std::string>& row : rows) {
      for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], row[c].size());
    }
    const auto line = [&](const std::vector<std::string>& cells) {
      std::string text = "|";
      for (std::size_t c = 0; c < cells.size(); ++c) {
        const std::string space(width[c] - cells[c].size(), ' ');
        text.append(" ").append(c == 0 ? cells[c] : space).append(c == 0 ? space : cells[c]).append(" |");
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
    for (const std::string& column : columns) text += "<th>" + tool::escape_html(column) + "</th>";
    text += "</tr>";
    for (const std::vector<std::string>& row : rows) {
      text += "<tr>";
      for (const std::string& cell : row) text += "<td>" + tool::escape_html(cell) + "</td>";
      text += "</tr>";
    }
    return text + "</table>\n";
  }
};

}  // namespace accuracy_bench
