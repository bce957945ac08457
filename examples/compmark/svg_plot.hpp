// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Line and scatter plots as inline SVG, for pages that open anywhere without a script. Colours come from the page's
// style sheet (plot_style), so that a plot follows the reader's light or dark theme.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

struct PlotSeries {
  std::string label;
  std::vector<std::array<double, 2>>
      points;  ///< x, y; a point that is not finite (or not positive on a log axis) is left out
  std::vector<std::string>
      /// text beside each point, may be shorter than points; with dots, which say it when they are pointed at, room or
      /// not
      names;
  int color = 0;  ///< 0 … 5, see plot_style
  bool line = true;
  bool dots = false;
  bool names_left = false;  ///< names stand left of and below their points instead of right and above
};

struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<PlotSeries> series;
  bool log_x = false;
  bool log_y = false;
  bool from_zero = false;  ///< the y axis starts at zero
  int width = 560;
  int height = 300;
};

/// Text for HTML and SVG.
inline std::string escape_html(std::string_view text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

/// printf into a string.
template <class... Arguments>
std::string format_text(const char* pattern, Arguments... arguments) {
  std::array<char, 512> text{};
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
#pragma GCC diagnostic ignored "-Wformat-security"
  const int size = std::snprintf(text.data(), text.size(), pattern, arguments...);
#pragma GCC diagnostic pop
  return {text.data(), size < 0 ? 0 : std::min(static_cast<std::size_t>(size), text.size() - 1)};
}

/// 1234567 as "1.23M": short enough for an axis.
inline std::string format_short(double value) {
  const double size = std::abs(value);
  if (size >= 1e6) return format_text("%.3gM", value / 1e6);
  if (size >= 1e4) return format_text("%.3gk", value / 1e3);
  return format_text("%.4g", value);
}

inline constexpr std::string_view plot_style = R"(
svg.plot{--c0:#2563eb;--c1:#dc6803;--c2:#0f9d6b;--c3:#9333ea;--c4:#c02655;--c5:#64748b;max-width:100%;height:auto;font:12px system-ui,sans-serif}
svg.plot text{fill:var(--soft)} svg.plot .title{fill:var(--ink);font-size:13px;font-weight:600}
svg.plot .grid{stroke:var(--line);stroke-width:1} svg.plot .axis{stroke:var(--soft);stroke-width:1}
svg.plot polyline{fill:none;stroke-width:1.6;stroke-linejoin:round}
@media(prefers-color-scheme:dark){svg.plot{--c0:#6ea8fe;--c1:#f5a95b;--c2:#4fd1a1;--c3:#c4a1ff;--c4:#ff86a5;--c5:#94a3b8}}
)";

namespace plot_detail {

struct Axis {
  double low = 0, high = 1;
  bool logarithmic = false;
  std::vector<double> ticks;
  [[nodiscard]] double place(double value) const {  // 0 … 1 along the axis
    if (logarithmic) return (std::log10(value) - std::log10(low)) / (std::log10(high) - std::log10(low));
    return (value - low) / (high - low);
  }
};

/// The least of 1, 2, 5, 10 times a power of ten that is not below `raw`.
inline double nice_step(double raw) {
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  return power * (raw / power > 5 ? 10 : (raw / power > 2 ? 5 : (raw / power > 1 ? 2 : 1)));
}

inline Axis make_axis(double low, double high, bool logarithmic, int wanted) {
  Axis axis;
  axis.logarithmic = logarithmic;
  if (!(low <= high)) low = logarithmic ? 1 : 0, high = logarithmic ? 10 : 1;
  if (logarithmic) {
    if (high / low < 1.5) low /= 1.25, high *= 1.25;
    axis.low = low / 1.06;
    axis.high = high * 1.06;
    if (high / low < 8) {  // less than a decade: round numbers of equal distance
      const double step = nice_step((high - low) / wanted);
      for (double tick = std::ceil(axis.low / step) * step; tick <= axis.high; tick += step) axis.ticks.push_back(tick);
      return axis;
    }
    const bool wide = high / low > 30;
    for (int decade = static_cast<int>(std::floor(std::log10(axis.low))); decade <= 12; ++decade) {
      for (const double digit : {1.0, 2.0, 5.0}) {
        if (wide && digit != 1.0) continue;
        const double tick = digit * std::pow(10.0, decade);
        if (tick >= axis.low && tick <= axis.high) axis.ticks.push_back(tick);
      }
    }
    return axis;
  }
  if (high - low <= 1e-12 * std::max(1.0, std::abs(high))) low -= 0.5, high += 0.5;
  const double step = nice_step((high - low) / wanted);
  axis.low = std::floor(low / step + 1e-9) * step;
  axis.high = std::ceil(high / step - 1e-9) * step;
  for (int i = 0; axis.low + i * step <= axis.high + 0.5 * step; ++i) {
    const double tick = axis.low + i * step;
    axis.ticks.push_back(std::abs(tick) < 1e-9 * step ? 0 : tick);
  }
  return axis;
}

struct Box {
  double left = 0, top = 0, right = 0, bottom = 0;
  [[nodiscard]] bool meets(const Box& other) const {
    return left < other.right && other.left < right && top < other.bottom && other.top < bottom;
  }
  [[nodiscard]] bool holds(const Box& other) const {
    return left <= other.left && other.right <= right && top <= other.top && other.bottom <= bottom;
  }
};

/// Finds room for names: beside their dots, on no other dot and no other name.
class NamePlaces {
 public:
  struct Place {
    double x = 0, y = 0;
    const char* anchor = "start";
    bool far = false;  ///< so that a line has to lead there
  };
  explicit NamePlaces(const Box& frame) : frame_(frame) {}
  void add_dot(double x, double y) {
    taken_.push_back({x - radius, y - radius, x + radius, y + radius});
    dots_.push_back({x, y});
  }
  /// For a name of so many letters at the dot (x, y); `left` of it and `below` it are tried first. None if it is
  /// crowded.
  std::optional<Place> find(double x, double y, std::size_t letters, bool left, bool below) {
    const double wide = 6.4 * static_cast<double>(letters);  // of 12 pixels' text, in the mean
    for (const double away : {6.0, 18.0, 30.0, 42.0}) {
      for (int choice = 0; choice < 4; ++choice) {
        const bool to_left = left != (choice % 2 == 1), under = below != (choice >= 2);
        const Place place{x + (to_left ? -6 : 6), under ? y + away + 7 : y - away + 1, to_left ? "end" : "start",
                          away > 6};
        const double begin = to_left ? place.x - wide : place.x;
        const Box box{begin, place.y - 10, begin + wide, place.y + 3};
        if (!frame_.holds(box)) continue;
        if (std::any_of(taken_.begin(), taken_.end(), [&](const Box& other) { return box.meets(other); })) continue;
        // Without a line a name is taken for that of the dot that is nearest to it.
        const auto distance = [&](double dot_x, double dot_y) {
          return std::hypot(dot_x - std::clamp(dot_x, box.left, box.right),
                            dot_y - std::clamp(dot_y, box.top, box.bottom));
        };
        const bool mistaken = std::any_of(dots_.begin(), dots_.end(), [&](const std::array<double, 2>& dot) {
          return distance(dot[0], dot[1]) < distance(x, y);
        });
        if (mistaken && !place.far) continue;
        taken_.push_back(box);
        return place;
      }
    }
    return std::nullopt;
  }

 private:
  static constexpr double radius = 3.2;
  Box frame_;
  std::vector<Box> taken_;
  std::vector<std::array<double, 2>> dots_;
};

}  // namespace plot_detail

/// The plot as one <svg> element; needs plot_style and the variables --ink, --soft and --line in the page.
inline std::string svg(const Plot& plot) {
  const auto usable = [&](const std::array<double, 2>& p) {
    return std::isfinite(p[0]) && std::isfinite(p[1]) && (!plot.log_x || p[0] > 0) && (!plot.log_y || p[1] > 0);
  };
  double low_x = INFINITY, high_x = -INFINITY, low_y = INFINITY, high_y = -INFINITY;
  for (const PlotSeries& series : plot.series) {
    for (const std::array<double, 2>& p : series.points) {
      if (!usable(p)) continue;
      low_x = std::min(low_x, p[0]), high_x = std::max(high_x, p[0]);
      low_y = std::min(low_y, p[1]), high_y = std::max(high_y, p[1]);
    }
  }
  const bool empty = !(low_x <= high_x);
  if (plot.from_zero && !empty) low_y = std::min(low_y, 0.0);
  const plot_detail::Axis x = plot_detail::make_axis(low_x, high_x, plot.log_x, 6);
  const plot_detail::Axis y = plot_detail::make_axis(low_y, high_y, plot.log_y, 5);
  const double left = 58, right = 14, top = 30, bottom = 42;
  const double wide = plot.width - left - right, tall = plot.height - top - bottom;
  const auto at_x = [&](double value) { return left + wide * x.place(value); };
  const auto at_y = [&](double value) { return top + tall * (1 - y.place(value)); };

  std::string out = format_text("<svg class=\"plot\" viewBox=\"0 0 %d %d\" width=\"%d\" height=\"%d\" role=\"img\">",
                                plot.width, plot.height, plot.width, plot.height);
  out += "<title>" + escape_html(plot.title) + "</title>";
  out += format_text("<text class=\"title\" x=\"%.0f\" y=\"17\">", left) + escape_html(plot.title) + "</text>";
  for (const double tick : y.ticks) {
    out += format_text("<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>", left, left + wide,
                       at_y(tick), at_y(tick));
    out += format_text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">", left - 6, at_y(tick) + 4) +
           format_short(tick) + "</text>";
  }
  for (const double tick : x.ticks) {
    out += format_text("<line class=\"grid\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>", at_x(tick), at_x(tick),
                       top, top + tall);
    out += format_text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">", at_x(tick), top + tall + 16) +
           format_short(tick) + "</text>";
  }
  out += format_text("<line class=\"axis\" x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\"/>", left, left + wide,
                     top + tall, top + tall);
  out += format_text("<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">", left + wide / 2, plot.height - 6) +
         escape_html(plot.x_label) + "</text>";
  out += format_text("<text x=\"14\" y=\"%.1f\" text-anchor=\"middle\" transform=\"rotate(-90 14 %.1f)\">",
                     top + tall / 2, top + tall / 2) +
         escape_html(plot.y_label) + "</text>";
  if (empty) {
    out += format_text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">no data</text>", left + wide / 2,
                       top + tall / 2);
  }
  double legend_x = plot.width - right;
  for (std::size_t s = plot.series.size(); s-- > 0;) {  // right to left, above the frame
    const PlotSeries& series = plot.series[s];
    if (plot.series.size() < 2 || series.label.empty()) continue;
    out += format_text("<text x=\"%.1f\" y=\"17\" text-anchor=\"end\" style=\"fill:var(--c%d)\">", legend_x,
                       series.color) +
           escape_html(series.label) + "</text>";
    legend_x -= 7.0 * static_cast<double>(series.label.size()) + 16;
  }
  plot_detail::NamePlaces places({left, top - 12, left + wide + right, top + tall});
  for (const PlotSeries& series : plot.series) {
    if (!series.dots) continue;
    for (const std::array<double, 2>& p : series.points) {
      if (usable(p)) places.add_dot(at_x(p[0]), at_y(p[1]));
    }
  }
  for (const PlotSeries& series : plot.series) {
    if (series.line) {
      out += format_text("<polyline style=\"stroke:var(--c%d)\" points=\"", series.color);
      for (const std::array<double, 2>& p : series.points) {
        if (usable(p)) out += format_text("%.1f,%.1f ", at_x(p[0]), at_y(p[1]));
      }
      out += "\"/>";
    }
    for (std::size_t i = 0; i < series.points.size(); ++i) {
      const std::array<double, 2>& p = series.points[i];
      if (!usable(p)) continue;
      const std::string name = i < series.names.size() ? escape_html(series.names[i]) : std::string();
      if (series.dots) {
        out += format_text("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3.2\" style=\"fill:var(--c%d)\">", at_x(p[0]),
                           at_y(p[1]), series.color) +
               (name.empty()
                    ? ""
                    : "<title>" + name + (series.label.empty() ? "" : ", " + escape_html(series.label)) + "</title>") +
               "</circle>";
      }
      if (name.empty()) continue;
      const bool left_side = at_x(p[0]) > left + (series.names_left ? 110 : 0.8 * wide);
      const auto place = places.find(at_x(p[0]), at_y(p[1]), series.names[i].size(), left_side, series.names_left);
      if (!place) continue;
      if (place->far) {
        out += format_text(
            "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" style=\"stroke:var(--c%d);opacity:.5\"/>",
            at_x(p[0]), at_y(p[1]), place->x, place->y - (place->y < at_y(p[1]) ? 0 : 8), series.color);
      }
      out += format_text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\"", place->x, place->y, place->anchor) +
             (plot.series.size() < 2 ? "" : format_text(" style=\"fill:var(--c%d)\"", series.color)) + ">" + name +
             "</text>";
    }
  }
  return out + "</svg>";
}

