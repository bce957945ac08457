// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// File names for images of views: one for each view, and the same names whichever views are written.
#pragma once

#include <algorithm>
#include <array>
#include <compmark/io/file_identity.hpp>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

using compmark::detail::lower;

/// The name of a view without folders and without the ending of an image.
inline std::string view_stem(std::string name) {
  static constexpr std::array<std::string_view, 12> endings{".png", ".jpg", ".jpeg", ".tif",  ".tiff", ".webp",
                                                            ".bmp", ".gif", ".heic", ".avif", ".exr",  ".jxl"};
  for (const std::string_view ending : endings) {
    if (name.size() <= ending.size()) continue;
    const std::string_view end = std::string_view(name).substr(name.size() - ending.size());
    if (lower(std::string(end)) != ending) continue;
    name.resize(name.size() - ending.size());
    break;
  }
  for (char& c : name) {
    if (c == '/' || c == '\\' || c == ':' || static_cast<unsigned char>(c) < 0x20) c = '_';
  }
  const std::size_t begin = std::min(name.find_first_not_of("._"), name.size());
  name.erase(0, begin);
  if (name.size() > 200) name.erase(0, name.size() - 200);  // of a file system's 255 bytes: the end tells views apart
  while (!name.empty() && (static_cast<unsigned char>(name[0]) & 0xC0u) == 0x80u) name.erase(0, 1);  // half a letter
  return name.empty() ? "view" : name;
}

/// A file name for every view, none twice, also where capitals and small letters are the same: of views whose stems
/// agree the first keeps it, the others get a number.
inline std::vector<std::string> view_files(const std::vector<std::string>& views) {
  std::vector<std::string> names;
  std::set<std::string> stems, taken;
  std::map<std::string, int> last;  // number of a stem
  for (const std::string& view : views) stems.insert(lower(view_stem(view)));
  for (const std::string& view : views) {
    const std::string first = view_stem(view);
    int& number = last.emplace(lower(first), 1).first->second;
    std::string name = first;
    // What another view is called by itself is its own, wherever it stands.
    while (taken.count(lower(name)) != 0 || (name != first && stems.count(lower(name)) != 0))
      name = first + "-" + std::to_string(++number);
    taken.insert(lower(name));
    names.push_back(name + ".png");
  }
  return names;
}

}  // namespace tool
