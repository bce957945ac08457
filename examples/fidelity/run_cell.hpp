// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From the words of a command line to finished cells: which scenes they name, the owner's key of all of them, and what of a cell is still to be run.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "cell.hpp"
#include "compmark/core/result.hpp"
#include "compmark/scene/open.hpp"
#include "process.hpp"

namespace fidelity {

inline constexpr int stopped_exit = 130;  ///< the tool's, after Ctrl-C

/// The scene that a word of the command line names (a folder, SCENE@2 at half its size), or all that are in the folder; what is none is named on stderr.
[[nodiscard]] inline Result<std::vector<Scene>> scenes_of(const char* program, const std::string& word) {
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
  for (const std::string& line : passed_over) std::fprintf(stderr, "%s: no scene: %s\n", program, line.c_str());
  return found;
}

/// A word that `compmark train` cannot be given by hand, since every cell has its own, or all have one; `more` beside those of any cell.
[[nodiscard]] inline std::optional<std::string> word_of_the_cells(const std::vector<std::string>& words,
                                                                  const std::vector<std::string>& more = {}) {
  for (const std::string& word : words) {
    const std::string name = word.substr(0, word.find('='));
    for (const char* own :
         {"--decoder", "--key", "--out", "--twin", "--codec", "--recipe", "--for-compression", "--preset"}) {
      if (name == own) return name;
    }
    if (std::find(more.begin(), more.end(), name) != more.end()) return name;
  }
  return std::nullopt;
}
/// The others, but for those that are always there: what was begun is gone on with.
[[nodiscard]] inline std::vector<std::string> train_words(std::vector<std::string> words) {
  std::erase_if(words, [](const std::string& word) { return word == "--" || word == "--resume"; });
  return words;
}

/// Runs what of a cell is missing; says on stderr what that is. Empty: the run was stopped.
[[nodiscard]] inline Result<std::optional<Row>> finish_cell(const char* program, const Cell& cell,
                                                            const Settings& settings) {
  const fs::path folder = cell.folder(settings);
  if (Result<Done> opened = open_cell(cell, settings); !opened) return opened.error();
  const auto step = [&](const char* what, const std::vector<std::string>& command) -> Result<bool> {
    std::fprintf(stderr, "%s: %s, %s: %s\n", program, cell.scene.name.c_str(), cell.codec.c_str(), what);
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

/// The owner's key of all cells, made once. False: the tool said why not.
[[nodiscard]] inline Result<bool> make_key(const Settings& settings) {
  if (fs::exists(settings.key())) return true;
  const Result<int> code = run_program(
      {settings.tool.string(), "keygen", "--bits", std::to_string(settings.bits), "--out", settings.key().string()},
      settings.out / "keygen.txt");
  if (!code) return code.error();
  return *code == 0;
}

}  // namespace fidelity
