// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Runs the points of rate-distortion curves (curves.hpp) one after the other, each a training for a codec, or a file
// of another point's training.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../compmark/plain_page.hpp"
#include "command_line.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/json_file.hpp"
#include "curves.hpp"
#include "run_cell.hpp"
#include "steps.hpp"
#include "stopping.hpp"

namespace fidelity {

/// A point that is to be there, and its folder.
struct WantedPoint {
  Cell cell;
  Settings settings;

  [[nodiscard]] fs::path folder() const { return settings.out / curve_name(cell, settings); }
};

/// The point whose training this one's file has; itself where its codec has a training of its own.
[[nodiscard]] inline WantedPoint training_of(const WantedPoint& wanted) {
  return {training_of(wanted.cell), wanted.settings};
}
/// The SHA-256 of the model that the results in a folder are of; empty where there are none.
[[nodiscard]] inline std::string trained_model(const fs::path& folder) {
  const Result<nlohmann::json> results = compmark::read_json(folder / "results.json");
  return results && results->is_object() && results->contains("model_sha256") && (*results)["model_sha256"].is_string()
             ? (*results)["model_sha256"].get<std::string>()
             : std::string();
}
/// Whether its file is there; one of another point's training must be of the model that is there now.
[[nodiscard]] inline bool is_coded(const WantedPoint& wanted) {
  const fs::path folder = wanted.folder(), trained = training_of(wanted).folder();
  if (trained == folder) return is_trained(folder);
  return is_trained(folder) && is_trained(trained) && trained_model(folder) == trained_model(trained);
}

/// Empty: it is not finished.
[[nodiscard]] inline std::optional<CurvePoint> finished(const WantedPoint& wanted) {
  const fs::path folder = wanted.folder();
  if (!is_of(folder, curve_settings_json(wanted.cell, wanted.settings)) || !is_coded(wanted)) return {};
  Result<CurvePoint> point = read_curve_point(wanted.cell, wanted.settings, folder);
  return point ? std::optional<CurvePoint>(std::move(*point)) : std::nullopt;
}

/// Makes what of a point is missing, the training that it shares with another point first. Empty: the run was stopped.
[[nodiscard]] inline Result<std::optional<CurvePoint>> finish(const char* program, const WantedPoint& wanted,
                                                              const Steps& steps) {
  const fs::path folder = wanted.folder();
  const WantedPoint training = training_of(wanted);
  const bool own = training.folder() == folder;
  if (!own) {
    Result<std::optional<CurvePoint>> trained = finish(program, training, steps);
    if (!trained || !*trained) return trained;
  }
  if (Result<Done> opened = open_folder(folder, curve_settings_json(wanted.cell, wanted.settings)); !opened)
    return opened.error();
  if (!is_coded(wanted)) {
    const Result<bool> made = take_step(program, curve_name(wanted.cell, wanted.settings), steps,
                                        own ? Step::train_coded : Step::compress, wanted.cell, wanted.settings, folder);
    if (!made) return made.error();
    if (!*made) return std::optional<CurvePoint>();
  }
  Result<CurvePoint> point = read_curve_point(wanted.cell, wanted.settings, folder);
  if (!point) return point.error();
  return std::optional<CurvePoint>(std::move(*point));
}

/// What was measured and how.
[[nodiscard]] inline std::string curve_head(const Settings& settings, const std::vector<CurvePoint>& points) {
  std::string text = tool::format_text("%lld iterations", static_cast<long long>(settings.iterations));
  for (const std::string& word : words_that_count(settings.extra)) text += " " + word;
  std::vector<std::string> named;
  for (const CurvePoint& point : points) {
    if (point.scene.downscale == 1 || std::find(named.begin(), named.end(), point.scene.name) != named.end()) continue;
    named.push_back(point.scene.name);
    text += tool::format_text("; %s at 1 / %g of its size", point.scene.name.c_str(), point.scene.downscale);
  }
  text += ". Every point is a training, measured in its test views from the file, all bytes counted.";
  std::vector<std::string> sharing;
  for (const CurvePoint& point : points) {
    const std::string trained = compmark::trained_codec(point.codec);
    if (trained == point.codec || std::find(sharing.begin(), sharing.end(), point.codec) != sharing.end()) continue;
    sharing.push_back(point.codec);
    text +=
        " The files of " + point.codec + " are of the trainings for " + trained + ", and decode to the same models.";
  }
  return text;
}

/// The tables, that of the deltas first, if there is more than one codec.
[[nodiscard]] inline std::string curve_markdown(const std::vector<CurvePoint>& points,
                                                const std::vector<std::string>& codecs) {
  const std::vector<CurveDelta> deltas = curve_deltas(points, codecs);
  return (deltas.empty() ? std::string() : delta_table(deltas).markdown() + "\n") + curve_table(points).markdown();
}

[[nodiscard]] inline Result<Done> write_curves(const Settings& settings, const std::vector<CurvePoint>& points,
                                               const std::vector<std::string>& codecs) {
  const HoldStop hold;
  const std::vector<CurveDelta> deltas = curve_deltas(points, codecs);
  const std::string head = curve_head(settings, points);
  const std::string note =
      deltas.empty()
          ? std::string()
          : "BD-rate: bytes at equal quality, below 0 fewer; BD-PSNR: decibels at equal bytes; means over what "
            "both curves reach (Bjontegaard, monotone cubics over log bytes), without points that another one of the "
            "same codec beats. One run a point.";
  const fs::path base = settings.out / "rate_distortion";
  const auto file = [&](const char* end) { return fs::path(base.string() + end); };
  if (Result<Done> r = compmark::write_json(file(".json"), curve_json(settings, points, codecs)); !r) return r;
  const std::string text = "# Rate and distortion\n\n" + head + "\n\n" + curve_markdown(points, codecs) +
                           (note.empty() ? note : "\n" + note + "\n");
  if (Result<Done> r = compmark::write_file(file(".md"), text); !r) return r;
  const std::vector<tool::Plot> plots = curve_plots(points, codecs);
  const std::string body =
      (deltas.empty() ? std::string() : delta_table(deltas).html() + "<p></p>") + curve_table(points).html();
  return tool::write_pages(file(".html"), file(".svg"), tool::html_page("Rate and distortion", head, plots, note, body),
                           {plots[0]});
}

/// Every scene with every codec and every lambda.
[[nodiscard]] inline std::vector<WantedPoint> wanted_points(const Settings& settings, const std::vector<Scene>& scenes,
                                                            const std::vector<std::string>& codecs,
                                                            const std::vector<double>& lambdas) {
  std::vector<WantedPoint> wanted;
  for (const Scene& scene : scenes) {
    for (const std::string& codec : codecs) {
      for (const double lambda : lambdas) {
        wanted.push_back({{scene, codec}, settings});
        wanted.back().settings.rate_lambda = lambda;
      }
    }
  }
  return wanted;
}

/// Runs those that are not finished, and writes the page after each: rate_distortion.json, .md, .html and .svg. Exit
/// code 1 where a point is not there in the end, 2 where a page could not be written.
[[nodiscard]] inline RunEnd run_curves(const char* program, const Settings& settings,
                                       const std::vector<WantedPoint>& wanted, const std::vector<std::string>& codecs,
                                       const Steps& steps) {
  std::vector<std::optional<CurvePoint>> points;
  for (const WantedPoint& one : wanted) points.push_back(finished(one));
  const auto found = [&] {
    std::vector<CurvePoint> all;
    for (const std::optional<CurvePoint>& point : points) {
      if (point) all.push_back(*point);
    }
    return all;
  };
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (points[i]) continue;
    Result<std::optional<CurvePoint>> point = finish(program, wanted[i], steps);
    if (!point) {
      fail(program, point.error());  // the other points are worth having
      continue;
    }
    if (!*point) {
      std::fprintf(stderr, "%s: stopped; the same command goes on\n", program);
      return {stopped_exit, {}};
    }
    points[i] = std::move(**point);
    if (Result<Done> written = write_curves(settings, found(), codecs); !written)
      return RunEnd{fail(program, written.error()), {}};
  }
  const std::vector<CurvePoint> all = found();
  RunEnd end;
  if (!all.empty()) {
    if (Result<Done> written = write_curves(settings, all, codecs); !written)
      return RunEnd{fail(program, written.error()), {}};
    end.table = curve_markdown(all, codecs);
  }
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (!points[i])
      std::fprintf(stderr, "%s: not there: %s\n", program, curve_name(wanted[i].cell, wanted[i].settings).c_str());
  }
  end.code = all.size() == wanted.size() ? 0 : 1;
  return end;
}

}  // namespace fidelity
