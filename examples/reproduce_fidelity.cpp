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
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/scene/open.hpp"
#include "fidelity/cell.hpp"
#include "fidelity/process.hpp"
#include "fidelity/table.hpp"

namespace {

using namespace fidelity;

constexpr int stopped_exit = 130;  // the tool's, after Ctrl-C

int fail(const Error& error) {
  std::fprintf(stderr, "reproduce_fidelity: error: %s\n", error.line().c_str());
  return 2;
}

/// One scene, or all that are in a folder.
Result<std::vector<Scene>> scenes_of(const std::string& word) {
  Scene scene;
  std::string folder = word;
  if (const std::size_t at = word.rfind('@'); at != std::string::npos && !fs::exists(word)) {
    const std::string_view number = std::string_view(word).substr(at + 1);
    const auto [end, problem] = std::from_chars(number.data(), number.data() + number.size(), scene.downscale);
    if (problem != std::errc{} || end != number.data() + number.size() || !(scene.downscale >= 1) ||
        scene.downscale > 64)
      return Error{ErrorKind::invalid, word, "--data", "does not end in a number from 1 to 64", "write SCENE@2"};
    folder = word.substr(0, at);
  }
  const auto named = [&](const fs::path& path) {
    Scene one = scene;
    one.folder = path;
    const fs::path absolute = fs::weakly_canonical(path);
    one.name = (absolute.has_filename() ? absolute : absolute.parent_path()).filename().string();
    return one;
  };
  const auto testable = [](const fs::path& path) -> Result<Done> {
    const Result<compmark::Dataset> dataset = compmark::open_dataset(path, {});
    if (!dataset) return dataset.error();
    if (dataset->indices(compmark::Split::test).empty())
      return Error{ErrorKind::invalid, path.string(), "test split", "holds no view",
                   "the table is measured in test views"};
    return Done{};
  };
  const Result<Done> whole = testable(folder);
  if (whole) return std::vector<Scene>{named(folder)};
  std::vector<fs::path> inside;
  std::error_code status;
  for (fs::directory_iterator entry(folder, status), end; !status && entry != end; entry.increment(status)) {
    if (entry->is_directory()) inside.push_back(entry->path());
  }
  std::sort(inside.begin(), inside.end());
  std::vector<Scene> found;
  std::vector<std::string> passed_over;
  for (const fs::path& path : inside) {
    const Result<Done> one = testable(path);
    if (one)
      found.push_back(named(path));
    else
      passed_over.push_back(one.error().line());
  }
  if (found.empty()) return whole.error();
  for (const std::string& line : passed_over) std::fprintf(stderr, "reproduce_fidelity: no scene: %s\n", line.c_str());
  return found;
}

/// Runs what of a cell is missing. Empty: the run was stopped.
Result<std::optional<Row>> finish(const Cell& cell, const Settings& settings) {
  const fs::path folder = cell.folder(settings);
  if (Result<Done> opened = open_cell(cell, settings); !opened) return opened.error();
  const auto step = [&](const char* what, const std::vector<std::string>& command) -> Result<bool> {
    std::fprintf(stderr, "reproduce_fidelity: %s, %s: %s\n", cell.scene.name.c_str(), cell.codec.c_str(), what);
    const Result<int> code = run_program(command, folder / (std::string(what) + ".txt"));
    if (!code) return code.error();
    if (*code == 0) return true;
    if (stopped() || *code == stopped_exit) return false;
    return Error{ErrorKind::invalid, folder.string(), what, "ended with exit code " + std::to_string(*code),
                 "see what it printed; the same command goes on from there"};
  };
  if (!is_trained(folder)) {
    const Result<bool> trained = step("train", train_command(cell, settings));
    if (!trained) return trained.error();
    if (!*trained || stopped()) return std::optional<Row>();
  }
  if (!is_measured(folder, settings)) {
    const Result<bool> measured = step("evaluate", evaluate_command(cell, settings));
    if (!measured) return measured.error();
    if (!*measured) return std::optional<Row>();
  }
  Result<Row> row = read_row(cell, settings);
  if (!row) return row.error();
  return std::optional<Row>(std::move(*row));
}

/// The owner's key of all cells, made once.
Result<bool> make_key(const Settings& settings) {
  if (fs::exists(settings.key())) return true;
  const Result<int> code = run_program(
      {settings.tool.string(), "keygen", "--bits", std::to_string(settings.bits), "--out", settings.key().string()},
      settings.out / "keygen.txt");
  if (!code) return code.error();
  return *code == 0;
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
  for (const std::string& word : app.remaining()) {
    const std::string name = word.substr(0, word.find('='));
    for (const char* own : {"--decoder", "--key", "--out", "--twin", "--codec", "--recipe", "--for-compression"}) {
      if (name == own)
        return fail({ErrorKind::invalid, {}, name, "cannot be given", "every cell has its own, or all have one"});
    }
    if (word != "--" && word != "--resume") settings.extra.push_back(word);  // what is there is always gone on with
  }

  std::vector<Cell> cells;
  std::set<std::string> names;
  for (const std::string& word : data) {
    const Result<std::vector<Scene>> scenes = scenes_of(word);
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
    Result<std::optional<Row>> row = finish(cell, settings);
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
