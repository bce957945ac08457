// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Datasets described by transforms*.json: NeRF-synthetic ("Blender": transforms_train.json and transforms_test.json),
// instant-ngp and nerfstudio (one transforms.json). Poses are OpenGL camera-to-world matrices and are taken as given:
// aabb_scale, scale, offset are internal to instant-ngp, applied_transform and applied_scale are already in the poses
// and in the point file (docs/spec/formats.md, 4). Images that are not there are counted and left out, and never
// replaced by what another frame names. Splits: the file's own, or every n-th image by name.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/finish.hpp"
#include "compmark/scene/image_lookup.hpp"
#include "compmark/scene/mask_lookup.hpp"
#include "compmark/scene/mask_reading.hpp"
#include "compmark/scene/point_file.hpp"
#include "compmark/scene/pose.hpp"
#include "compmark/scene/random_points.hpp"
#include "compmark/scene/repeated.hpp"
#include "compmark/scene/transforms_camera.hpp"
#include "compmark/scene/transforms_fields.hpp"
#include "compmark/scene/transforms_images.hpp"
#include "compmark/scene/transforms_json.hpp"
#include "compmark/scene/transforms_lens.hpp"
#include "compmark/scene/transforms_split.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {

namespace detail {

/// Appends the frames of one file. `images`: of find_frame_images, one a frame. A list of test frames may be empty, and
/// may have poses alone.
template <class Json>
[[nodiscard]] Result<Done> append_frames(const std::filesystem::path& file, const Json& json, Split split,
                                         std::span<const FoundImage> images, const DatasetSettings& settings,
                                         Dataset& dataset) {
  const std::string name = file.string();
  const auto fail = [&](ErrorKind kind, std::string field, std::string problem, std::string remedy) {
    return Error{kind, name, std::move(field), std::move(problem), std::move(remedy)};
  };
  if (!json.is_object() || !json.contains("frames") || !json["frames"].is_array()) {
    return fail(ErrorKind::malformed, "frames", "is missing, so there are no poses",
                "give a transforms file with a list of frames");
  }
  const Json& frames = json["frames"];
  if (frames.empty()) {
    if (split == Split::test) {
      dataset.warnings.push_back(name + ": its list of frames is empty, so there are no test views");
      return Done{};
    }
    return fail(ErrorKind::invalid, "frames", "is empty, so there are no images", "give at least one frame");
  }
  if (const Result<Done> looked = look_at_fields(name, json, dataset); !looked) return looked.error();
  ReaderNotes notes;
  double worst_defect = 0;
  double worst_scale = 1;
  std::string first_missing_field;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const Json& frame = frames[i];
    const std::string where = "frames[" + std::to_string(i) + "]";
    if (!frame.is_object() || !frame.contains("file_path") || !frame["file_path"].is_string()) {
      return fail(ErrorKind::malformed, where + ".file_path", "is missing",
                  "give the image's path relative to the JSON file");
    }
    const TransformsFields<Json> fields(json, frame, name, where);
    const Result<std::array<double, 16>> matrix = read_matrix(frame, name, where);
    if (!matrix) return matrix.error();
    const std::optional<Pose> pose = pose_from_opengl(*matrix);
    if (!pose) {
      return fail(ErrorKind::invalid, where + ".transform_matrix",
                  "is singular or mirrored, so it is not a camera pose", "correct the pose or remove the frame");
    }
    const Result<Lens> lens = transforms_lens(fields);
    if (!lens) return lens.error();
    const Result<std::array<int, 2>> size = transforms_size(fields);
    if (!size) return size.error();

    View view;
    view.name = frame["file_path"].template get<std::string>();
    const FoundImage& found = images[i];
    view.image_path = found.path;
    view.split = split;
    if (view.image_path.empty()) {
      // Checked with a made-up size: a bad focal length is an Error whether or not the image is there.
      if (const Result<Camera<double>> camera = transforms_intrinsics(fields, 1, 1); !camera) return camera.error();
      if (notes.missing++ == 0) {
        notes.first_missing = view.name;
        notes.unread = unread_image(file.parent_path() / plain_name(view.name)).filename().string();
        first_missing_field = where + ".file_path";
      }
      continue;
    }
    const bool sized = (*size)[0] > 0 && (*size)[1] > 0;
    const Result<ImageInfo> info = look_at_image(view, sized ? (*size)[0] : 0, sized ? (*size)[1] : 0, notes);
    if (!info) return info.error();
    const Result<std::array<int, 2>> pixels = counted_size(fields, *size, *info, found.reduction, notes);
    if (!pixels) return pixels.error();
    Result<Camera<double>> camera = transforms_intrinsics(fields, (*pixels)[0], (*pixels)[1]);
    if (!camera) return camera.error();
    camera->rotation_camera_world = pose->rotation_camera_world;
    camera->center_world = pose->center_world;
    place_camera(view, *camera, *lens, settings, notes);
    worst_defect = std::max(worst_defect, pose->defect);
    if (std::abs(pose->scale - 1) > std::abs(worst_scale - 1)) worst_scale = pose->scale;

    if (const Json* mask = fields.find("mask_path"); settings.masks && mask != nullptr && !says_nothing(*mask)) {
      if (mask->is_string()) view.mask_path = find_image(file.parent_path(), mask->template get<std::string>()).path;
      if (view.mask_path.empty())
        return fail(
            ErrorKind::not_found, fields.field("mask_path"),
            "names " + mask->dump(-1, ' ', false, Json::error_handler_t::replace) + ", but there is no such image",
            "add the mask or remove the field");
    }
    dataset.views.push_back(std::move(view));
  }
  if (notes.images == 0 && split == Split::test) {
    dataset.warnings.push_back(name + ": none of its " + std::to_string(notes.missing) +
                               " images is there (the first is \"" + notes.first_missing +
                               "\"), so there are no test views" + notes.unread_text());
    return Done{};
  }
  if (notes.images == 0) {
    return fail(ErrorKind::not_found, first_missing_field,
                "names \"" + notes.first_missing + "\", but there is no such image (nor with .png or .jpg)" +
                    (notes.missing > 1 ? ", nor is any other of the " + std::to_string(notes.missing) : ""),
                notes.unread.empty() ? "add the images or remove the frames"
                                     : "convert " + notes.unread + " and the others to PNG or JPEG");
  }
  // 1e-3: float32 matrices are off by 1e-7, hand-rounded ones (4 digits) by 1e-4; more is a mistake worth a word.
  if (worst_defect > 1e-3)
    dataset.warnings.push_back(name + ": rotations (transform_matrix) are off by up to " +
                               std::to_string(worst_defect) + "; the nearest rotations are used");
  if (std::abs(worst_scale - 1) > 1e-3) {
    dataset.warnings.push_back(name + ": poses (transform_matrix) contain a scale of " + std::to_string(worst_scale) +
                               ", which is ignored");
  }
  say_notes(notes, name, settings.lens, dataset);
  return Done{};
}

}  // namespace detail

