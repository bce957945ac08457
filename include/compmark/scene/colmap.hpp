// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// COLMAP datasets: a sparse model (binary before text; sparse/0, sparse, or the folder itself) and a folder of images. Views are sorted
// by the image's base name up to its first dot and every n-th is a test view, as published (method sheet, section 3.5). Each image keeps
// the intrinsics of its own camera, scaled by the true ratio of sizes where the files are smaller than what COLMAP saw (case CA1).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iomanip>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/scene/colmap_binary.hpp"
#include "compmark/scene/colmap_model.hpp"
#include "compmark/scene/colmap_text.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/pose.hpp"
#include "compmark/scene/resize.hpp"

namespace compmark::inline v0 {

namespace detail {

[[nodiscard]] inline bool file_exists(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

[[nodiscard]] inline bool has_binary(const std::filesystem::path& folder) {
  return file_exists(folder / "images.bin") || file_exists(folder / "cameras.bin");
}

/// The folder with the model, or an empty path.
[[nodiscard]] inline std::filesystem::path colmap_model_folder(const std::filesystem::path& root) {
  for (const std::filesystem::path& folder : {root / "sparse" / "0", root / "sparse", root}) {
    if (has_binary(folder) || file_exists(folder / "images.txt") || file_exists(folder / "cameras.txt")) return folder;
  }
  return {};
}

/// File names in a folder, sorted, without hidden ones.
[[nodiscard]] inline std::vector<std::string> image_names(const std::filesystem::path& folder) {
  static constexpr std::array<const char*, 6> extensions{".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"};
  std::vector<std::string> names;
  std::error_code status;
  for (std::filesystem::directory_iterator i(folder, status), end; !status && i != end; i.increment(status)) {
    const std::string extension = i->path().extension().string();
    if (std::find(extensions.begin(), extensions.end(), extension) != extensions.end())
      names.push_back(i->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// The published sort key: the base name up to its first dot; the whole name decides between equals.
[[nodiscard]] inline std::pair<std::string, std::string> colmap_sort_key(const std::string& name) {
  const std::string base = name.substr(name.find_last_of('/') + 1);
  return {base.substr(0, base.find('.')), name};
}

/// `images`, or else the first of images_2, images_4, images_8.
[[nodiscard]] inline Result<std::filesystem::path> colmap_image_folder(const std::filesystem::path& root) {
  for (const char* name : {"images", "images_2", "images_4", "images_8"}) {
    std::error_code ignored;
    if (std::filesystem::is_directory(root / name, ignored)) return root / name;
  }
  return Error{ErrorKind::not_found, root.string(), "images",
               "there is no folder images (nor images_2, images_4, images_8)",
               "put the photographs COLMAP was run on into " + (root / "images").string()};
}

/// Largest displacement in pixels that coefficient k of SIMPLE_RADIAL causes at the corners: f |k| r^3 (r = distance / f).
[[nodiscard]] inline double radial_displacement(const ColmapCamera& camera) {
  const double f = camera.parameters[0];
  const double x = std::max(camera.parameters[1], static_cast<double>(camera.width) - camera.parameters[1]) / f;
  const double y = std::max(camera.parameters[2], static_cast<double>(camera.height) - camera.parameters[2]) / f;
  const double r = std::hypot(x, y);
  return f * std::abs(camera.parameters[3]) * r * r * r;
}

[[nodiscard]] inline std::string two_digits(double value) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << value;
  return text.str();
}

/// Pinhole intrinsics of a COLMAP camera at COLMAP's size.
[[nodiscard]] inline Result<Camera<double>> pinhole_camera(const ColmapCamera& camera, std::uint32_t id,
                                                           const std::string& file) {
  const std::string field = "camera " + std::to_string(id);
  const auto fail = [&](ErrorKind kind, std::string problem, std::string remedy) {
    return Error{kind, file, field, std::move(problem), std::move(remedy)};
  };
  if (camera.model > 2) {
    return fail(ErrorKind::unsupported,
                "uses the camera model " + std::string(colmap_models[static_cast<std::size_t>(camera.model)].name) +
                    "; PINHOLE, SIMPLE_PINHOLE and SIMPLE_RADIAL are handled",
                "undistort the images with colmap image_undistorter, which writes PINHOLE cameras");
  }
  if (camera.width == 0 || camera.height == 0 || camera.width > 65536 || camera.height > 65536) {
    return fail(ErrorKind::invalid,
                "has the impossible size " + std::to_string(camera.width) + " x " + std::to_string(camera.height),
                "export the model again");
  }
  for (const double v : camera.parameters) {
    if (!std::isfinite(v))
      return fail(ErrorKind::invalid, "has an intrinsic parameter that is not finite", "export the model again");
  }
  Camera<double> result;
  result.width = static_cast<int>(camera.width);
  result.height = static_cast<int>(camera.height);
  const std::size_t focals = camera.model == 1 ? 2 : 1;
  result.fx = camera.parameters[0];
  result.fy = camera.parameters[focals - 1];
  result.cx = camera.parameters[focals];
  result.cy = camera.parameters[focals + 1];
  if (!(result.fx > 0) || !(result.fy > 0))
    return fail(ErrorKind::invalid, "has a focal length that is not positive", "export the model again");
  return result;
}

/// Pairs the images of the model with files. By name; if not one name is found but the folder holds as many images as the model, by
/// sorted order (datasets whose files were renamed, as LLFF does).
[[nodiscard]] inline Result<std::vector<std::filesystem::path>> match_images(
    const std::vector<const ColmapImage*>& images, const std::filesystem::path& folder, Dataset& dataset) {
  std::vector<std::filesystem::path> paths;
  std::size_t missing = 0;
  const ColmapImage* first_missing = nullptr;
  for (const ColmapImage* image : images) {
    paths.push_back(folder / image->name);
    if (!file_exists(paths.back())) {
      first_missing = missing++ == 0 ? image : first_missing;
    }
  }
  if (missing == 0) return paths;
  const std::vector<std::string> files = image_names(folder);
  if (files.empty())
    return Error{ErrorKind::not_found, folder.string(), "images", "the folder holds no PNG or JPEG image",
                 "put the photographs there"};
  if (missing == images.size() && files.size() == images.size()) {
    for (std::size_t i = 0; i < files.size(); ++i) paths[i] = folder / files[i];
    dataset.warnings.push_back(folder.string() +
                               ": file names differ from the model's, so the i-th name in sorted order is taken (" +
                               images[0]->name + " is " + files[0] + ")");
    return paths;
  }
  return Error{ErrorKind::not_found, folder.string(), first_missing->name,
               "there is no such image; " + std::to_string(missing) + " of the " + std::to_string(images.size()) +
                   " images of the model are missing",
               "add the images, or remove them from the model with colmap image_deleter"};
}

}  // namespace detail

/// True if the folder holds a dataset of this kind.
[[nodiscard]] inline bool is_colmap(const std::filesystem::path& root) {
  return !detail::colmap_model_folder(root).empty();
}

/// Reads a model from a folder with cameras, images and points3D, binary if there, else text.
[[nodiscard]] inline Result<ColmapModel> read_colmap_model(const std::filesystem::path& folder,
                                                           const ColmapReadSettings& settings = {}) {
  return detail::has_binary(folder) ? read_colmap_binary(folder, settings) : read_colmap_text(folder, settings);
}

/// Opens a COLMAP dataset.
[[nodiscard]] inline Result<Dataset> open_colmap(const std::filesystem::path& root, const DatasetSettings& settings) {
  const std::filesystem::path model_folder = detail::colmap_model_folder(root);
  const std::string suffix = detail::has_binary(model_folder) ? ".bin" : ".txt";
  const std::string cameras_file = (model_folder / ("cameras" + suffix)).string();
  const std::string images_file = (model_folder / ("images" + suffix)).string();
  const std::string points_file = (model_folder / ("points3D" + suffix)).string();
  const Result<ColmapModel> model = read_colmap_model(model_folder);
  if (!model) return model.error();
  if (model->images.empty()) {
    return Error{ErrorKind::invalid, images_file, "images", "the model holds no registered image",
                 "run colmap mapper again with more overlapping photographs"};
  }

  Dataset dataset;
  dataset.kind = "colmap";
  dataset.root = root;
  std::vector<const ColmapImage*> images;
  for (const auto& entry : model->images) images.push_back(&entry.second);
  std::sort(images.begin(), images.end(), [](const ColmapImage* a, const ColmapImage* b) {
    return detail::colmap_sort_key(a->name) < detail::colmap_sort_key(b->name);
  });
  const Result<std::filesystem::path> folder = detail::colmap_image_folder(root);
  if (!folder) return folder.error();
  const Result<std::vector<std::filesystem::path>> paths = detail::match_images(images, *folder, dataset);
  if (!paths) return paths.error();

  double displacement = 0;
  std::set<std::tuple<std::uint64_t, std::uint64_t, int, int>> scaled;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const ColmapImage& image = *images[i];
    const auto camera = model->cameras.find(image.camera_id);
    if (camera == model->cameras.end()) {
      return Error{ErrorKind::malformed, images_file, image.name,
                   "names camera " + std::to_string(image.camera_id) + ", which cameras" + suffix + " does not have",
                   "export the model again"};
    }
    const Result<Camera<double>> intrinsics = detail::pinhole_camera(camera->second, image.camera_id, cameras_file);
    if (!intrinsics) return intrinsics.error();
    const std::optional<Pose> pose = pose_from_quaternion(image.rotation_wxyz, image.translation);
    if (!pose) {
      return Error{ErrorKind::invalid, images_file, image.name, "its pose is not finite or its quaternion is zero",
                   "remove the image from the model with colmap image_deleter"};
    }
    const Result<ImageInfo> info = read_image_info((*paths)[i]);
    if (!info) return info.error();
    // The files may be a scaled copy of what COLMAP saw: same proportions up to the rounding of one pixel.
    const double expected_height = static_cast<double>(intrinsics->height) * info->width / intrinsics->width;
    if (std::abs(expected_height - info->height) > 1.0) {
      return Error{ErrorKind::invalid, (*paths)[i].string(), "image size",
                   "is " + std::to_string(info->width) + " x " + std::to_string(info->height) +
                       ", but its camera is for " + std::to_string(intrinsics->width) + " x " +
                       std::to_string(intrinsics->height) + ", which has other proportions",
                   "use the images COLMAP was run on, scaled but neither cropped nor rotated"};
    }
    if (info->width != intrinsics->width || info->height != intrinsics->height) {
      scaled.insert({camera->second.width, camera->second.height, info->width, info->height});
    }

    View view;
    view.name = image.name;
    view.image_path = (*paths)[i];
    view.split =
        settings.test_every > 0 && i % static_cast<std::size_t>(settings.test_every) == 0 ? Split::test : Split::train;
    view.has_alpha = info->has_alpha();
    view.file_width = info->width;
    view.file_height = info->height;
    Camera<double> posed = *intrinsics;
    posed.rotation_camera_world = pose->rotation_camera_world;
    posed.center_world = pose->center_world;
    const ImageSize size = scaled_size(info->width, info->height, settings.downscale, settings.max_width);
    view.camera = posed.resized(size.width, size.height);
    if (camera->second.model == 2) {
      displacement = std::max(displacement, detail::radial_displacement(camera->second) * size.width /
                                                static_cast<double>(camera->second.width));
    }
    dataset.views.push_back(std::move(view));
  }
  if (dataset.indices(Split::train).empty()) {
    return Error{ErrorKind::invalid, images_file, "images", "no image is left for training",
                 "use a larger interval of test views or more images"};
  }
  for (const auto& [width, height, to_width, to_height] : scaled) {
    dataset.warnings.push_back(folder->string() + ": images of " + std::to_string(to_width) + " x " +
                               std::to_string(to_height) + " pixels belong to cameras for " + std::to_string(width) +
                               " x " + std::to_string(height) + "; intrinsics are scaled");
  }
  if (displacement > 0) {
    // A quarter pixel is below what the reconstruction resolves; above it, the edges of the images cannot become sharp.
    dataset.warnings.push_back(
        cameras_file + ": SIMPLE_RADIAL distortion moves pixels by at most " + detail::two_digits(displacement) +
        (displacement <= 0.25
             ? "; it is treated as SIMPLE_PINHOLE"
             : "; it is ignored, so corners will be blurred (undistort with colmap image_undistorter to avoid it)"));
  }

  std::size_t rejected = 0;
  for (const auto& [id, point] : model->points) {
    std::array<float, 3> position{};
    bool finite = true;
    for (std::size_t c = 0; c < 3; ++c) {
      position[c] = static_cast<float>(point.position[c]);
      finite = finite && std::isfinite(position[c]);
    }
    rejected += finite ? 0 : 1;
    if (!finite) continue;
    dataset.points.position.push_back(position);
    dataset.points.color.push_back(point.color);
  }
  if (rejected > 0)
    dataset.warnings.push_back(points_file + ": " + std::to_string(rejected) +
                               " points that are not finite are left out");
  if (dataset.points.position.empty()) {
    return Error{ErrorKind::invalid, points_file, "points", "the model holds no points to start from",
                 "run colmap point_triangulator"};
  }
  return dataset;
}

}  // namespace compmark::inline v0
