// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// COLMAP datasets: a sparse model (binary before text; the largest below sparse, sparse, or the folder itself) and a
// folder of images. Files of rigs and frames are not needed: images have their poses. Views are sorted by the image's
// base name up to its first dot and every n-th is a test view, as published (docs/spec/method.md, 3.5). Each image
// keeps the intrinsics of its own camera, scaled by the true ratio of sizes where the files are smaller than what
// COLMAP saw (case CA1). A model without a file of points is read without points.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/colmap_binary.hpp"
#include "compmark/scene/colmap_camera.hpp"
#include "compmark/scene/colmap_model.hpp"
#include "compmark/scene/colmap_text.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/finish.hpp"
#include "compmark/scene/image_folder.hpp"
#include "compmark/scene/image_pairing.hpp"
#include "compmark/scene/mask_lookup.hpp"
#include "compmark/scene/mask_reading.hpp"
#include "compmark/scene/point_file.hpp"
#include "compmark/scene/pose.hpp"
#include "compmark/scene/repeated.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {

namespace detail {

/// The published sort key: the base name up to its first dot; the whole name decides between equals.
[[nodiscard]] inline std::pair<std::string, std::string> colmap_sort_key(const std::string& name) {
  const std::string base = name.substr(name.find_last_of("/\\") + 1);
  return {base.substr(0, base.find('.')), name};
}

/// Pairs the images of the model with files; an empty path is a missing image. As they are written, or else by
/// scene/pairing.hpp.
[[nodiscard]] inline Result<std::vector<std::filesystem::path>> match_images(
    const std::vector<const ColmapImage*>& images, const std::filesystem::path& folder, Dataset& dataset) {
  std::vector<std::string> names;
  for (const ColmapImage* image : images) names.push_back(image->name);
  FoundImages found = images_as_written(folder, names);
  if (found.missing == 0) return std::move(found.paths);
  const std::vector<std::string> files = image_paths(folder, folder != dataset.root);
  if (files.empty()) {
    const std::string other = unread_image(folder / plain_name(names[0])).filename().string();
    return Error{ErrorKind::not_found, folder.string(), "images",
                 "the folder holds no PNG or JPEG image" + (other.empty() ? "" : ", but " + other),
                 other.empty() ? "put the photographs there" : "convert the photographs to PNG or JPEG"};
  }
  pair_the_missing(names, files, files, folder, {true}, found);
  if (found.missing < images.size()) {
    for (const std::string& note : found.notes) dataset.warnings.push_back(folder.string() + ": " + note);
    return std::move(found.paths);
  }
  if (!found.notes.empty()) {
    return Error{ErrorKind::invalid, folder.string(), images[0]->name, found.notes[0],
                 "name the images as the model does, in its folders"};
  }
  return Error{
      ErrorKind::not_found, folder.string(), images[0]->name,
      "there is no such image, nor is any other of the " + std::to_string(images.size()) + " images of the model",
      "add the images the model was made from, under their names"};
}

/// The points of a model, or of points3D.ply beside it where the model came without its file (a cached copy in the
/// published format). Both missing is a model to be started from random points.
[[nodiscard]] inline Result<PrecisePoints> colmap_points(const ColmapModel& model, const std::filesystem::path& folder,
                                                         const std::string& suffix, Dataset& dataset) {
  PrecisePoints points;
  const std::filesystem::path file = folder / ("points3D" + suffix);
  if (file_exists(file)) {
    for (const auto& [id, point] : model.points) {
      points.position.push_back(point.position);
      points.color.push_back(point.color);
    }
    return points;
  }
  const std::filesystem::path copy = folder / "points3D.ply";
  const bool copied = file_exists(copy);
  dataset.warnings.push_back(file.string() + ": is not there" + (copied ? ", points are taken from points3D.ply" : ""));
  if (!copied) return points;
  return read_precise_points(copy);
}

}  // namespace detail

/// True if the folder holds a dataset of this kind.
[[nodiscard]] inline bool is_colmap(const std::filesystem::path& root) {
  return !detail::find_colmap_folder(root).path.empty();
}

/// Reads a model from a folder with cameras, images and, if there, points3D; binary if there, else text.
[[nodiscard]] inline Result<ColmapModel> read_colmap_model(const std::filesystem::path& folder,
                                                           const ColmapReadSettings& settings = {}) {
  return detail::has_binary(folder) ? read_colmap_binary(folder, settings) : read_colmap_text(folder, settings);
}

