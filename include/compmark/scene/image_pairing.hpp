// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Finds the images of a capture by their names: exact names first, others by scene/pairing.hpp, with a note for each
// that is not exact. Cost: one look at the disk for an image that is there; where one is not, the folder is listed
// once.
#pragma once

#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "compmark/scene/image_lookup.hpp"
#include "compmark/scene/pairing.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {
namespace detail {

struct FoundImages {
  std::vector<std::filesystem::path> paths;  ///< of each name; empty: missing
  std::size_t missing = 0;
  std::vector<std::string> notes;  ///< a sentence each, without the folder
};

/// By their names, or their names with an extension in other capitals, where that is no other image's name.
[[nodiscard]] inline FoundImages images_as_written(const std::filesystem::path& folder,
                                                   const std::vector<std::string>& names) {
  FoundImages found;
  std::set<std::filesystem::path> named;
  for (const std::string& name : names) named.insert(folder / name);
  for (const std::string& name : names) {
    const std::filesystem::path path = folder / name;
    found.paths.push_back(file_exists(path) ? path : find_image_file(path));
    if (found.paths.back() != path && named.count(found.paths.back()) > 0)
      found.paths.back().clear();  // it is another image's own
    found.missing += found.paths.back().empty();
  }
  return found;
}

/// "a" and how many others.
[[nodiscard]] inline std::string and_others(const std::string& first, std::size_t count) {
  return "\"" + first + "\"" + (count > 1 ? " and " + std::to_string(count - 1) + " others" : "");
}

/// Looks for missing images among `files`, which are at `places` relative to `folder`; a file that another name has is
/// not used.
inline void pair_the_missing(const std::vector<std::string>& names, const std::vector<std::string>& files,
                             const std::vector<std::string>& places, const std::filesystem::path& folder,
                             const PairingSettings& settings, FoundImages& found) {
  const Pairing pairing = pair_names(names, files, settings);
  std::set<std::filesystem::path> taken;
  for (const std::filesystem::path& path : found.paths) {
    if (!path.empty()) taken.insert(path.lexically_normal());
  }
  std::size_t paired = 0, first = 0;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (!found.paths[i].empty() || pairing.file[i] == no_file) continue;
    const std::filesystem::path path = folder / places[pairing.file[i]];
    if (!taken.insert(path.lexically_normal()).second) continue;
    found.paths[i] = path;
    --found.missing;
    if (paired++ == 0) first = i;
  }
  const auto is = [&](std::size_t i) { return names[i] + " is " + places[pairing.file[i]]; };
  if (pairing.by_order) {
    found.notes.push_back("file names differ from the capture's, so the i-th name in sorted order is taken (" + is(0) +
                          ")");
  } else if (paired > 0) {
    found.notes.push_back(std::to_string(paired) + " of " + std::to_string(names.size()) +
                          " images have other paths than the capture says and are found by the ends of their names (" +
                          is(first) + ")");
  }
  std::size_t undecided = 0;
  for (const std::size_t i : pairing.undecided) {
    if (found.paths[i].empty() && undecided++ == 0) first = i;
  }
  if (undecided > 0) {
    found.notes.push_back("more than one image fits " + and_others(names[first], undecided) +
                          ", or the image fits another name as well, so that none is taken");
  }
}

}  // namespace detail
}  // namespace compmark
