// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the programs that run cells are told alike: the options of every cell, the scenes that words name, and the words that go on to compmark train.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "cell.hpp"
#include "compmark/core/result.hpp"
#include "compmark/scene/open.hpp"

namespace fidelity {

/// Says what is wrong; the exit code of it.
inline int fail(const char* program, const Error& error) {
  std::fprintf(stderr, "%s: error: %s\n", program, error.line().c_str());
  return 2;
}

/// --out, --threads, --compmark: the tool that was built beside this program, or the installed one. What the program does not know is for
/// `compmark train`.
inline void add_settings(CLI::App& app, Settings& settings, const fs::path& program) {
  if (const fs::path beside = program.parent_path() / "compmark"; fs::exists(beside)) settings.tool = beside;
  app.add_option("--out", settings.out, "folder of the run")->required();
  app.add_option("--threads", settings.threads, "0: all; the result is the same for any number")->capture_default_str();
  app.add_option("--compmark", settings.tool, "the tool (default: the one beside this program, or of PATH)");
  app.allow_extras();
}

/// --iterations and --codecs, of the programs that choose them by hand.
inline void add_iterations(CLI::App& app, Settings& settings) {
  app.add_option("--iterations", settings.iterations, "length of every training; every phase scales with it")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
}
inline void add_codecs(CLI::App& app, std::vector<std::string>& codecs) {
  app.add_option("--codecs", codecs, "of hac and context_gs")
      ->capture_default_str()
      ->check(CLI::IsMember({"hac", "context_gs"}));
}
/// --bits, of the programs that hide a message.
inline void add_bits(CLI::App& app, Settings& settings) {
  app.add_option("--bits", settings.bits, "length of the message")->capture_default_str()->check(CLI::Range(16, 128));
}

/// The exit code where there is nothing to be run: help was asked for, or an option is wrong.
[[nodiscard]] inline std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return std::nullopt;
}

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

/// Those of all words, each of a name of its own: results are told apart by it.
[[nodiscard]] inline Result<std::vector<Scene>> scenes_of(const char* program, const std::vector<std::string>& words) {
  std::vector<Scene> all;
  for (const std::string& word : words) {
    const Result<std::vector<Scene>> scenes = scenes_of(program, word);
    if (!scenes) return scenes.error();
    for (const Scene& scene : *scenes) {
      if (std::any_of(all.begin(), all.end(), [&](const Scene& other) { return other.name == scene.name; })) {
        return Error{ErrorKind::invalid, scene.folder.string(), "--data", "has the name of a scene before it",
                     "give folders of different names: theirs are told apart by it"};
      }
      all.push_back(scene);
    }
  }
  return all;
}

/// A word that `compmark train` cannot be given by hand, since every cell has its own, or all have one; `more` beside those of any cell.
[[nodiscard]] inline std::optional<std::string> word_of_the_cells(const std::vector<std::string>& words,
                                                                  const std::vector<std::string>& more = {}) {
  for (const std::string& word : words) {
    const std::string name = word.substr(0, word.find('='));
    for (const char* own : {"--decoder", "--key", "--out", "--twin", "--codec", "--recipe", "--for-compression",
                            "--preset", "--json-log"}) {
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

}  // namespace fidelity
