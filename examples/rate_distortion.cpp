// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Rate-distortion curves: scenes x codecs x lambda, each point a training of its own (compmark train --codec), measured
// from its file; and how many bytes one codec takes less than the other for the same quality.
//
//   rate_distortion --data SCENE[@DOWNSCALE] ... --out DIR [--codecs C ...] [--lambdas L ...] [--iterations N] [words
//     for compmark train]
//
// What is finished is not run again, what was stopped goes on. DIR/rate_distortion.json, .md, .html and .svg (the first
// plot) are written after each point, and have the finished points of earlier commands for these scenes, codecs and
// lambdas. LPIPS is measured where --lpips-alex FILE is among the words of the first command. Cost: a training for a
// codec each.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/io/atomic_file.hpp"
#include "compmark/io/json_file.hpp"
#include "fidelity/cell.hpp"
#include "fidelity/command_line.hpp"
#include "fidelity/curves.hpp"
#include "fidelity/fitted.hpp"
#include "fidelity/process.hpp"
#include "fidelity/run_cell.hpp"
#include "fidelity/scenes.hpp"

namespace {

using namespace fidelity;

constexpr const char* program = "rate_distortion";

int fail(const Error& error) { return fidelity::fail(program, error); }

/// A point that is to be there, and its folder.
struct Wanted {
  Cell cell;
  Settings settings;

  [[nodiscard]] fs::path folder() const { return settings.out / curve_name(cell, settings); }
};

/// Empty: it is not finished.
std::optional<CurvePoint> finished(const Wanted& wanted) {
  const fs::path folder = wanted.folder();
  if (!is_of(folder, curve_settings_json(wanted.cell, wanted.settings)) || !is_trained(folder)) return {};
  Result<CurvePoint> point = read_curve_point(wanted.cell, wanted.settings, folder);
  return point ? std::optional<CurvePoint>(std::move(*point)) : std::nullopt;
}

/// Trains what of a point is missing. Empty: the run was stopped.
Result<std::optional<CurvePoint>> finish(const Wanted& wanted) {
  const fs::path folder = wanted.folder();
  if (Result<Done> opened = open_folder(folder, curve_settings_json(wanted.cell, wanted.settings)); !opened)
    return opened.error();
  if (!is_trained(folder)) {
    const Result<bool> trained = run_step(program, curve_name(wanted.cell, wanted.settings), "train",
                                          host_command(wanted.cell, wanted.settings, folder), folder);
    if (!trained) return trained.error();
    if (!*trained || stopped()) return std::optional<CurvePoint>();
  }
  Result<CurvePoint> point = read_curve_point(wanted.cell, wanted.settings, folder);
  if (!point) return point.error();
  return std::optional<CurvePoint>(std::move(*point));
}

/// What was measured and how.
std::string head_text(const Settings& settings, const std::vector<CurvePoint>& points) {
  std::string text = tool::format_text("%lld iterations", static_cast<long long>(settings.iterations));
  for (const std::string& word : words_that_count(settings.extra)) text += " " + word;
  std::vector<std::string> named;
  for (const CurvePoint& point : points) {
    if (point.scene.downscale == 1 || std::find(named.begin(), named.end(), point.scene.name) != named.end()) continue;
    named.push_back(point.scene.name);
    text += tool::format_text("; %s at 1 / %g of its size", point.scene.name.c_str(), point.scene.downscale);
  }
  return text + ". Every point is a training, measured in its test views from the file, all bytes counted.";
}

/// The tables, that of the deltas first, if there is more than one codec.
std::string markdown_of(const std::vector<CurvePoint>& points, const std::vector<std::string>& codecs) {
  const std::vector<CurveDelta> deltas = curve_deltas(points, codecs);
  return (deltas.empty() ? std::string() : delta_table(deltas).markdown() + "\n") + curve_table(points).markdown();
}

Result<Done> write_page(const Settings& settings, const std::vector<CurvePoint>& points,
                        const std::vector<std::string>& codecs) {
  const std::vector<CurveDelta> deltas = curve_deltas(points, codecs);
  const std::string head = head_text(settings, points);
  const std::string note =
      deltas.empty()
          ? std::string()
          : "BD-rate: bytes at equal quality, below 0 fewer; BD-PSNR: decibels at equal bytes; means over what "
            "both curves reach (Bjontegaard, monotone cubics over log bytes), without points that another one of the "
            "same codec beats. One run a point.";
  const fs::path base = settings.out / "rate_distortion";
  const auto file = [&](const char* end) { return fs::path(base.string() + end); };
  if (Result<Done> r = compmark::write_json(file(".json"), curve_json(settings, points, codecs)); !r) return r;
  const std::string text = "# Rate and distortion\n\n" + head + "\n\n" + markdown_of(points, codecs) +
                           (note.empty() ? note : "\n" + note + "\n");
  if (Result<Done> r = compmark::write_file(file(".md"), text); !r) return r;
  const std::vector<tool::Plot> plots = curve_plots(points, codecs);
  const std::string body =
      (deltas.empty() ? std::string() : delta_table(deltas).html() + "<p></p>") + curve_table(points).html();
  return tool::write_pages(file(".html"), file(".svg"), tool::html_page("Rate and distortion", head, plots, note, body),
                           {plots[0]});
}

/// Each once, in the order in which it first comes.
template <class T>
std::vector<T> once(const std::vector<T>& values) {
  std::vector<T> each;
  for (const T& value : values) {
    if (std::find(each.begin(), each.end(), value) == each.end()) each.push_back(value);
  }
  return each;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "rate-distortion curves of the codecs over lambda; options that are not of this list are given to compmark "
      "train"};
  Settings settings;
  std::vector<std::string> data, codecs = {"hac", "context_gs"};
  std::vector<double> lambdas = {0.0005, 0.001, 0.002, 0.004};
  app.add_option("--data", data, "scenes, or folders of scenes; SCENE@2 at half its size")->required();
  app.add_option("--lambdas", lambdas, "losses of one bit more a scalar, a point each")
      ->capture_default_str()
      ->check(tool::in_range(tool::share_range));
  add_iterations(app, settings);
  add_codecs(app, codecs);
  add_settings(app, settings, argv[0]);
  if (const std::optional<int> over = parse(app, argc, argv)) return *over;
  codecs = once(codecs);
  lambdas = once(lambdas);
  if (word_of_the_cells(app.remaining(), {"--lambda"}) == "--lambda")
    return fail({ErrorKind::invalid, {}, "--lambda", "cannot be given", "give --lambdas: every point has its own"});
  std::vector<std::string> of_a_mark(mark_option_names.begin(), mark_option_names.end());
  of_a_mark.emplace_back("--bits");
  if (const std::optional<std::string> own = word_of_the_cells(app.remaining(), of_a_mark))
    return fail({ErrorKind::invalid, {}, *own, "cannot be given", "leave it out: a curve has its own, and no message"});
  settings.extra = train_words(app.remaining());
  const Result<std::vector<Scene>> scenes = scenes_of(program, data);
  if (!scenes) return fail(scenes.error());
  if (Result<Done> made = make_run_folder(settings); !made) return fail(made.error());

