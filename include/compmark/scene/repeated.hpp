// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Removes repeated photographs. A photograph in two frames would count twice; if one of them is a test view, the test
// would measure a training photograph. Cost: one look at the disk for each view; files of one size are read once more.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/scene/dataset.hpp"

namespace compmark {
namespace detail {

/// Whether two views stand in one place and look one way, up to the rounding of a float.
[[nodiscard]] inline bool same_pose(const Camera<double>& a, const Camera<double>& b) {
  double apart = 0, size = 1;
  for (std::size_t k = 0; k < 9; ++k) {
    if (std::abs(a.rotation_camera_world[k] - b.rotation_camera_world[k]) > 1e-5) return false;
  }
  for (std::size_t k = 0; k < 3; ++k) {
    apart = std::fmax(apart, std::abs(a.center_world[k] - b.center_world[k]));
    size = std::fmax(size, std::abs(a.center_world[k]));
  }
  return apart <= 1e-5 * size;
}

/// Leaves out views whose photograph an earlier view has, training views first; an Error where the two have different
/// poses.
[[nodiscard]] inline Result<Done> leave_out_repeated(Dataset& dataset, const std::string& source) {
  std::map<std::filesystem::path, std::size_t> known;  // the file behind all links: view
  std::vector<bool> repeated(dataset.views.size(), false);
  std::size_t count = 0, first = 0, original = 0;
  for (const Split split : {Split::train, Split::test}) {
    for (std::size_t i = 0; i < dataset.views.size(); ++i) {
      const View& view = dataset.views[i];
      if (view.split != split) continue;
      std::error_code status;
      std::filesystem::path file = std::filesystem::canonical(view.image_path, status);
      const auto [entry, is_new] = known.emplace(status ? view.image_path : file, i);
      if (is_new) continue;
      const View& other = dataset.views[entry->second];
      if (!same_pose(view.camera, other.camera)) {
        return Error{
            ErrorKind::invalid, source, view.name,
            "is the photograph of \"" + other.name + "\" as well (" + view.image_path.string() + "), with another pose",
            "give each photograph one frame"};
      }
      repeated[i] = true;
      if (count++ == 0) first = i, original = entry->second;
    }
  }
  if (count == 0) return Done{};
  dataset.warnings.push_back(source + ": " + std::to_string(count) +
                             " frames have the photograph of another frame and are left out, the first is \"" +
                             dataset.views[first].name + "\" (as \"" + dataset.views[original].name + "\")");
  std::vector<View> kept;
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    if (!repeated[i]) kept.push_back(std::move(dataset.views[i]));
  }
  dataset.views = std::move(kept);
  return Done{};
}

/// Warns of test photographs that are, byte by byte, training photographs under another name. A capture in which all
/// photographs are the same picture is not examined.
inline void say_copies(Dataset& dataset) {
  std::map<std::uintmax_t, std::vector<std::size_t>> sizes;
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    std::error_code status;
    const std::uintmax_t size = std::filesystem::file_size(dataset.views[i].image_path, status);
    if (!status) sizes[size].push_back(i);
  }
  std::size_t copies = 0, different = sizes.size();
  std::string example;
  for (const auto& [size, views] : sizes) {
    if (views.size() < 2) continue;
    std::map<std::uint64_t, std::array<std::vector<std::size_t>, 2>> digests;
    for (const std::size_t i : views) {
      const Result<std::vector<std::byte>> bytes = read_file(dataset.views[i].image_path);
      std::uint64_t digest = 14695981039346656037u;  // FNV-1a
      for (std::size_t k = 0; bytes && k < bytes->size(); ++k)
        digest = (digest ^ std::to_integer<std::uint64_t>((*bytes)[k])) * 1099511628211u;
      digests[digest][dataset.views[i].split == Split::test].push_back(i);
    }
    different += digests.size() - 1;
    for (const auto& [digest, by_split] : digests) {
      if (by_split[0].empty() || by_split[1].empty()) continue;
      if (copies == 0)
        example = "\"" + dataset.views[by_split[1][0]].name + "\" is \"" + dataset.views[by_split[0][0]].name + "\"";
      copies += by_split[1].size();
    }
  }
  if (copies == 0 || different < 2) return;
  dataset.warnings.push_back(dataset.root.string() + ": " + std::to_string(copies) +
                             " test photographs are training photographs under another name (" + example +
                             "), so that their figures are those of training");
}

}  // namespace detail
}  // namespace compmark
