// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which folders are scenes: those that open and have test views.
#include "scenes.hpp"

#include <algorithm>
#include <charconv>
#include <compmark/scene/open.hpp>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace fidelity {

namespace {

Result<std::vector<Scene>> scenes_of_word(const char* program, const std::string& word) {
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

}  // namespace

Result<std::vector<Scene>> scenes_of(const char* program, const std::vector<std::string>& words) {
  std::vector<Scene> all;
  for (const std::string& word : words) {
    const Result<std::vector<Scene>> scenes = scenes_of_word(program, word);
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

}  // namespace fidelity
