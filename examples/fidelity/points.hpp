// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The runs of the page "accuracy against time, whole": every preset of the tool with both codecs, and one change at a
// time from the standard one. For each it has the cost (seconds, bytes) and the gain (decibels, bits, bits after edits
// of the pictures), and which other run is as good in all of them, if one is.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "../compmark/plain_page.hpp"
#include "../compmark/presets.hpp"
#include "cell.hpp"

namespace fidelity {

struct Point {
  std::string name;
  std::string codec;
  std::int64_t iterations = 0;
  double rate_lambda = 0;
  std::vector<std::string> words;  ///< options of `compmark train`
  bool fits = false;               ///< a decoder to the scene; else the decoder for every scene reads

  /// Of its folder too.
  [[nodiscard]] std::string label() const { return name + "_" + codec; }
  /// Whether the unmarked models of the two are the same.
  [[nodiscard]] bool same_unmarked_model(const Point& other) const {
    return codec == other.codec && iterations == other.iterations && rate_lambda == other.rate_lambda &&
           fits == other.fits;  // whose folder has the decoder too
  }
};

[[nodiscard]] inline std::vector<std::string> mark_words(std::int64_t iterations) {
  return {"--mark-iterations", std::to_string(iterations)};
}

/// The edits of docs/watermark.md's table that a picture suffers most from, at the strengths of that table.
[[nodiscard]] inline std::vector<std::string> point_attacks() {
  return {"jpeg:50",   "noise:0.1", "rotation:30",    "resize:0.5",   "crop:0.4", "blur:2",  "brightness:0.7",
          "gamma:0.8", "hue:10",    "brightness:1.3", "saturation:0", "frame:20", "chat:0.6"};
}

/// Those of the presets first.
[[nodiscard]] inline std::vector<Point> all_points() {
  std::vector<Point> points;
  for (const char* codec : {"hac", "context_gs"}) {
    for (const tool::Preset& preset : tool::presets) {
      points.push_back({preset.name, codec, preset.iterations, preset.rate_lambda, mark_words(preset.mark_iterations)});
    }
  }
  for (const tool::Preset& preset : tool::presets) {
    points.push_back({std::string(preset.name) + "_fit", "hac", preset.iterations, preset.rate_lambda,
                      mark_words(preset.mark_iterations), true});
  }
  constexpr const tool::Preset& standard = tool::presets[1];
  static_assert(std::string_view(standard.name) == "standard");
  const auto from_standard = [&](const char* name, std::vector<std::string> words) {
    return Point{std::string("standard_") + name, "hac", standard.iterations, standard.rate_lambda, std::move(words)};
  };
  for (const auto& [name, factor] : {std::pair{"marked_shorter", 0.25}, std::pair{"marked_longer", 2.0}}) {
    points.push_back(from_standard(
        name, mark_words(static_cast<std::int64_t>(static_cast<double>(standard.mark_iterations) * factor))));
  }
  for (const char* fidelity : {"1000", "4000"}) {  // half and twice that of a universal decoder
    std::vector<std::string> words = mark_words(standard.mark_iterations);
    words.insert(words.end(), {"--fidelity", fidelity});
    points.push_back(from_standard((std::string("fidelity_") + fidelity).c_str(), std::move(words)));
  }
  for (const char* option : {"--edits", "--sample-by-loss"}) {
    std::vector<std::string> words = mark_words(standard.mark_iterations);
    words.insert(words.end(), {option, "0"});
    points.push_back(
        from_standard(std::string_view(option) == "--edits" ? "no_edits" : "equal_views", std::move(words)));
  }
  for (const auto& [name, lambda] : {std::pair{"larger_file", 0.0005}, std::pair{"smaller_file", 0.004}}) {
    points.push_back(from_standard(name, mark_words(standard.mark_iterations)));
    points.back().rate_lambda = lambda;
  }
  return points;
}

/// A finished point.
struct PricedPoint {
  Point point;
  Row row;

  [[nodiscard]] double seconds() const { return row.train_seconds + row.fit_seconds + row.mark_seconds; }
  [[nodiscard]] const Figures& file() const { return row.models[marked_coded]; }
  /// The edit of the pictures after which the fewest bits are right, with their share; nothing without edits.
  [[nodiscard]] std::optional<std::pair<std::string, double>> worst_edit() const {
    const auto least = std::min_element(file().attacked.begin(), file().attacked.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; });
    if (least == file().attacked.end()) return std::nullopt;
    return *least;
  }
  /// The share of the bits after an edit; nothing where it was not measured.
  [[nodiscard]] std::optional<double> after(const std::string& attack) const {
    for (const auto& [name, share] : file().attacked) {
      if (name == attack) return share;
    }
    return std::nullopt;
  }
  /// The cost, and the gain with its sign turned: less is better in all six.
  [[nodiscard]] std::array<double, 6> price() const {
    const auto edit = worst_edit();
    return {seconds(),
            file().bytes,
            -file().psnr,
            -file().accuracy,
            -after("jpeg:50").value_or(0),
            edit ? -edit->second : 0};
  }
};

/// What is as good in all six and better in one; empty for a point of the front.
[[nodiscard]] inline std::string beaten_by(const PricedPoint& one, const std::vector<PricedPoint>& all) {
  const std::array<double, 6> mine = one.price();
  const auto beats = [&](const PricedPoint& other) {
    const std::array<double, 6> theirs = other.price();
    bool better = false;
    for (std::size_t i = 0; i < mine.size(); ++i) {
      if (theirs[i] > mine[i]) return false;
      better = better || theirs[i] < mine[i];
    }
    return better;
  };
  const auto found = std::find_if(all.begin(), all.end(), beats);
  return found == all.end() ? std::string() : found->point.label();
}
[[nodiscard]] inline bool on_front(const PricedPoint& one, const std::vector<PricedPoint>& all) {
  return beaten_by(one, all).empty();
}

