// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One door for all datasets: looks at what a folder holds and calls the reader of that kind. COLMAP comes first, as published (method
// sheet, section 3.5: Blender where transforms_train.json is and no folder sparse), then transforms*.json, then LLFF's poses_bounds.npy.
// A transforms file may also be named itself.
#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/utf8.hpp"
#include "compmark/scene/colmap.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/foreign.hpp"
#include "compmark/scene/image_folder.hpp"
#include "compmark/scene/llff.hpp"
#include "compmark/scene/repeated.hpp"
#include "compmark/scene/transforms.hpp"

namespace compmark::inline v0 {

namespace detail {

/// The names of views go into model files and reports, which are JSON.
[[nodiscard]] inline Result<Dataset> with_names_checked(Result<Dataset> dataset) {
  if (!dataset) return dataset;
  for (const View& view : dataset->views) {
    if (is_utf8(view.name)) continue;
    std::string shown = view.name;
    std::replace_if(
        shown.begin(), shown.end(), [](char c) { return static_cast<unsigned char>(c) >= 0x80; }, '?');
    return Error{ErrorKind::unsupported, dataset->root.string(), "images",
                 "the name of image \"" + shown + "\" is not UTF-8", "rename it, in the folder and in the model"};
  }
  return dataset;
}

/// The first folder below that holds a capture which can be opened; empty if there is none.
[[nodiscard]] inline std::filesystem::path folder_of_capture(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> folders;
  std::error_code status;
  for (std::filesystem::directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
    if (folder_exists(i->path())) folders.push_back(i->path());
  }
  std::sort(folders.begin(), folders.end());
  const auto found = std::find_if(folders.begin(), folders.end(), [](const std::filesystem::path& inner) {
    return is_colmap(inner) || is_llff(inner) || !find_transforms(inner).empty();
  });
  return found == folders.end() ? std::filesystem::path() : *found;
}

template <class Json>
[[nodiscard]] Result<Dataset> open_by_kind(const std::filesystem::path& folder, const DatasetSettings& settings) {
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, folder.string(), std::move(field), std::move(problem), std::move(remedy)};
  };
  if (!(settings.downscale > 0) || !std::isfinite(settings.downscale)) {
    return fail(ErrorKind::invalid, "downscale", "must be a positive number, not " + std::to_string(settings.downscale),
                "use 1, 2, 4 or 8");
  }
  std::error_code status;
  if (!std::filesystem::exists(folder, status))
    return fail(ErrorKind::not_found, "", "there is no such folder", "check the path of the dataset");
  if (folder.extension() == ".json" && std::filesystem::is_regular_file(folder, status))
    return open_transforms<Json>(folder, settings);
  if (!std::filesystem::is_directory(folder, status)) {
    if (const std::optional<Error> foreign = foreign_capture(folder)) return *foreign;
    return fail(ErrorKind::invalid, "", "is a file, not a folder", "give the folder of the dataset");
  }
  if (std::filesystem::is_empty(folder, status) && !status)
    return fail(ErrorKind::not_found, "", "the folder is empty", "check the path of the dataset");
  if (status)
    return fail(ErrorKind::unreadable, "", "the folder cannot be read: " + status.message(), "check its permissions");
  const std::filesystem::path transforms = find_transforms(folder);
  const bool blender = transforms.filename() == "transforms_train.json";
  const bool has_sparse = std::filesystem::is_directory(folder / "sparse", status);
  if (is_colmap(folder) && (has_sparse || !blender)) {
    Result<Dataset> dataset = open_colmap(folder, settings);
    if (dataset && !transforms.empty()) {
      dataset->warnings.push_back(transforms.string() +
                                  ": is not used, as there is a COLMAP model beside it (name the file " +
                                  "itself to use it)");
    }
    return dataset;
  }
  if (!transforms.empty()) return open_transforms<Json>(transforms, settings);
  if (is_llff(folder)) return open_llff(folder, settings);
  if (const std::filesystem::path inner = folder_of_capture(folder); !inner.empty()) {
    return fail(ErrorKind::not_found, "",
                "holds no capture itself, but its folder " + inner.filename().string() + " does",
                "give " + inner.string());
  }
  if (const std::optional<Error> foreign = foreign_capture(folder)) return *foreign;
  if (holds_images(folder)) {
    return fail(
        ErrorKind::not_found, "", "holds photographs, but no cameras",
        "compute the cameras (colmap automatic_reconstructor, ns-process-data images), which writes sparse/0 or "
        "transforms.json");
  }
  return fail(
      ErrorKind::not_found, "",
      "holds neither a COLMAP model (sparse/0/images.bin or .txt) nor transforms_train.json, transforms.json or "
      "poses_bounds.npy",
      "give the folder that contains one of them");
}

}  // namespace detail

/// Opens the dataset in a folder. Every image file is looked at (header only), no pixel is decoded. Cost: reading the files once.
template <class Json = nlohmann::json>
[[nodiscard]] Result<Dataset> open_dataset(const std::filesystem::path& folder, const DatasetSettings& settings) {
  Result<Dataset> dataset = detail::with_names_checked(detail::open_by_kind<Json>(folder, settings));
  if (!dataset) return dataset;
  detail::say_copies(*dataset);
  for (std::string& warning : dataset->warnings) warning = one_line(std::move(warning));  // names of files are in them
  return dataset;
}

}  // namespace compmark::inline v0
