// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Accuracy against time, whole: what a marked, compressed scene costs in minutes and bytes and gives in decibels and
// bits, for the presets of the tool with both codecs and for one change at a time from the standard one.
//
//   tradeoff --data SCENE[@DOWNSCALE] --out DIR [--points NAME ...] [words for compmark train]
//
// Every point is a cell of the fidelity table (examples/fidelity/cell.hpp) in a folder of its own; points that differ
// in the mark alone share the training and the decoder. What is finished is not run again, what was stopped goes on.
// DIR/tradeoff.json, .md, .html and .svg are written after each. Cost: that of its points; the presets alone are 84,000
// iterations of training and 26,000 of the mark.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/io/atomic_file.hpp"
#include "compmark/io/json_file.hpp"
#include "fidelity/cell.hpp"
#include "fidelity/command_line.hpp"
#include "fidelity/points.hpp"
#include "fidelity/process.hpp"
#include "fidelity/run_cell.hpp"
#include "fidelity/scenes.hpp"

namespace {

using namespace fidelity;

constexpr const char* program = "tradeoff";

int fail(const Error& error) { return fidelity::fail(program, error); }

Cell cell_of(const Scene& scene, const Point& point) {
  Cell cell{scene, point.codec};
  cell.scene.name = point.name;
  return cell;
}

Settings settings_of(Settings settings, const Point& point) {
  settings.iterations = point.iterations;
  settings.rate_lambda = point.rate_lambda;
  settings.extra.insert(settings.extra.begin(), point.words.begin(), point.words.end());
  return settings;
}

/// Whether a point's training is over and its decoder fitted.
bool has_host(const fs::path& folder) {
  return fs::exists(folder / "unmarked/results.json") && !fs::exists(folder / "unmarked/checkpoint.safetensors") &&
         fs::exists(folder / "decoder.safetensors") && fs::exists(folder / "decoder.json");
}

/// The training and the decoder of a point with the same host, for one that has none: `train --resume` takes what is
/// there.
Result<Done> share_host(const fs::path& from, const fs::path& to) {
  if (fs::exists(to / "unmarked")) return Done{};
  std::error_code status;
  const fs::path partial = to / "unmarked.partial";
  fs::remove_all(partial, status);
  const auto failed = [&](const fs::path& path) {
    return Error{ErrorKind::unwritable, path.string(), {}, status.message(), "is there room on the disk?"};
  };
  fs::create_directories(to, status);
  fs::copy(from / "unmarked", partial, fs::copy_options::recursive, status);
  if (status) return failed(partial);
  for (const char* file : {"decoder.safetensors", "decoder.json"}) {
    fs::copy_file(from / file, to / file, fs::copy_options::overwrite_existing, status);
    if (status) return failed(to / file);
  }
  fs::rename(partial, to / "unmarked", status);  // whole, or not there
  if (status) return failed(to / "unmarked");
  return Done{};
}

Result<Done> write_page(const Settings& settings, const Scene& scene, const std::vector<PricedPoint>& points) {
  const tool::Table table = price_table(points);
  const std::vector<tool::Plot> plots = price_plots(points);
  const std::string head =
      scene.name + tool::format_text(
                       " at 1 / %g of its size: from photographs to a marked file, %d bits, test views read one by one "
                       "from the file. Seconds are those of the iterations and of the fit, on this machine.",
                       scene.downscale, settings.bits);
  const std::string note =
      "* No other point is as good in minutes, bytes, decibels and bits and better in one of them.";
  if (Result<Done> r = compmark::write_json(settings.out / "tradeoff.json", price_json(scene, settings, points)); !r)
    return r;
  if (Result<Done> r =
          compmark::write_file(settings.out / "tradeoff.md", head + "\n\n" + table.markdown() + "\n" + note + "\n");
      !r)
    return r;
  return tool::write_pages(settings.out / "tradeoff.html", settings.out / "tradeoff.svg",
                           tool::html_page("Accuracy against time, whole", head, plots, note, table), plots);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "accuracy against time, whole: marked and compressed scenes by preset; options that are not of this list are "
      "given to compmark train"};
  Settings settings;
  std::string data;
  std::vector<std::string> chosen;
  app.add_option("--data", data, "a scene; SCENE@2 at half its size")->required();
  app.add_option("--points", chosen, "of those that --list names (default: all)");
  const std::vector<Point> points = all_points();
  app.add_flag_callback(
      "--list",
      [&] {
        for (const Point& point : points) std::printf("%s\n", point.label().c_str());
        throw CLI::Success();
      },
      "names the points and ends");
  add_bits(app, settings);
  add_settings(app, settings, argv[0]);
  if (const std::optional<int> over = parse(app, argc, argv)) return *over;
  for (const std::string& name : chosen) {
    if (std::none_of(points.begin(), points.end(), [&](const Point& point) { return point.label() == name; }))
      return fail({ErrorKind::invalid, {}, "--points", "names no point: " + name, "--list names them"});
  }
  if (const std::optional<std::string> own =
          word_of_the_cells(app.remaining(), {"--iterations", "--lambda", "--mark-iterations", "--fidelity"}))
    return fail({ErrorKind::invalid, {}, *own, "cannot be given", "the points have their own"});
  settings.extra = train_words(app.remaining());
  const Result<std::vector<Scene>> scenes = scenes_of(program, std::vector<std::string>{data});
  if (!scenes) return fail(scenes.error());
  if (scenes->size() != 1)
    return fail({ErrorKind::invalid, data, "--data", "holds more than one scene", "name one of them"});
  const Result<bool> opened = open_run(settings);
  if (!opened) return fail(opened.error());
  if (!*opened) return 2;  // keygen said why

