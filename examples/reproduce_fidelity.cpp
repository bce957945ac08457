// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The paper's Table 1 on the scenes of a folder: {HAC, ContextGS} x {unmarked, marked}, before and after compression.
//
//   reproduce_fidelity --data SCENE[@DOWNSCALE] ... --out DIR [--iterations N] [--lambda L] [--bits B] [words for compmark train]
//
// A scene is a folder that compmark train takes, or one with such folders in it; lego@2 is trained at half its size. Each scene and codec has a
// folder of its own in DIR, trained by compmark train --codec --key and measured by compmark evaluate; what is finished is not run again, what was
// stopped goes on from its checkpoint. DIR/fidelity.json, .md and .html are written after each, with the rows of earlier commands into DIR. Cost of a
// cell: a training, a fit and a marking (compmark train --codec --key), and four times the test views.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "fidelity/cell.hpp"
#include "fidelity/process.hpp"
#include "fidelity/run_cell.hpp"
#include "fidelity/table.hpp"

namespace {

using namespace fidelity;

constexpr const char* program = "reproduce_fidelity";

int fail(const Error& error) {
  std::fprintf(stderr, "reproduce_fidelity: error: %s\n", error.line().c_str());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "the fidelity table of marked and compressed scenes; options that are not of this list are given to compmark "
      "train"};
  Settings settings;
  // The tool that was built beside this program, or the installed one.
  if (const fs::path beside = fs::path(argv[0]).parent_path() / "compmark"; fs::exists(beside)) settings.tool = beside;
  std::vector<std::string> data, codecs = {"hac", "context_gs"};
  app.add_option("--data", data, "scenes, or folders of scenes; SCENE@2 at half its size")->required();
  app.add_option("--out", settings.out, "folder of the run")->required();
  app.add_option("--iterations", settings.iterations, "length of every training; every phase scales with it")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--lambda", settings.rate_lambda, "loss of one bit more a scalar")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--bits", settings.bits, "length of the message")->capture_default_str()->check(CLI::Range(16, 128));
  app.add_option("--codecs", codecs, "of hac and context_gs")
      ->capture_default_str()
      ->check(CLI::IsMember({"hac", "context_gs"}));
  app.add_option("--threads", settings.threads, "0: all; the result is the same for any number")->capture_default_str();
  app.add_option("--lpips-alex", settings.lpips, "LPIPS weights (safetensors)")->check(CLI::ExistingFile);
  app.add_option("--compmark", settings.tool, "the tool (default: the one beside this program, or of PATH)");
  app.allow_extras();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (const std::optional<std::string> own = word_of_the_cells(app.remaining()))
    return fail({ErrorKind::invalid, {}, *own, "cannot be given", "every cell has its own, or all have one"});
  settings.extra = train_words(app.remaining());

  std::vector<Cell> cells;
  std::set<std::string> names;
  for (const std::string& word : data) {
    const Result<std::vector<Scene>> scenes = scenes_of(program, word);
    if (!scenes) return fail(scenes.error());
    for (const Scene& scene : *scenes) {
      if (!names.insert(scene.name).second) {
        return fail({ErrorKind::invalid, scene.folder.string(), "--data", "has the name of a scene before it",
                     "give folders of different names: theirs are told apart by it"});
      }
      for (const std::string& codec : codecs) cells.push_back({scene, codec});
    }
  }
  std::error_code status;
  fs::create_directories(settings.out, status);
  if (status) {
    return fail({ErrorKind::unwritable, settings.out.string(), "--out", "cannot be created: " + status.message(),
                 "choose another"});
  }
  const Result<bool> has_key = make_key(settings);
  if (!has_key) return fail(has_key.error());
  if (!*has_key) return 2;  // keygen said why

  watch_stop();
  std::vector<Row> rows = finished_rows(settings);
  std::vector<std::string> failures;
  for (const Cell& cell : cells) {
    Result<std::optional<Row>> row = finish_cell(program, cell, settings);
    if (!row) {
      fail(row.error());  // the other cells are worth having
      failures.push_back(cell.scene.name + ", " + cell.codec);
      continue;
    }
    if (!*row || stopped()) {
      std::fprintf(stderr, "reproduce_fidelity: stopped; the same command goes on\n");
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
  for (const std::string& cell : failures)
    std::fprintf(stderr, "reproduce_fidelity: not in the table: %s\n", cell.c_str());
  return failures.empty() ? 0 : 1;
}
