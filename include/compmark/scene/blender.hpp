// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// NeRF-synthetic ("Blender") datasets: transforms_train.json and transforms_test.json with one horizontal field of view and OpenGL
// camera-to-world matrices; square pixels, principal point at the centre: f = width / (2 tan(camera_angle_x / 2)). There are no points:
// random ones are drawn uniformly in [-1.3, 1.3]^3 (method sheet, section 3.5) from (seed, index) and never written beside the data.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/point_file.hpp"
#include "compmark/scene/pose.hpp"
#include "compmark/scene/resize.hpp"

namespace compmark::inline v0 {

/// `count` points uniform in the cube [-half_size, half_size]^3, grey. The i-th point depends on (seed, i) alone.
[[nodiscard]] inline PointCloud random_points(std::size_t count, double half_size, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("random points"));
  PointCloud points;
  points.color.assign(count, {127, 127, 127});
  points.position.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto coordinate = [&](std::size_t c) {
      return static_cast<float>((2 * random.uniform(3 * i + c) - 1) * half_size);
    };
    points.position.push_back({coordinate(0), coordinate(1), coordinate(2)});
  }
  return points;
}

namespace detail {

/// Python writes NaN and Infinity, which JSON does not have: outside strings they become null, so that the field that holds one can be
/// named instead of a line and column.
[[nodiscard]] inline std::string without_nan(const std::string& text) {
  std::string result;
  result.reserve(text.size());
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (in_string && text[i] == '\\' && i + 1 < text.size()) {
      result.append(text, i++, 2);
      continue;
    }
    if (text[i] == '"') in_string = !in_string;
    bool replaced = false;
    for (const std::string word : {"NaN", "nan", "-nan", "Infinity", "-Infinity", "inf", "-inf"}) {
      if (!in_string && !replaced && text.compare(i, word.size(), word) == 0) {
        result += "null";
        i += word.size() - 1;
        replaced = true;
      }
    }
    if (!replaced) result += text[i];
  }
  return result;
}

[[nodiscard]] inline Result<nlohmann::json> read_transforms(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_file(path, std::uintmax_t{1} << 30);
  if (!bytes) return bytes.error();
  if (bytes->empty())
    return Error{ErrorKind::truncated, path.string(), "", "the file is empty", "create the dataset again"};
  const std::string text = without_nan(std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size()));
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& mistake) {
    std::string reason = mistake.what();
    if (const std::size_t end = reason.find("] "); end != std::string::npos) reason.erase(0, end + 2);
    return Error{ErrorKind::malformed, path.string(), "", "is not valid JSON: " + reason,
                 "correct it or create the dataset again"};
  }
}

/// A finite number, or nothing.
[[nodiscard]] inline std::optional<double> finite_number(const nlohmann::json& value) {
  if (!value.is_number()) return std::nullopt;
  const double number = value.get<double>();
  return std::isfinite(number) ? std::optional<double>(number) : std::nullopt;
}

/// Row-major 4 x 4 (a 3 x 4 is completed); the Error names the entry.
[[nodiscard]] inline Result<std::array<double, 16>> read_matrix(const nlohmann::json& frame, const std::string& file,
                                                                const std::string& where) {
  const std::string field = where + ".transform_matrix";
  const auto fail = [&](ErrorKind kind, const std::string& entry, std::string problem) {
    return Error{kind, file, field + entry, std::move(problem), "correct the pose or remove the frame"};
  };
  if (!frame.is_object() || !frame.contains("transform_matrix"))
    return fail(ErrorKind::malformed, "", "is missing, so the image has no pose");
  const nlohmann::json& rows = frame["transform_matrix"];
  if (!rows.is_array() || (rows.size() != 4 && rows.size() != 3))
    return fail(ErrorKind::malformed, "", "is not a 4 x 4 matrix");
  std::array<double, 16> matrix{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].is_array() || rows[i].size() != 4)
      return fail(ErrorKind::malformed, "[" + std::to_string(i) + "]", "does not have 4 entries");
    for (std::size_t j = 0; j < 4; ++j) {
      const std::optional<double> value = finite_number(rows[i][j]);
      if (!value) {
        return fail(ErrorKind::invalid, "[" + std::to_string(i) + "][" + std::to_string(j) + "]",
                    "is not a finite number (NaN, infinite or no number)");
      }
      matrix[4 * i + j] = *value;
    }
  }
  return matrix;
}