  watch_stop();
  const auto folder = [&](const Point& point) { return cell_of(scenes->front(), point).folder(settings); };
  const auto same_run = [&](const Point& point) {  // what is there was made with these settings
    return is_of(cell_of(scenes->front(), point), settings_of(settings, point));
  };
  std::vector<PricedPoint> finished;
  bool failed = false, written = false;
  for (const Point& point : points) {  // of earlier commands, so that the page has them whatever becomes of this one
    const Cell cell = cell_of(scenes->front(), point);
    const Settings own = settings_of(settings, point);
    if (!is_finished(cell, own)) continue;
    if (Result<Row> row = read_row(cell, own); row) finished.push_back({point, std::move(*row)});
  }
  for (const Point& point : points) {
    if (!chosen.empty() && std::find(chosen.begin(), chosen.end(), point.label()) == chosen.end()) continue;
    const auto is_this = [&](const PricedPoint& other) { return other.point.label() == point.label(); };
    if (std::any_of(finished.begin(), finished.end(), is_this)) continue;
    const auto host = std::find_if(points.begin(), points.end(), [&](const Point& other) {
      return other.same_host(point) && has_host(folder(other)) && same_run(other);
    });
    if (host != points.end()) {
      if (Result<Done> shared = share_host(folder(*host), folder(point)); !shared) return fail(shared.error());
    }
    Result<std::optional<Row>> row =
        finish_cell(program, cell_of(scenes->front(), point), settings_of(settings, point));
    if (!row) {
      fail(row.error());  // the other points are worth having
      failed = true;
      continue;
    }
    if (!*row || stopped()) {
      std::fprintf(stderr, "%s: stopped; the same command goes on\n", program);
      return stopped_exit;
    }
    finished.push_back({point, std::move(**row)});
    const auto place = [&](const PricedPoint& one) {
      return std::find_if(points.begin(), points.end(),
                          [&](const Point& other) { return other.label() == one.point.label(); });
    };
    std::sort(finished.begin(), finished.end(),
              [&](const PricedPoint& a, const PricedPoint& b) { return place(a) < place(b); });
    if (Result<Done> pages = write_page(settings, scenes->front(), finished); !pages) return fail(pages.error());
    written = true;
  }
  if (!finished.empty()) {
    if (!written && !failed) {  // nothing was left to run: as this version writes them
      if (Result<Done> pages = write_page(settings, scenes->front(), finished); !pages) return fail(pages.error());
    }
    std::printf("%s", price_table(finished).markdown().c_str());
  }
  return failed ? 1 : 0;
}