/// Opens a COLMAP dataset.
[[nodiscard]] inline Result<Dataset> open_colmap(const std::filesystem::path& root, const DatasetSettings& settings) {
  const detail::ColmapFolder place = detail::find_colmap_folder(root);
  const std::filesystem::path& model_folder = place.path;
  const std::string suffix = detail::has_binary(model_folder) ? ".bin" : ".txt";
  const std::string cameras_file = (model_folder / ("cameras" + suffix)).string();
  const std::string images_file = (model_folder / ("images" + suffix)).string();
  const Result<ColmapModel> model = read_colmap_model(model_folder);
  if (!model) return model.error();
  if (model->images.empty()) {
    return Error{ErrorKind::invalid, images_file, "images", "the model holds no registered image",
                 "run colmap mapper again with more overlapping photographs"};
  }

  Dataset dataset;
  dataset.kind = "colmap";
  dataset.root = root;
  if (!place.others.empty()) {
    std::string text = model_folder.string() + ": the largest sub-model, with " + std::to_string(place.images) +
                       " images, is used; left out:";
    for (std::size_t i = 0; i < std::min<std::size_t>(place.others.size(), 8); ++i)
      text += " " + place.others[i].first + " with " + std::to_string(place.others[i].second);
    if (place.others.size() > 8) text += " and " + std::to_string(place.others.size() - 8) + " others";
    dataset.warnings.push_back(text);
  }
  for (const char* text : {"cameras.txt", "images.txt", "points3D.txt"}) {
    if (suffix != ".bin" || !detail::file_exists(model_folder / text)) continue;
    dataset.warnings.push_back((model_folder / text).string() + ": is not used, as the model is there in binary files");
    break;
  }
  std::vector<const ColmapImage*> images;
  for (const auto& entry : model->images) images.push_back(&entry.second);
  std::sort(images.begin(), images.end(), [](const ColmapImage* a, const ColmapImage* b) {
    return detail::colmap_sort_key(a->name) < detail::colmap_sort_key(b->name);
  });
  std::set<std::string> names;
  for (const ColmapImage* image : images) {
    if (!names.insert(image->name).second) {
      return Error{ErrorKind::malformed, images_file, image->name, "is the name of two images of the model",
                   "remove one of the two with colmap image_deleter"};
    }
  }
  const Result<std::filesystem::path> folder = detail::image_folder(root);
  if (!folder) return folder.error();
  const Result<std::vector<std::filesystem::path>> paths = detail::match_images(images, *folder, dataset);
  if (!paths) return paths.error();

  detail::ReaderNotes notes;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const ColmapImage& image = *images[i];
    const auto camera = model->cameras.find(image.camera_id);
    if (camera == model->cameras.end()) {
      return Error{ErrorKind::malformed, images_file, image.name,
                   "names camera " + std::to_string(image.camera_id) + ", which cameras" + suffix + " does not have",
                   "export the model again"};
    }
    const Result<detail::ColmapIntrinsics> intrinsics =
        detail::colmap_intrinsics(camera->second, image.camera_id, cameras_file);
    if (!intrinsics) return intrinsics.error();
    const std::optional<Pose> pose = pose_from_quaternion(image.rotation_wxyz, image.translation);
    if (!pose) {
      return Error{ErrorKind::invalid, images_file, image.name, "its pose is not finite or its quaternion is zero",
                   "remove the image from the model with colmap image_deleter"};
    }
    if ((*paths)[i].empty()) {
      if (notes.missing++ == 0) {
        notes.first_missing = image.name;
        notes.unread = detail::unread_image(*folder / detail::plain_name(image.name)).filename().string();
      }
      continue;
    }
    View view;
    view.name = image.name;
    view.image_path = (*paths)[i];
    const Result<ImageInfo> info =
        detail::look_at_image(view, intrinsics->camera.width, intrinsics->camera.height, notes);
    if (!info) return info.error();
    Camera<double> posed = intrinsics->camera;
    posed.rotation_camera_world = pose->rotation_camera_world;
    posed.center_world = pose->center_world;
    detail::place_camera(view, posed, intrinsics->lens, settings, notes);
    dataset.views.push_back(std::move(view));
  }
  if (const Result<Done> once = detail::leave_out_repeated(dataset, images_file); !once) return once.error();
  detail::split_views(dataset, settings.test_every);
  detail::say_notes(notes, cameras_file, settings.lens, dataset);
  if (settings.masks) {
    detail::find_masks(dataset, root);
    if (const Result<Done> read = detail::read_masks(dataset); !read) return read.error();
  }
  Result<PrecisePoints> points = detail::colmap_points(*model, model_folder, suffix, dataset);
  if (!points) return points.error();
  detail::finish_dataset(dataset, std::move(*points), settings);
  return dataset;
}

}  // namespace compmark
