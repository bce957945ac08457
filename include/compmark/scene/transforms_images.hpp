// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The images of all frames of a capture of transforms*.json at once, so that no frame is given what another one names.
// As they are written, with an extension, from a folder of smaller copies; where that finds nothing, by
// scene/pairing.hpp among the photographs below the folder.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "compmark/scene/image_folder.hpp"
#include "compmark/scene/image_lookup.hpp"
#include "compmark/scene/image_pairing.hpp"

namespace compmark {
namespace detail {

/// The file_path of every frame, "" where there is none.
template <class Json>
[[nodiscard]] std::vector<std::string> frame_names(const Json& json) {
  std::vector<std::string> names;
  if (!json.is_object() || !json.contains("frames") || !json["frames"].is_array()) return names;
  for (const Json& frame : json["frames"]) {
    const bool named = frame.is_object() && frame.contains("file_path") && frame["file_path"].is_string();
    names.push_back(named ? frame["file_path"].template get<std::string>() : std::string());
  }
  return names;
}

/// "images/a.png" for "images_4/a.png" where 4 is asked for, all other paths where 1 is; "" for the others.
[[nodiscard]] inline std::string path_of_reduction(const std::string& path, int reduction) {
  const std::size_t slash = path.find('/');
  const std::string folder = path.substr(0, slash == std::string::npos ? 0 : slash);
  for (const int r : {2, 4, 8}) {
    const std::string suffix = "_" + std::to_string(r);
    if (folder.size() <= suffix.size() || folder.compare(folder.size() - suffix.size(), suffix.size(), suffix) != 0)
      continue;
    return r == reduction ? folder.substr(0, folder.size() - suffix.size()) + path.substr(slash) : std::string();
  }
  return reduction == 1 ? path : std::string();
}

/// Adds to `notes` what was found otherwise than as it is written.
[[nodiscard]] inline std::vector<FoundImage> find_frame_images(const std::filesystem::path& folder,
                                                               const std::vector<std::string>& names,
                                                               std::vector<std::string>& notes) {
  std::set<std::filesystem::path> own;
  for (const std::string& name : names) {
    if (!name.empty()) own.insert(own_image(folder, name));
  }
  std::vector<FoundImage> images;
  FoundImages found;
  for (const std::string& name : names) {
    images.push_back(name.empty() ? FoundImage{} : find_image(folder, name));
    FoundImage& image = images.back();
    if (own.count(image.path) > 0 && image.path != own_image(folder, name)) image.path.clear();
    found.missing += !name.empty() && image.path.empty();
    found.paths.push_back(image.path);
  }
  if (found.missing == 0) return images;
  const std::vector<std::string> files = image_paths(folder, false);
  for (const int reduction : {1, 2, 4, 8}) {
    std::vector<std::string> keys, paths;
    for (const std::string& file : files) {
      std::string key = path_of_reduction(file, reduction);
      if (key.empty()) continue;
      keys.push_back(std::move(key));
      paths.push_back(file);
    }
    if (keys.empty() || found.missing == 0) continue;
    pair_the_missing(names, keys, paths, folder, {}, found);
    for (std::size_t i = 0; i < images.size(); ++i) {
      if (images[i].path.empty() && !found.paths[i].empty()) images[i] = {found.paths[i], reduction};
    }
  }
  notes = std::move(found.notes);
  return images;
}

}  // namespace detail
}  // namespace compmark