  std::vector<Wanted> wanted;
  for (const Scene& scene : *scenes) {
    for (const std::string& codec : codecs) {
      for (const double lambda : lambdas) {
        wanted.push_back({{scene, codec}, settings});
        wanted.back().settings.rate_lambda = lambda;
      }
    }
  }
  watch_stop();
  std::vector<std::optional<CurvePoint>> points;
  for (const Wanted& one : wanted) points.push_back(finished(one));
  const auto found = [&] {
    std::vector<CurvePoint> all;
    for (const std::optional<CurvePoint>& point : points) {
      if (point) all.push_back(*point);
    }
    return all;
  };
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (points[i]) continue;
    Result<std::optional<CurvePoint>> point = finish(wanted[i]);
    if (!point) {
      fail(point.error());  // the other points are worth having
      continue;
    }
    if (!*point || stopped()) {
      std::fprintf(stderr, "%s: stopped; the same command goes on\n", program);
      return stopped_exit;
    }
    points[i] = std::move(**point);
    if (Result<Done> written = write_page(settings, found(), codecs); !written) return fail(written.error());
  }
  const std::vector<CurvePoint> all = found();
  if (!all.empty()) {
    if (Result<Done> written = write_page(settings, all, codecs); !written) return fail(written.error());
    std::printf("%s", markdown_of(all, codecs).c_str());
  }
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (!points[i])
      std::fprintf(stderr, "%s: not there: %s\n", program, curve_name(wanted[i].cell, wanted[i].settings).c_str());
  }
  return all.size() == wanted.size() ? 0 : 1;
}
