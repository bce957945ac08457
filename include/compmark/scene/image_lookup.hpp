// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From the name of an image in a file of cameras to the image on the disk: backslashes, a missing extension, an
// extension in other capitals (a.jpg for a.JPG, as they are after a copy from a camera's card), and folders of smaller
// copies (images_4 for images). The exact name always comes first. Cost: one look at the disk for an image that is
// there, at most 92 for one that is not.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <iterator>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {
namespace detail {

/// "./a\\b.png" as "a/b.png": the one spelling of a path relative to a file of cameras.
[[nodiscard]] inline std::string plain_name(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return std::filesystem::path(name).lexically_normal().generic_string();
}

/// The same name with its extension in all other capitals: small letters first, then capitals, then mixed ones. Images
/// (PNG, JPEG) only.
[[nodiscard]] inline std::vector<std::filesystem::path> other_capitals(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  std::string small = extension;
  for (char& c : small) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  std::vector<std::filesystem::path> result;
  if (small != ".png" && small != ".jpg" && small != ".jpeg") return result;
  const std::size_t letters = small.size() - 1, count = std::size_t{1} << letters;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t capitals = k == 0 ? 0 : count - k;  // one bit a letter
    std::string spelling = small;
    for (std::size_t i = 0; i < letters; ++i) {
      if ((capitals >> i) % 2 == 1) spelling[i + 1] = static_cast<char>(small[i + 1] - 'a' + 'A');
    }
    if (spelling == extension) continue;
    result.push_back(path);
    result.back().replace_extension(spelling);
  }
  return result;
}

/// The file of that name, or else the first one that differs in the capitals of its extension; empty if there is none.
[[nodiscard]] inline std::filesystem::path find_image_file(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_regular_file(path, ignored)) return path;
  for (std::filesystem::path& other : other_capitals(path)) {
    if (std::filesystem::is_regular_file(other, ignored)) return std::move(other);
  }
  return {};
}

/// The file of that name or stem in a format that is not read (a.webp for a.png); empty if there is none.
[[nodiscard]] inline std::filesystem::path unread_image(const std::filesystem::path& path) {
  std::error_code ignored;
  for (const char* extension : {"webp", "heic", "heif", "avif", "jxl", "tif", "tiff", "bmp", "gif", "exr", "hdr",
                                "tga",  "ppm",  "dng",  "cr2",  "cr3", "nef", "arw",  "raw", "orf", "rw2"}) {
    std::string capitals = extension;
    for (char& c : capitals) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
    for (const std::string& spelling : {std::string(extension), capitals}) {
      std::filesystem::path other = path, longer = path;
      other.replace_extension(spelling);
      longer += "." + spelling;
      for (const std::filesystem::path& file : {other, longer}) {
        if (std::filesystem::is_regular_file(file, ignored)) return file;
      }
    }
  }
  return {};
}

/// The file of exactly that name, or of that name and an extension; empty if there is none.
[[nodiscard]] inline std::filesystem::path own_image(const std::filesystem::path& folder,
                                                     const std::string& file_path) {
  const std::filesystem::path base = (folder / plain_name(file_path)).lexically_normal();
  for (const char* extension : {"", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
    std::filesystem::path candidate = base;
    candidate += extension;
    std::error_code ignored;
    if (std::filesystem::is_regular_file(candidate, ignored)) return candidate;
  }
  return {};
}

/// An image on the disk, and the folder of smaller copies that it was found in: 2 for images_2, 1 for the folder that
/// was named.
struct FoundImage {
  std::filesystem::path path;
  int reduction = 1;
};

/// file_path relative to the file of cameras; where there is no such file also with an extension, and in the folders
/// that hold smaller copies (images_2 for images). The path is empty if nothing is found.
[[nodiscard]] inline FoundImage find_image(const std::filesystem::path& folder, const std::string& file_path) {
  const std::filesystem::path given = plain_name(file_path);
  for (const int reduction : {1, 2, 4, 8}) {
    std::filesystem::path place = given;
    if (reduction > 1) {
      if (given.begin() == given.end() || std::next(given.begin()) == given.end()) break;  // no folder is named
      place = given.begin()->string() + "_" + std::to_string(reduction);
      for (auto part = std::next(given.begin()); part != given.end(); ++part) place /= *part;
    }
    const std::filesystem::path base = (folder / place).lexically_normal();
    if (std::filesystem::path found = find_image_file(base); !found.empty()) return {std::move(found), reduction};
    for (const char* extension : {".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
      std::filesystem::path candidate = base;
      candidate += extension;
      std::error_code ignored;
      if (std::filesystem::is_regular_file(candidate, ignored)) return {std::move(candidate), reduction};
    }
  }
  return {};
}

}  // namespace detail
}  // namespace compmark