[[nodiscard]] inline tool::Table price_table(const std::vector<PricedPoint>& points) {
  const auto share_text = [](std::optional<double> share) {
    return share ? tool::format_text("%.1f", 100 * *share) : std::string();
  };
  tool::Table table;
  table.columns = {"settings",
                   "train, s",
                   "fit, s",
                   "mark, s",
                   "minutes",
                   "PSNR, dB",
                   "SSIM",
                   "bits right, %",
                   "worst, %",
                   "p, all views",
                   "kB",
                   "dB lost to the mark",
                   "bytes more",
                   "PSNR before, dB",
                   "iterations",
                   "lambda",
                   "after JPEG 50, %",
                   "after the worst edit, %",
                   "which",
                   "front"};
  for (const PricedPoint& one : points) {
    const Figures& file = one.file();
    const std::optional<std::pair<std::string, double>> edit = one.worst_edit();
    const std::string beaten = beaten_by(one, points);
    table.rows.push_back({one.point.label(),
                          tool::format_text("%.0f", one.row.train_seconds),
                          tool::format_text("%.0f", one.row.fit_seconds),
                          tool::format_text("%.0f", one.row.mark_seconds),
                          tool::format_text("%.1f", one.seconds() / 60),
                          tool::format_text("%.2f", file.psnr),
                          tool::format_text("%.4f", file.ssim),
                          tool::format_text("%.2f", 100 * file.accuracy),
                          tool::format_text("%.1f", 100 * file.worst),
                          tool::format_text("%.0e", file.p_value),
                          tool::format_text("%.0f", file.bytes / 1e3),
                          tool::format_text("%+.2f", one.row.lost(true)),
                          tool::format_text("%+.1f %%", 100 * one.row.more_bytes()),
                          tool::format_text("%.2f", one.row.models[marked].psnr),
                          std::to_string(one.point.iterations),
                          tool::format_text("%g", one.point.rate_lambda),
                          share_text(one.after("jpeg:50")),
                          edit ? share_text(edit->second) : "",
                          edit ? edit->first : "",
                          beaten.empty() ? "*" : "behind " + beaten});
  }
  return table;
}

/// Decibels, bits and bytes over minutes.
[[nodiscard]] inline std::vector<tool::Plot> price_plots(const std::vector<PricedPoint>& points) {
  const auto plot = [&](const char* title, const char* label, auto value) {
    tool::Plot made{
        .title = title, .x_label = "minutes, training to marked file", .y_label = label, .series = {}, .log_x = true};
    for (const auto& [codec, name, color] : {std::tuple("hac", "HAC", 0), std::tuple("context_gs", "ContextGS", 1)}) {
      tool::PlotSeries series{.label = name, .points = {}, .names = {}, .color = color, .line = false, .dots = true};
      for (const PricedPoint& one : points) {
        if (one.point.codec != codec) continue;
        series.points.push_back({one.seconds() / 60, value(one)});
        constexpr std::string_view base = "standard_";  // what a change is made to goes without saying
        const std::string& full = one.point.name;
        series.names.push_back(full.starts_with(base) ? full.substr(base.size()) : full);
        std::replace(series.names.back().begin(), series.names.back().end(), '_', ' ');
      }
      if (!series.points.empty()) made.series.push_back(std::move(series));
    }
    return made;
  };
  return {plot("PSNR of the marked file", "dB", [](const PricedPoint& one) { return one.file().psnr; }),
          plot("Bits right in a view", "%", [](const PricedPoint& one) { return 100 * one.file().accuracy; }),
          plot("Bits right after JPEG 50", "%",
               [](const PricedPoint& one) { return 100 * one.after("jpeg:50").value_or(0); }),
          plot("Size of the marked file", "kB", [](const PricedPoint& one) { return one.file().bytes / 1e3; })};
}

/// `settings.extra` are the options of `compmark train` that all points have in common.
[[nodiscard]] inline nlohmann::ordered_json price_json(const Scene& scene, const Settings& settings,
                                                       const std::vector<PricedPoint>& points) {
  nlohmann::ordered_json json = {{"schema", "compmark.tradeoff.1"},
                                 {"scene", scene.name},
                                 {"downscale", scene.downscale},
                                 {"bits", settings.bits},
                                 {"train", words_that_count(settings.extra)},
                                 {"points", nlohmann::ordered_json::array()}};
  for (const PricedPoint& one : points) {
    const Figures& file = one.file();
    json["points"].push_back(
        {{"name", one.point.label()},
         {"codec", one.point.codec},
         {"iterations", one.point.iterations},
         {"lambda", one.point.rate_lambda},
         {"train", one.point.words},
         {"seconds", {{"train", one.row.train_seconds}, {"fit", one.row.fit_seconds}, {"mark", one.row.mark_seconds}}},
         {"psnr", file.psnr},
         {"ssim", file.ssim},
         {"bit_accuracy", {{"mean", file.accuracy}, {"min", file.worst}, {"views", file.views}}},
         {"p_value", file.p_value},
         {"bytes", file.bytes},
         {"psnr_cost", one.row.lost(true)},
         {"more_bytes", one.row.more_bytes()},
         {"decoder", one.point.fits ? "fit" : "universal"},
         {"pareto", on_front(one, points)}});
    for (const auto& [name, share] : file.attacked) json["points"].back()["attacked"][name] = share;
    if (const std::string beaten = beaten_by(one, points); !beaten.empty()) json["points"].back()["behind"] = beaten;
  }
  return json;
}

}  // namespace fidelity