/// Plots under one another as a file of its own, with the colours that a page would give them.
inline std::string standalone_svg(const std::vector<Plot>& plots) {
  int width = 0, height = 0;
  std::string inside;
  for (const Plot& plot : plots) {
    std::string one = svg(plot);
    const std::string head = "<svg class=\"plot\"";  // whose style lets a page shrink it
    one.replace(one.find(head), head.size(), head + format_text(" style=\"height:%dpx;max-width:none\"", plot.height));
    inside += format_text("<g transform=\"translate(0 %d)\">", height) + one + "</g>";
    width = std::max(width, plot.width);
    height += plot.height;
  }
  return format_text(
             "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" viewBox=\"0 0 %d %d\" width=\"%d\" "
             "height=\"%d\">",
             width, height, width, height) +
         "<title>" + (plots.empty() ? "" : escape_html(plots.front().title)) +
         "</title>"
         "<style>svg{--ink:#16202c;--soft:#5b6878;--line:#dfe4ea;--paper:#fff}@media(prefers-color-scheme:dark){"
         "svg{--ink:#e6ebf1;--soft:#98a5b5;--line:#2d3742;--paper:#12171d}}" +
         std::string(plot_style) + "</style><rect width=\"100%\" height=\"100%\" style=\"fill:var(--paper)\"/>" +
         inside + "</svg>\n";
}

}  // namespace tool
