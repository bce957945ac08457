// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Opens any dataset: recognises the format of a folder and calls its reader. COLMAP comes first, as published
// (docs/spec/method.md, 3.5: Blender where transforms_train.json is and no folder sparse), then transforms*.json, then
// LLFF's poses_bounds.npy. A transforms file may also be named itself.
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
#include "compmark/scene/camera_check.hpp"
#include "compmark/scene/colmap.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/foreign.hpp"
#include "compmark/scene/image_folder.hpp"
#include "compmark/scene/llff.hpp"
#include "compmark/scene/repeated.hpp"
#include "compmark/scene/transforms.hpp"

namespace compmark {

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

/// The folder below, at most three deep, that holds a capture which can be opened, the nearest and first by name; empty
/// if there is none.
[[nodiscard]] inline std::filesystem::path folder_of_capture(const std::filesystem::path& folder) {
  std::vector<std::pair<int, std::filesystem::path>> folders;
  std::error_code status;
  const auto past_the_closed = std::filesystem::directory_options::skip_permission_denied;  // lost+found and its like
  for (std::filesystem::recursive_directory_iterator i(folder, past_the_closed, status), end; !status && i != end;
       i.increment(status)) {
    if (!folder_exists(i->path())) continue;
    folders.emplace_back(i.depth(), i->path());
    if (i.depth() == 2) i.disable_recursion_pending();
  }
  std::sort(folders.begin(), folders.end());
  const auto found = std::find_if(folders.begin(), folders.end(), [](const auto& inner) {
    return is_colmap(inner.second) || is_llff(inner.second) || !find_transforms(inner.second).empty();
  });
  return found == folders.end() ? std::filesystem::path() : found->second;
}

/// The hint for a capture below the given folder: its own path, or, if its photographs are not in it, where to put
/// them.
[[nodiscard]] inline Error capture_below(const std::filesystem::path& folder, const std::filesystem::path& inner) {
  const bool whole = holds_images(inner);
  return {ErrorKind::not_found, folder.string(), "",
          "holds no capture itself, but its folder " + inner.lexically_relative(folder).string() + " does" +
              (whole ? "" : ", without photographs"),
          whole ? "give " + inner.string()
                : "give " + inner.string() + ", with the photographs in " + (inner / "images").string() +
                      (is_colmap(inner) ? ", or move its model to " + (folder / "sparse/0").string() : "")};
}

/// Whether photographs are where the readers look for them; folders may be links.
[[nodiscard]] inline bool has_photographs(const std::filesystem::path& folder) {
  const Result<std::filesystem::path> images = image_folder(folder);
  return images && holds_images(*images);
}

/// The capture that a COLMAP model without photographs belongs to: its parent folder or the one above (scene for
/// scene/sparse/0). Empty if there is none, or if the folder is a capture itself.
[[nodiscard]] inline std::filesystem::path capture_of_model(const std::filesystem::path& model) {
  std::error_code status;
  std::filesystem::path folder = std::filesystem::canonical(model, status);
  const bool holds_models = folder.filename() == "sparse" && is_colmap(folder.parent_path());  // sparse/0, sparse/1, …
  if (status || !(holds_models || is_colmap(folder)) || has_photographs(folder)) return {};
  if (!find_transforms(folder).empty()) return {};
  for (int up = 0; up < 2; ++up) {
    folder = folder.parent_path();
    if (is_colmap(folder) && has_photographs(folder)) return folder;
  }
  return {};
}

/// A file of poses under a name that is not looked for (transforms_test.json alone, Transforms.JSON, cameras.json);
/// empty if there is none.
[[nodiscard]] inline std::filesystem::path file_of_poses(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code status, ignored;
  for (std::filesystem::directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
    if (folded(i->path().extension().string()) == ".json" && i->is_regular_file(ignored)) files.push_back(i->path());
  }
  std::sort(files.begin(), files.end());
  const auto found = std::find_if(files.begin(), files.end(), [](const std::filesystem::path& file) {
    const std::string begin = first_text(file, 65536);
    return begin.find("\"frames\"") != std::string::npos && begin.find("\"transform_matrix\"") != std::string::npos;
  });
  return found == files.end() ? std::filesystem::path() : *found;
}

/// Warns of other files of the folder that describe cameras and are not used.
inline void say_other_cameras(Dataset& dataset, const std::filesystem::path& folder,
                              const std::filesystem::path& used) {
  for (const char* name : {"transforms_train.json", "transforms.json", "poses_bounds.npy"}) {
    const std::filesystem::path file = folder / name;
    if (file == used || !file_exists(file)) continue;
    dataset.warnings.push_back(file.string() + ": is not used, as there is " +
                               (used.empty() ? "a COLMAP model" : used.filename().string()) + " beside it" +
                               (file.extension() == ".json" ? " (name the file itself to use it)" : ""));
  }
  if (!used.empty() && is_colmap(folder))
    dataset.warnings.push_back(folder.string() + ": its COLMAP model is not used, as there is " +
                               used.filename().string());
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
  if (folded(folder.extension().string()) == ".json" && std::filesystem::is_regular_file(folder, status))
    return open_transforms<Json>(folder, settings);
  if (!std::filesystem::is_directory(folder, status)) {
    if (const std::optional<Error> foreign = foreign_capture(folder)) return *foreign;
    return fail(ErrorKind::invalid, "", "is a file, not a folder", "give the folder of the dataset");
  }
  if (std::filesystem::is_empty(folder, status) && !status)
    return fail(ErrorKind::not_found, "", "the folder is empty", "check the path of the dataset");
  if (status)
    return fail(ErrorKind::unreadable, "", "the folder cannot be read: " + status.message(), "check its permissions");
  if (const std::filesystem::path capture = capture_of_model(folder); !capture.empty()) {
    return fail(ErrorKind::not_found, "", "is the COLMAP model of a capture, without its photographs",
                "give " + capture.string() + ", which has both");
  }
  const std::filesystem::path transforms = find_transforms(folder);
  const bool blender = transforms.filename() == "transforms_train.json";
  const bool has_sparse = std::filesystem::is_directory(folder / "sparse", status);
  if (is_colmap(folder) && (has_sparse || !blender)) {
    Result<Dataset> dataset = open_colmap(folder, settings);
    if (dataset) say_other_cameras(*dataset, folder, {});
    return dataset;
  }
  if (!transforms.empty() || is_llff(folder)) {
    Result<Dataset> dataset =
        transforms.empty() ? open_llff(folder, settings) : open_transforms<Json>(transforms, settings);
    if (dataset) say_other_cameras(*dataset, folder, transforms.empty() ? folder / "poses_bounds.npy" : transforms);
    return dataset;
  }
  if (const std::filesystem::path file = file_of_poses(folder); !file.empty()) {
    return fail(ErrorKind::not_found, file.filename().string(),
                "has poses, but is neither transforms_train.json nor transforms.json",
                "rename it, or give " + file.string());
  }
  if (const std::filesystem::path inner = folder_of_capture(folder); !inner.empty())
    return capture_below(folder, inner);
  if (const std::optional<Error> foreign = foreign_capture(folder)) return *foreign;
  if (holds_images(folder)) {
    return fail(ErrorKind::not_found, "", "holds photographs, but no cameras",
                "compute the cameras: COLMAP writes sparse/0 (docs/capture.md has the lines), ns-process-data images "
                "transforms.json");
  }
  return fail(
      ErrorKind::not_found, "",
      "holds neither a COLMAP model (sparse/0/images.bin or .txt) nor transforms_train.json, transforms.json or "
      "poses_bounds.npy",
      "give the folder that contains one of them");
}

}  // namespace detail

/// Opens the dataset in a folder. Every image file is looked at (header only), no pixel is decoded. Cost: reading the
/// files once.
template <class Json = nlohmann::json>
[[nodiscard]] Result<Dataset> open_dataset(const std::filesystem::path& folder, const DatasetSettings& settings) {
  Result<Dataset> dataset = detail::with_names_checked(detail::open_by_kind<Json>(folder, settings));
  if (!dataset) return dataset;
  detail::say_copies(*dataset);
  detail::say_strange_cameras(*dataset);
  for (std::string& warning : dataset->warnings) warning = one_line(std::move(warning));  // names of files are in them
  return dataset;
}

}  // namespace compmark
