// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Masks that are found by the names of the images, for views whose file of cameras names none. A mask that more than one image could mean
// (masks/r_0.png beside train/r_0.png and test/r_0.png) is nobody's: a guess would hide parts of the wrong photograph.
#pragma once

#include <cstddef>
#include <filesystem>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "compmark/scene/dataset.hpp"
#include "compmark/scene/image_lookup.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark::inline v0 {
namespace detail {

/// The mask of the image `root`/<folder>/<rest>: masks/<folder>/<rest>, then masks/<rest>, with the image's name and ".png", its stem and
/// ".png", or its name. A folder like images_4 looks into masks_4 before masks. Empty if there is none.
[[nodiscard]] inline std::filesystem::path find_mask(const std::filesystem::path& root,
                                                     const std::filesystem::path& image) {
  std::vector<std::filesystem::path> parts;
  for (const std::filesystem::path& part : image.lexically_normal().lexically_relative(root.lexically_normal())) {
    if (part != ".." && part != ".") parts.push_back(part);  // an image outside of the folder: by what follows
  }
  if (parts.empty()) return {};
  const auto join = [&](std::filesystem::path path, std::size_t from) {
    for (std::size_t i = from; i < parts.size(); ++i) path /= parts[i];
    return path;
  };
  std::vector<std::filesystem::path> places;
  if (folder_exists(root / "masks")) places.push_back(join(root / "masks", 0));
  if (parts.size() > 1) {
    const std::string first = parts[0].string();
    const std::size_t underscore = first.rfind('_');
    if (underscore != std::string::npos && folder_exists(root / ("masks" + first.substr(underscore))))
      places.push_back(join(root / ("masks" + first.substr(underscore)), 1));
    if (folder_exists(root / "masks")) places.push_back(join(root / "masks", 1));
  }
  for (const std::filesystem::path& base : places) {
    std::filesystem::path appended = base, replaced = base;
    appended += ".png";
    replaced.replace_extension(".png");
    for (const std::filesystem::path& candidate : {appended, replaced, base}) {
      if (std::filesystem::path found = find_image_file(candidate); !found.empty()) return found;
    }
    for (std::filesystem::path other : other_capitals(base)) {  // a.jpg.png for a.JPG
      other += ".png";
      if (file_exists(other)) return other;
    }
  }
  return {};
}

/// Gives every view that has no mask yet the one that is found by its name, and says what is missing or could not be decided.
inline void find_masks(Dataset& dataset, const std::filesystem::path& root) {
  std::map<std::filesystem::path, std::vector<std::size_t>> users;  // of the masks that are found by name
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    View& view = dataset.views[i];
    if (!view.mask_path.empty()) continue;
    view.mask_path = find_mask(root, view.image_path);
    if (!view.mask_path.empty()) users[view.mask_path].push_back(i);
  }
  std::size_t undecided = 0;
  std::string example;
  for (const auto& [mask, list] : users) {
    const std::filesystem::path& image = dataset.views[list[0]].image_path;
    std::size_t other = 0;
    for (const std::size_t i : list) other = dataset.views[i].image_path != image ? i : other;
    if (other == 0) continue;  // one image, perhaps in several frames
    if (undecided++ == 0) {
      example = "\"" + mask.string() + "\" could be of \"" + dataset.views[list[0]].name + "\" and of \"" +
                dataset.views[other].name + "\"";
    }
    for (const std::size_t i : list) dataset.views[i].mask_path.clear();
  }
  std::size_t without = 0;
  for (const View& view : dataset.views) without += view.mask_path.empty() ? 1 : 0;
  const auto say = [&](const std::string& sentence) {
    dataset.warnings.push_back(dataset.root.string() + ": " + sentence);
  };
  if (undecided > 0) {
    say(std::to_string(undecided) + " masks have a name that more than one image could mean and are not used, " +
        example + "; put masks into the folders that the images are in (masks/train for train)");
  }
  if (without > 0 && without < dataset.views.size()) {
    say(std::to_string(without) + " of " + std::to_string(dataset.views.size()) +
        " images have no mask and are used whole");
  }
}

}  // namespace detail
}  // namespace compmark::inline v0