/// The transforms file of a folder, transforms_train.json before transforms.json; empty if it has none.
[[nodiscard]] inline std::filesystem::path find_transforms(const std::filesystem::path& folder) {
  for (const char* name : {"transforms_train.json", "transforms.json"}) {
    if (detail::file_exists(folder / name)) return folder / name;
  }
  return {};
}

/// Opens a dataset by its JSON file; for transforms_train.json the test views are those of transforms_test.json beside
/// it, if there (transforms_val.json is not used, as in the published evaluation).
template <class Json = nlohmann::json>
[[nodiscard]] Result<Dataset> open_transforms(const std::filesystem::path& file, const DatasetSettings& settings) {
  const bool blender = file.filename() == "transforms_train.json";
  const std::filesystem::path folder = file.parent_path();
  Dataset dataset;
  dataset.kind = blender ? "blender" : "transforms";
  dataset.root = folder;
  const Result<Json> json = detail::read_transforms<Json>(file);
  if (!json) return json.error();
  const std::filesystem::path test = folder / "transforms_test.json";
  std::optional<Result<Json>> test_json;
  std::vector<std::string> names = detail::frame_names(*json), notes;
  const std::size_t own = names.size();
  if (blender && detail::file_exists(test)) {
    test_json = detail::read_transforms<Json>(test);
    if (!*test_json) return test_json->error();
    const std::vector<std::string> more = detail::frame_names(**test_json);
    names.insert(names.end(), more.begin(), more.end());
  }
  const std::vector<detail::FoundImage> images = detail::find_frame_images(folder, names, notes);
  for (const std::string& note : notes) dataset.warnings.push_back(folder.string() + ": " + note);
  const std::span<const detail::FoundImage> all(images);
  Result<Done> done = detail::append_frames(file, *json, Split::train, all.first(own), settings, dataset);
  if (!done) return done.error();
  if (blender) {
    if (test_json) {
      done = detail::append_frames(test, **test_json, Split::test, all.subspan(own), settings, dataset);
      if (!done) return done.error();
    } else {
      dataset.warnings.push_back(
          test.string() + ": not there, so there are no test views" +
          (detail::file_exists(folder / "transforms_val.json") ? " (transforms_val.json is not used)" : ""));
    }
  }
  if (done = detail::leave_out_repeated(dataset, file.string()); !done) return done.error();
  if (!blender) {
    std::stable_sort(dataset.views.begin(), dataset.views.end(),
                     [](const View& a, const View& b) { return detail::natural_less(a.name, b.name); });
    const Result<bool> lists = detail::split_by_lists(file, *json, dataset);
    if (!lists) return lists.error();
    if (!*lists) detail::split_views(dataset, settings.test_every);
  }
  if (settings.masks) {
    detail::find_masks(dataset, folder);
    if (const Result<Done> read = detail::read_masks(dataset); !read) return read.error();
  }

  PrecisePoints points;
  std::filesystem::path point_file;
  if (json->contains("ply_file_path") && !detail::says_nothing((*json)["ply_file_path"])) {
    if (!(*json)["ply_file_path"].is_string()) {
      return Error{ErrorKind::malformed, file.string(), "ply_file_path", "is not the path of a file",
                   "correct it or remove the field"};
    }
    point_file = folder / detail::plain_name((*json)["ply_file_path"].template get<std::string>());
  }
  if (blender && settings.use_point_file && detail::file_exists(folder / "points3d.ply"))
    point_file = folder / "points3d.ply";
  if (!point_file.empty() && detail::file_exists(point_file)) {
    Result<PrecisePoints> read = read_precise_points(point_file);
    if (!read) return read.error();
    points = std::move(*read);
  } else if (point_file.empty()) {
    for (const char* name : {"sparse_pc.ply", "points3d.ply", "points3D.ply", "pointcloud.ply", "point_cloud.ply"}) {
      if (detail::file_exists(folder / name))
        dataset.warnings.push_back((folder / name).string() + ": is not used, as no ply_file_path names it");
    }
  } else if (!point_file.empty()) {
    dataset.warnings.push_back(file.string() + ": ply_file_path names \"" + point_file.string() +
                               "\", which is not there");
  }
  if (blender && points.position.empty()) {
    detail::move_to_origin(dataset, points);
    detail::fit_unit(dataset, points);
    if (dataset.unit != 1 || dataset.origin == std::array<double, 3>{0, 0, 0}) {
      dataset.points = dataset.unit != 1
                           ? random_points(dataset, settings.random_points, settings.seed, published_reach)
                           : random_points(settings.random_points, published_cube, settings.seed);
      dataset.points_are_random = true;
      return dataset;
    }
  }
  detail::finish_dataset(dataset, std::move(points), settings);
  return dataset;
}

}  // namespace compmark
