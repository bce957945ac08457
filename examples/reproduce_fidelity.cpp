// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The paper's Table 1 on the scenes of a folder: {HAC, ContextGS} x {unmarked, marked}, before and after compression.
//
//   reproduce_fidelity --data SCENE[@DOWNSCALE] ... --out DIR [--iterations N] [--lambda L] [--bits B] [--fit-codec N]
//     [options of compmark train]
//
// A scene is a folder that compmark train takes, or one with such folders in it; lego@2 is trained at half its size.
// Each scene and codec has a folder of its own in DIR, trained as by compmark train --codec --key and measured as by
// compmark evaluate; what is finished is not run again, what was stopped goes on from its checkpoint. All cells are of
// DIR/owner.key: with another, nothing is run. DIR/fidelity.json, .md and .html are written after each, with the rows
// of earlier commands into DIR. Cost of a cell: a training, a fit and a marking, and four times the test views. With
// --fit-codec the training is one a scene, without a codec, which is fitted to it in N iterations (as by compmark
// fit-codec) before the marking (as by compmark embed): fidelity/fitted.hpp.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/options.hpp"
#include "compmark/process.hpp"
#include "fidelity/cell.hpp"
#include "fidelity/command_line.hpp"
#include "fidelity/run_cell.hpp"
#include "fidelity/scenes.hpp"
#include "fidelity/steps.hpp"
#include "fidelity/stopping.hpp"
#include "fidelity/table.hpp"

namespace {

using namespace fidelity;

constexpr const char* program = "reproduce_fidelity";

int fail(const Error& error) { return fidelity::fail(program, error); }

int run(int argc, char** argv) {
  CLI::App app{
      "the fidelity table of marked and compressed scenes; options that are not of this list are those of compmark "
      "train"};
  Settings settings;
  std::vector<std::string> data, codecs = {"hac", "context_gs"};
  app.add_option("--data", data, "scenes, or folders of scenes; SCENE@2 at half its size")->required();
  add_iterations(app, settings);
  app.add_option("--lambda", settings.rate_lambda, "loss of one bit more a scalar")
      ->capture_default_str()
      ->check(tool::in_range(tool::share_range));
  add_codecs(app, codecs);
  app.add_option("--fit-codec", settings.fit_codec,
                 "train one unmarked model a scene without a codec, and fit each codec to it in so many iterations; 0: "
                 "train with the codec")
      ->capture_default_str()
      ->check(tool::in_range(tool::any_count));
  app.add_option("--lpips-alex", settings.lpips, "LPIPS weights (safetensors)")->check(CLI::ExistingFile);
  add_bits(app, settings);
  add_settings(app, settings, program);
  if (const std::optional<int> over = parse(app, argc, argv)) return *over;
  if (const std::optional<std::string> own = word_of_the_cells(tool::with_new_names(app.remaining())))
    return fail({ErrorKind::invalid, {}, *own, "cannot be given", "every cell has its own, or all have one"});
  settings.extra = train_words(app.remaining());

  const Result<std::vector<Scene>> scenes = scenes_of(program, data);
  if (!scenes) return fail(scenes.error());
  std::vector<Cell> cells;
  for (const Scene& scene : *scenes) {
    for (const std::string& codec : codecs) cells.push_back({scene, codec});
  }
  const FunctionSteps steps;
  for (const Cell& cell : cells) {
    if (const Result<Done> right = check_words(cell, settings, steps); !right) return fail(right.error());
  }
  watch_stop(program);
  if (const Result<Done> opened = open_run(settings, steps); !opened) return fail(opened.error());
  if (const Result<Done> keys = check_keys(settings); !keys) return fail(keys.error());

  std::vector<Row> rows = finished_rows(settings);
  std::vector<std::string> failures;
  for (const Cell& cell : cells) {
    Result<std::optional<Row>> row = finish_cell(program, cell, settings, steps);
    if (!row) {
      fail(row.error());  // the other cells are worth having
      failures.push_back(cell.scene.name + ", " + cell.codec);
      continue;
    }
    if (!*row) {
      std::fprintf(stderr, "%s: stopped; the same command goes on\n", program);
      return stopped_exit;
    }
    const auto known = std::find_if(rows.begin(), rows.end(), [&](const Row& other) {
      return other.scene == (*row)->scene && other.codec == (*row)->codec;
    });
    if (known != rows.end())
      *known = std::move(**row);
    else
      rows.push_back(std::move(**row));
    if (Result<Done> written = write_table(settings, rows); !written) return fail(written.error());
  }
  if (!rows.empty()) std::printf("%s", table_markdown(settings, rows).c_str());
  for (const std::string& cell : failures) std::fprintf(stderr, "%s: not in the table: %s\n", program, cell.c_str());
  return failures.empty() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  tool::prepare_process();
  return tool::finish_output(run(argc, argv));
}
