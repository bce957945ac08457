// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Accuracy against time, whole: what a marked, compressed scene costs in minutes and bytes and gives in decibels and
// bits, for the presets of the tool with both codecs and for one change at a time from the standard one.
//
//   tradeoff --data SCENE[@DOWNSCALE] --out DIR [--points NAME ...] [options of compmark train]
//
// Every point is a cell of the fidelity table (examples/fidelity/cell.hpp) in a folder of its own; points that differ
// in the mark alone share the training and the decoder. What is finished is not run again, what was stopped goes on.
// DIR/tradeoff.json, .md, .html and .svg are written after each. Cost: that of its points; the presets alone are 84,000
// iterations of training and 26,000 of the mark.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "compmark/options.hpp"
#include "compmark/process.hpp"
#include "fidelity/cell.hpp"
#include "fidelity/command_line.hpp"
#include "fidelity/points.hpp"
#include "fidelity/price_run.hpp"
#include "fidelity/run_cell.hpp"
#include "fidelity/scenes.hpp"
#include "fidelity/steps.hpp"
#include "fidelity/stopping.hpp"

namespace {

using namespace fidelity;

constexpr const char* program = "tradeoff";

int fail(const Error& error) { return fidelity::fail(program, error); }

int run(int argc, char** argv) {
  CLI::App app{
      "accuracy against time, whole: marked and compressed scenes by preset; options that are not of this list are "
      "those of compmark train"};
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
  add_settings(app, settings, program);
  if (const std::optional<int> over = parse(app, argc, argv)) return *over;
  for (const std::string& name : chosen) {
    if (std::none_of(points.begin(), points.end(), [&](const Point& point) { return point.label() == name; }))
      return fail({ErrorKind::invalid, {}, "--points", "names no point: " + name, "--list names them"});
  }
  if (const std::optional<std::string> own = word_of_the_cells(
          tool::with_new_names(app.remaining()), {"--iterations", "--lambda", "--mark-iterations", "--fidelity"}))
    return fail({ErrorKind::invalid, {}, *own, "cannot be given", "the points have their own"});
  settings.extra = train_words(app.remaining());
  const Result<std::vector<Scene>> scenes = scenes_of(program, std::vector<std::string>{data});
  if (!scenes) return fail(scenes.error());
  if (scenes->size() != 1)
    return fail({ErrorKind::invalid, data, "--data", "holds more than one scene", "name one of them"});
  const FunctionSteps steps;
  for (const Point& point : points) {
    const Result<Done> right = check_words(cell_of(scenes->front(), point), settings_of(settings, point), steps);
    if (!right) return fail(right.error());
  }
  watch_stop(program);
  if (const Result<Done> opened = open_run(settings, steps); !opened) return fail(opened.error());
  const RunEnd end = run_points(program, settings, scenes->front(), chosen, steps);
  std::fputs(end.table.c_str(), stdout);
  return end.code;
}

}  // namespace

int main(int argc, char** argv) {
  tool::prepare_process();
  return tool::finish_output(run(argc, argv));
}
