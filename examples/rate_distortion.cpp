// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Rate-distortion curves: scenes x codecs x lambda, each point a training (as by compmark train --codec), measured from
// its file; and how many bytes one codec takes less than the other for the same quality, for every two of them. Codecs
// that code one training share it: hac_plus writes the models that were trained for hac.
//
//   rate_distortion --data SCENE[@DOWNSCALE] ... --out DIR [--codecs C ...] [--lambdas L ...] [--iterations N] [options
//     of compmark train]
//
// What is finished is not run again, what was stopped goes on. DIR/rate_distortion.json, .md, .html and .svg (the first
// plot) are written after each point, and have the finished points of earlier commands for these scenes, codecs and
// lambdas. LPIPS is measured where --lpips-alex FILE is among the options of the first command. Cost: a training for a
// scene, a lambda and a codec with a training of its own; seconds for another file of it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include "compmark/codec/container/codecs.hpp"
#include "compmark/options.hpp"
#include "compmark/process.hpp"
#include "fidelity/cell.hpp"
#include "fidelity/command_line.hpp"
#include "fidelity/curve_run.hpp"
#include "fidelity/fitted.hpp"
#include "fidelity/run_cell.hpp"
#include "fidelity/scenes.hpp"
#include "fidelity/steps.hpp"
#include "fidelity/stopping.hpp"

namespace {

using namespace fidelity;

constexpr const char* program = "rate_distortion";

int fail(const Error& error) { return fidelity::fail(program, error); }

/// All codecs of the library, whose list is the one place that knows them.
std::vector<std::string> known_codecs() {
  const auto names = compmark::ShippedCodecs::names();
  return {names.begin(), names.end()};
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

int run(int argc, char** argv) {
  CLI::App app{
      "rate-distortion curves of the codecs over lambda; options that are not of this list are those of compmark "
      "train"};
  Settings settings;
  std::vector<std::string> data, codecs = known_codecs();
  std::vector<double> lambdas = {0.0005, 0.001, 0.002, 0.004};
  app.add_option("--data", data, "scenes, or folders of scenes; SCENE@2 at half its size")->required();
  app.add_option("--lambdas", lambdas, "losses of one bit more a scalar, a point each")
      ->capture_default_str()
      ->check(tool::in_range(tool::share_range));
  add_iterations(app, settings);
  add_codecs(app, codecs);
  add_settings(app, settings, program);
  if (const std::optional<int> over = parse(app, argc, argv)) return *over;
  codecs = once(codecs);
  lambdas = once(lambdas);
  const std::vector<std::string> given = tool::with_new_names(app.remaining());
  if (word_of_the_cells(given, {"--lambda"}) == "--lambda")
    return fail({ErrorKind::invalid, {}, "--lambda", "cannot be given", "give --lambdas: every point has its own"});
  std::vector<std::string> of_a_mark(mark_option_names.begin(), mark_option_names.end());
  of_a_mark.emplace_back("--bits");
  if (const std::optional<std::string> own = word_of_the_cells(given, of_a_mark))
    return fail({ErrorKind::invalid, {}, *own, "cannot be given", "leave it out: a curve has its own, and no message"});
  settings.extra = train_words(app.remaining());
  const Result<std::vector<Scene>> scenes = scenes_of(program, data);
  if (!scenes) return fail(scenes.error());
  const std::vector<WantedPoint> wanted = wanted_points(settings, *scenes, codecs, lambdas);
  const FunctionSteps steps;
  for (const WantedPoint& point : wanted) {
    if (const Result<Done> right = steps.check(Step::train_coded, training_of(point.cell), point.settings); !right)
      return fail(right.error());
  }
  watch_stop(program);
  if (Result<Done> made = make_run_folder(settings); !made) return fail(made.error());
  const RunEnd end = run_curves(program, settings, wanted, codecs, steps);
  std::fputs(end.table.c_str(), stdout);
  return end.code;
}

}  // namespace

int main(int argc, char** argv) {
  tool::prepare_process();
  return tool::finish_output(run(argc, argv));
}