/// file_path with or without extension, relative to the JSON file; "\\" counts as "/".
[[nodiscard]] inline std::filesystem::path resolve_image(const std::filesystem::path& folder, std::string file_path) {
  std::replace(file_path.begin(), file_path.end(), '\\', '/');
  const std::filesystem::path path = (folder / file_path).lexically_normal();
  std::error_code ignored;
  if (std::filesystem::is_regular_file(path, ignored)) return path;
  for (const char* extension : {".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
    std::filesystem::path with = path;
    with += extension;
    if (std::filesystem::is_regular_file(with, ignored)) return with;
  }
  return path;
}

/// Appends the frames of one transforms file to the dataset.
[[nodiscard]] inline Result<Done> append_blender_frames(const std::filesystem::path& file, Split split,
                                                        const DatasetSettings& settings, Dataset& dataset) {
  const Result<nlohmann::json> json = read_transforms(file);
  if (!json) return json.error();
  const std::string name = file.string();
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, name, std::move(field), std::move(problem), std::move(remedy)};
  };
  if (!json->is_object() || !json->contains("frames") || !(*json)["frames"].is_array()) {
    return fail(ErrorKind::malformed, "frames", "is missing, so there are no poses",
                "give a transforms file with a list of frames");
  }
  const nlohmann::json& frames = (*json)["frames"];
  if (frames.empty()) {
    if (split == Split::test) return Done{};
    return fail(ErrorKind::invalid, "frames", "is empty, so there are no images", "give at least one frame");
  }
  const std::optional<double> angle =
      json->contains("camera_angle_x") ? finite_number((*json)["camera_angle_x"]) : std::nullopt;
  if (!angle || !(*angle > 0) || !(*angle < 3.14159)) {
    return fail(json->contains("camera_angle_x") ? ErrorKind::invalid : ErrorKind::malformed, "camera_angle_x",
                json->contains("camera_angle_x") ? "is not an angle between 0 and pi"
                                                 : "is missing, so the focal length is not known",
                "give the horizontal field of view in radians");
  }
  double worst_defect = 0;
  double worst_scale = 1;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const nlohmann::json& frame = frames[i];
    const std::string where = "frames[" + std::to_string(i) + "]";
    if (!frame.is_object() || !frame.contains("file_path") || !frame["file_path"].is_string()) {
      return fail(ErrorKind::malformed, where + ".file_path", "is missing",
                  "give the image's path relative to the JSON file");
    }
    const Result<std::array<double, 16>> matrix = read_matrix(frame, name, where);
    if (!matrix) return matrix.error();
    const std::optional<Pose> pose = pose_from_opengl(*matrix);
    if (!pose) {
      return fail(ErrorKind::invalid, where + ".transform_matrix",
                  "is singular or mirrored, so it is not a camera pose", "correct the pose or remove the frame");
    }
    worst_defect = std::max(worst_defect, pose->defect);
    if (std::abs(pose->scale - 1) > std::abs(worst_scale - 1)) worst_scale = pose->scale;

    View view;
    view.name = frame["file_path"].get<std::string>();
    view.image_path = resolve_image(file.parent_path(), view.name);
    view.split = split;
    std::error_code ignored;
    if (!std::filesystem::exists(view.image_path, ignored)) {
      return fail(ErrorKind::not_found, where + ".file_path",
                  "names \"" + view.name + "\", but there is no such image (nor with .png or .jpg)",
                  "add the image or remove the frame");
    }
    const Result<ImageInfo> info = read_image_info(view.image_path);
    if (!info) return info.error();
    view.has_alpha = info->has_alpha();
    view.file_width = info->width;
    view.file_height = info->height;
    Camera<double> camera;
    camera.width = info->width;
    camera.height = info->height;
    camera.fx = camera.fy = info->width / (2 * std::tan(*angle / 2));
    camera.cx = info->width / 2.0;
    camera.cy = info->height / 2.0;
    camera.rotation_camera_world = pose->rotation_camera_world;
    camera.center_world = pose->center_world;
    const ImageSize size = scaled_size(info->width, info->height, settings.downscale, settings.max_width);
    view.camera = camera.resized(size.width, size.height);
    dataset.views.push_back(std::move(view));
  }
  // 1e-3: float32 matrices are off by 1e-7, hand-rounded ones (4 digits) by 1e-4; more is a mistake worth a word.
  if (worst_defect > 1e-3)
    dataset.warnings.push_back(name + ": rotations are off by up to " + std::to_string(worst_defect) +
                               "; the nearest rotations are used");
  if (std::abs(worst_scale - 1) > 1e-3) {
    dataset.warnings.push_back(name + ": poses contain a scale of " + std::to_string(worst_scale) +
                               ", which is ignored");
  }
  return Done{};
}

}  // namespace detail

/// True if the folder holds a dataset of this kind.
[[nodiscard]] inline bool is_blender(const std::filesystem::path& folder) {
  std::error_code ignored;
  return std::filesystem::exists(folder / "transforms_train.json", ignored);
}

/// Opens a Blender dataset. transforms_val.json is not used, as in the published evaluation; without transforms_test.json all views train.
[[nodiscard]] inline Result<Dataset> open_blender(const std::filesystem::path& folder,
                                                  const DatasetSettings& settings) {
  Dataset dataset;
  dataset.kind = "blender";
  dataset.root = folder;
  Result<Done> done = detail::append_blender_frames(folder / "transforms_train.json", Split::train, settings, dataset);
  if (!done) return done.error();
  std::error_code ignored;
  if (std::filesystem::exists(folder / "transforms_test.json", ignored)) {
    done = detail::append_blender_frames(folder / "transforms_test.json", Split::test, settings, dataset);
    if (!done) return done.error();
  } else {
    dataset.warnings.push_back((folder / "transforms_test.json").string() + ": not there, so there are no test views");
  }
  if (settings.use_point_file && std::filesystem::exists(folder / "points3d.ply", ignored)) {
    Result<PointCloud> points = read_point_file(folder / "points3d.ply");
    if (!points) return points.error();
    dataset.points = std::move(*points);
    return dataset;
  }
  dataset.points = random_points(settings.random_points, 1.3, settings.seed);
  dataset.points_are_random = true;
  return dataset;
}

}  // namespace compmark::inline v0
