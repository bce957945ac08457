// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The folder of photographs beside a model of cameras, and the names in it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/path_key.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {
namespace detail {

/// True for the name of a PNG or JPEG in any capitals. Files that a system leaves beside photographs (._a.png,
/// .hidden.png) do not count.
[[nodiscard]] inline bool is_image_name(const std::string& name) {
  const std::string extension = folded(std::filesystem::path(name).extension().string());
  return !name.empty() && name.front() != '.' && (extension == ".png" || extension == ".jpg" || extension == ".jpeg");
}

/// Names of the photographs in a folder, sorted, with the extensions that the published readers take. Folders are none.
[[nodiscard]] inline std::vector<std::string> image_names(const std::filesystem::path& folder) {
  static constexpr std::array<std::string_view, 6> extensions{".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"};
  std::vector<std::string> names;
  std::error_code status;
  for (std::filesystem::directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
    const std::string name = i->path().filename().string();
    const std::string extension = i->path().extension().string();
    std::error_code ignored;
    if (name.front() != '.' && std::find(extensions.begin(), extensions.end(), extension) != extensions.end() &&
        i->is_regular_file(ignored))
      names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// Folders whose images are no photographs: masks, depths, normals, small previews, what other programs wrote.
[[nodiscard]] inline bool holds_other_images(const std::string& folder) {
  static constexpr std::array<std::string_view, 11> begins{"mask",    "depth",      "normal",  "semantic",
                                                           "segment", "confidence", "thumb",   "preview",
                                                           "output",  "render",     "__macosx"};
  const std::string name = folded(folder);
  return name.empty() || name.front() == '.' || std::any_of(begins.begin(), begins.end(), [&](std::string_view begin) {
           return name.compare(0, begin.size(), begin) == 0;
         });
}

/// Paths of the photographs below a folder, relative to it, sorted. Hidden folders and links to folders are not
/// followed; `all`: nor are left out the folders that hold other images.
[[nodiscard]] inline std::vector<std::string> image_paths(const std::filesystem::path& folder, bool all) {
  std::vector<std::string> paths;
  std::error_code status;
  for (std::filesystem::recursive_directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
    const std::string name = i->path().filename().string();
    std::error_code ignored;
    if (i->is_directory(ignored)) {
      if (name.front() == '.' || (!all && holds_other_images(name))) i.disable_recursion_pending();
    } else if (is_image_name(name) && i->is_regular_file(ignored)) {
      paths.push_back(i->path().lexically_relative(folder).generic_string());
    }
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

/// Whether there is a photograph in a folder or below it.
[[nodiscard]] inline bool holds_images(const std::filesystem::path& folder) {
  std::error_code status;
  for (std::filesystem::recursive_directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
    std::error_code ignored;
    if (is_image_name(i->path().filename().string()) && i->is_regular_file(ignored)) return true;
  }
  return false;
}

/// `images`, or else the first of images_2, images_4, images_8; where there is none of them, or no photograph in it,
/// one of the names that other programs give it, in any capitals (Images, image, input, rgb, …), or the folder of the
/// model itself, with what is below it.
[[nodiscard]] inline Result<std::filesystem::path> image_folder(const std::filesystem::path& root) {
  std::filesystem::path empty;
  for (const char* name : {"images", "images_2", "images_4", "images_8"}) {
    if (!folder_exists(root / name)) continue;
    if (holds_images(root / name)) return root / name;
    if (empty.empty()) empty = root / name;
  }
  static constexpr std::array<std::string_view, 11> others{"images", "image", "input",  "inputs", "rgb",   "imgs",
                                                           "img",    "color", "colour", "photos", "frames"};
  std::vector<std::filesystem::path> folders;
  std::error_code status;
  for (std::filesystem::directory_iterator i(root, status), end; !status && i != end; i.increment(status)) {
    if (folder_exists(i->path())) folders.push_back(i->path());
  }
  std::sort(folders.begin(), folders.end());
  for (const std::string_view name : others) {
    for (const std::filesystem::path& folder : folders) {
      if (folded(folder.filename().string()) == name && holds_images(folder)) return folder;
    }
  }
  if (!image_paths(root, false).empty()) return root;
  if (!empty.empty()) return empty;
  return Error{ErrorKind::not_found, root.string(), "images",
               "there is no folder images (nor images_2, images_4, images_8)",
               "put the photographs the cameras were computed from into " + (root / "images").string()};
}

}  // namespace detail
}  // namespace compmark
