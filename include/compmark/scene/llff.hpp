// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// LLFF datasets: poses_bounds.npy and a folder of images (docs/spec/formats.md, 5). A row holds a 3 x 5 matrix [R | t |
// (H, W, f)], camera to world, whose columns run down, right and backwards, then the near and far depth. The i-th image
// by name belongs to the i-th row. Points to start from are drawn between near and far of random rays.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/npy.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/finish.hpp"
#include "compmark/scene/image_folder.hpp"
#include "compmark/scene/mask_lookup.hpp"
#include "compmark/scene/mask_reading.hpp"
#include "compmark/scene/pose.hpp"
#include "compmark/scene/repeated.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {

/// True if the folder holds a dataset of this kind.
[[nodiscard]] inline bool is_llff(const std::filesystem::path& folder) {
  return detail::file_exists(folder / "poses_bounds.npy");
}

namespace detail {

/// Points on random rays of random views, uniform in inverse depth between the view's bounds: as dense in the image
/// near and far.
[[nodiscard]] inline PrecisePoints points_between(const Dataset& dataset,
                                                  const std::vector<std::array<double, 2>>& bounds, std::size_t count,
                                                  std::uint64_t seed) {
  const Random random(seed, 0, random_stage("random points"));
  PrecisePoints points;
  points.color.assign(count, {127, 127, 127});
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t k = static_cast<std::size_t>(random.below(4 * i, dataset.views.size()));
    const Camera<double>& camera = dataset.views[k].camera;
    const double share = random.uniform(4 * i + 1);
    const double z = 1 / ((1 - share) / bounds[k][0] + share / bounds[k][1]);
    const std::array<double, 3> p{(random.uniform(4 * i + 2) * camera.width - camera.cx) / camera.fx * z,
                                  (random.uniform(4 * i + 3) * camera.height - camera.cy) / camera.fy * z, z};
    std::array<double, 3> world = camera.center_world;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) world[a] += camera.rotation_camera_world[3 * b + a] * p[b];
    }
    points.position.push_back(world);
  }
  return points;
}

}  // namespace detail

/// Opens an LLFF dataset.
[[nodiscard]] inline Result<Dataset> open_llff(const std::filesystem::path& folder, const DatasetSettings& settings) {
  const std::filesystem::path file = folder / "poses_bounds.npy";
  const Result<NpyArray> array = read_npy(file);
  if (!array) return array.error();
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, file.string(), std::move(field), std::move(problem), std::move(remedy)};
  };
  if (array->shape.size() != 2 || array->shape[1] != 17 || array->shape[0] == 0)
    return fail(ErrorKind::malformed, "shape", "is not (images, 17)", "write it with LLFF's imgs2poses");
  Result<std::filesystem::path> images = detail::image_folder(folder);
  if (!images) return images.error();
  const std::vector<std::string> names = detail::image_names(*images);
  if (names.size() != array->shape[0]) {
    return fail(ErrorKind::invalid, "shape",
                "holds " + std::to_string(array->shape[0]) + " poses for the " + std::to_string(names.size()) +
                    " images in " + images->string(),
                "remove the images that were not registered");
  }
  Dataset dataset;
  dataset.kind = "llff";
  dataset.root = folder;
  if (!std::is_sorted(names.begin(), names.end(), detail::natural_less)) {
    dataset.warnings.push_back(
        file.string() + ": rows belong to images in the order of their names as text, in which 10 comes before 2");
  }
  detail::ReaderNotes notes;
  std::vector<std::array<double, 2>> bounds;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const double* row = array->values.data() + 17 * i;
    const std::string field = "row " + std::to_string(i);
    for (std::size_t k = 0; k < 17; ++k) {
      if (!std::isfinite(row[k]))
        return fail(ErrorKind::invalid, field + ", column " + std::to_string(k), "is not a finite number",
                    "write it with LLFF's imgs2poses");
    }
    const double height = std::round(row[4]), width = std::round(row[9]), focal = row[14];
    if (!detail::possible_side(height) || !detail::possible_side(width) || !(focal > 0))
      return fail(ErrorKind::invalid, field, "has an impossible image size or focal length",
                  "write it with LLFF's imgs2poses");
    std::array<double, 16> matrix{};
    for (std::size_t c = 0; c < 3; ++c) {
      matrix[4 * c + 0] = row[5 * c + 1];
      matrix[4 * c + 1] = -row[5 * c];
      matrix[4 * c + 2] = row[5 * c + 2];
      matrix[4 * c + 3] = row[5 * c + 3];
    }
    const std::optional<Pose> pose = pose_from_opengl(matrix);
    if (!pose)
      return fail(ErrorKind::invalid, field, "is singular or mirrored, so it is not a camera pose",
                  "write it with LLFF's imgs2poses");
    View view;
    view.name = names[i];
    view.image_path = *images / names[i];
    const Result<ImageInfo> info =
        detail::look_at_image(view, static_cast<int>(width), static_cast<int>(height), notes);
    if (!info) return info.error();
    Camera<double> camera;
    camera.width = static_cast<int>(width);
    camera.height = static_cast<int>(height);
    camera.fx = camera.fy = focal;
    camera.cx = width / 2;
    camera.cy = height / 2;
    camera.rotation_camera_world = pose->rotation_camera_world;
    camera.center_world = pose->center_world;
    detail::place_camera(view, camera, {}, settings, notes);
    if (row[15] > 0 && row[16] > row[15]) bounds.push_back({row[15], row[16]});
    dataset.views.push_back(std::move(view));
  }
  detail::split_views(dataset, settings.test_every);
  detail::say_notes(notes, file.string(), settings.lens, dataset);
  PrecisePoints points;
  if (bounds.size() == dataset.views.size()) {
    points = detail::points_between(dataset, bounds, settings.random_points, settings.seed);
    dataset.points_are_random = true;
  }
  if (settings.masks) {
    detail::find_masks(dataset, folder);
    if (const Result<Done> read = detail::read_masks(dataset); !read) return read.error();
  }
  detail::finish_dataset(dataset, std::move(points), settings);
  return dataset;
}

}  // namespace compmark
