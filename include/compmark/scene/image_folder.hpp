// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The folder of photographs beside a model of cameras, and the names in it.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <system_error>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark::inline v0 {
namespace detail {

/// Names of the photographs in a folder, sorted. What a system left beside them (._a.png, .hidden.png) and folders are none.
[[nodiscard]] inline std::vector<std::string> image_names(const std::filesystem::path& folder) {
  static constexpr std::array<const char*, 6> extensions{".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"};
  std::vector<std::string> names;
  std::error_code status;
  for (std::filesystem::directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
    const std::string name = i->path().filename().string(), extension = i->path().extension().string();
    std::error_code ignored;
    if (name.front() != '.' && std::find(extensions.begin(), extensions.end(), extension) != extensions.end() &&
        i->is_regular_file(ignored)) {
      names.push_back(name);
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// `images`, or else the first of images_2, images_4, images_8.
[[nodiscard]] inline Result<std::filesystem::path> image_folder(const std::filesystem::path& root) {
  for (const char* name : {"images", "images_2", "images_4", "images_8"}) {
    if (folder_exists(root / name)) return root / name;
  }
  return Error{ErrorKind::not_found, root.string(), "images",
               "there is no folder images (nor images_2, images_4, images_8)",
               "put the photographs the cameras were computed from into " + (root / "images").string()};
}

}  // namespace detail
}  // namespace compmark::inline v0
