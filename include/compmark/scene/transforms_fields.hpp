// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The treatment of every field of transforms*.json, from any program (docs/capture_formats.md has the same table). A
// field is refused if it would change the cameras or the photographs and is not supported. A field that a training
// could use, but this one does not, gives a warning; so does a field that is not in the table, once. Cost: one look-up
// a field.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/scene/transforms_json.hpp"

namespace compmark {

enum class FieldUse {
  used,      ///< by the reader
  harmless,  ///< changes neither cameras nor photographs
  warned,    ///< not used, which is said where it is switched on
  refused    ///< an Error where it is switched on
};

struct TransformsField {
  std::string_view name;
  FieldUse use;
  std::string_view what;         ///< of a field that is not used: what it would mean
  std::string_view remedy = "";  ///< of one that is refused
};

inline constexpr std::string_view transforms_axes =
    "write camera-to-world matrices with x right, y up and the camera looking along -z";

inline constexpr std::array<TransformsField, 93> transforms_fields{{
    {"frames", FieldUse::used, ""},
    {"file_path", FieldUse::used, ""},
    {"transform_matrix", FieldUse::used, ""},
    {"camera_angle_x", FieldUse::used, ""},
    {"camera_angle_y", FieldUse::used, ""},
    {"fl_x", FieldUse::used, ""},
    {"fl_y", FieldUse::used, ""},
    {"x_fov", FieldUse::used, ""},
    {"y_fov", FieldUse::used, ""},
    {"cx", FieldUse::used, ""},
    {"cy", FieldUse::used, ""},
    {"w", FieldUse::used, ""},
    {"h", FieldUse::used, ""},
    {"k1", FieldUse::used, ""},
    {"k2", FieldUse::used, ""},
    {"k3", FieldUse::used, ""},
    {"k4", FieldUse::used, ""},
    {"k5", FieldUse::used, ""},
    {"k6", FieldUse::used, ""},
    {"p1", FieldUse::used, ""},
    {"p2", FieldUse::used, ""},
    {"distortion_params", FieldUse::used, ""},
    {"camera_model", FieldUse::used, ""},
    {"is_fisheye", FieldUse::used, ""},
    {"ftheta_p0", FieldUse::used, ""},
    {"ftheta_p1", FieldUse::used, ""},
    {"ftheta_p2", FieldUse::used, ""},
    {"ftheta_p3", FieldUse::used, ""},
    {"ftheta_p4", FieldUse::used, ""},
    {"latlong", FieldUse::used, ""},
    {"equirectangular", FieldUse::used, ""},
    {"orthographic", FieldUse::used, ""},
    {"mask_path", FieldUse::used, ""},
    {"ply_file_path", FieldUse::used, ""},
    {"train_filenames", FieldUse::used, ""},
    {"val_filenames", FieldUse::used, ""},
    {"test_filenames", FieldUse::used, ""},
    {"aabb", FieldUse::harmless, ""},
    {"aabb_scale", FieldUse::harmless, ""},
    {"render_aabb", FieldUse::harmless, ""},
    {"render_aabb_to_local", FieldUse::harmless, ""},
    {"scale", FieldUse::harmless, ""},
    {"offset", FieldUse::harmless, ""},
    {"up", FieldUse::harmless, ""},
    {"sharpness", FieldUse::harmless, ""},
    {"importance_sampling", FieldUse::harmless, ""},
    {"applied_transform", FieldUse::harmless, ""},
    {"applied_scale", FieldUse::harmless, ""},
    {"orientation_override", FieldUse::harmless, ""},
    {"colmap_im_id", FieldUse::harmless, ""},
    {"rotation", FieldUse::harmless, ""},
    {"timestamp", FieldUse::harmless, ""},
    {"generator", FieldUse::harmless, ""},
    {"comment", FieldUse::harmless, ""},
    {"name", FieldUse::harmless, ""},
    {"id", FieldUse::harmless, ""},
    {"image_id", FieldUse::harmless, ""},
    {"camera_id", FieldUse::harmless, ""},
    {"depth_file_path", FieldUse::warned, "depth maps"},
    {"depth_path", FieldUse::warned, "depth maps"},
    {"enable_depth_loading", FieldUse::warned, "depth maps"},
    {"integer_depth_scale", FieldUse::warned, "the unit of depth maps"},
    {"depth_unit_scale_factor", FieldUse::warned, "the unit of depth maps"},
    {"normal_file_path", FieldUse::warned, "normal maps"},
    {"semantic", FieldUse::warned, "labels of pixels"},
    {"semantics", FieldUse::warned, "labels of pixels"},
    {"semantic_path", FieldUse::warned, "labels of pixels"},
    {"light_dir", FieldUse::warned, "a moving light"},
    {"driver_parameters", FieldUse::warned, "what moves the scene"},
    {"n_extra_learnable_dims", FieldUse::warned, "codes of appearance"},
    {"sharpness_discard_threshold", FieldUse::warned, "photographs to leave out"},
    {"sharpen", FieldUse::warned, "photographs are to be sharpened"},
    {"exposure", FieldUse::warned, "how bright photographs are"},
    {"is_hdr", FieldUse::warned, "colours are linear"},
    {"linear_colors", FieldUse::warned, "colours are linear"},
    {"bayer", FieldUse::warned, "photographs are raw"},
    {"white_transparent", FieldUse::warned, "white pixels are transparent"},
    {"black_transparent", FieldUse::warned, "black pixels are transparent"},
    {"mask_color", FieldUse::warned, "pixels of one colour do not count"},
    {"fix_premult", FieldUse::warned, "colours are multiplied by their alpha"},
    {"fisheye_crop_radius", FieldUse::warned, "pixels beyond a circle do not count"},
    {"rolling_shutter", FieldUse::warned, "rows are exposed one after the other"},
    {"transform_matrix_start", FieldUse::warned, "the camera moves during the exposure"},
    {"transform_matrix_end", FieldUse::warned, "the camera moves during the exposure"},
    {"time", FieldUse::warned, "the scene moves"},
    {"enable_ray_loading", FieldUse::warned, "rays of single pixels"},
    {"n_frames", FieldUse::warned, "only so many frames are meant"},
    {"envmap", FieldUse::warned, "surroundings at infinity"},
    {"near", FieldUse::warned, "where the scene begins"},
    {"far", FieldUse::warned, "where the scene ends"},
    {"intrinsic_matrix", FieldUse::refused, "gives intrinsics as a matrix", "write them as fl_x, fl_y, cx and cy"},
    {"from_na", FieldUse::refused, "says that the poses have other axes", transforms_axes},
    {"normal_mts_args", FieldUse::refused, "says that the poses have the axes of Mitsuba", transforms_axes},
}};

namespace detail {

/// Null if the table does not have it.
[[nodiscard]] inline const TransformsField* transforms_field(std::string_view name) {
  static const auto by_name = [] {
    std::array<const TransformsField*, transforms_fields.size()> fields{};
    for (std::size_t i = 0; i < fields.size(); ++i) fields[i] = &transforms_fields[i];
    std::sort(fields.begin(), fields.end(),
              [](const TransformsField* a, const TransformsField* b) { return a->name < b->name; });
    return fields;
  }();
  const auto found =
      std::lower_bound(by_name.begin(), by_name.end(), name,
                       [](const TransformsField* field, std::string_view wanted) { return field->name < wanted; });
  return found == by_name.end() || (*found)->name != name ? nullptr : *found;
}

/// False, 0, null, "", an empty list, or a list of such.
template <class Json>
[[nodiscard]] bool says_nothing(const Json& value) {
  if (value.is_string()) return value.template get<std::string>().empty();
  if (!value.is_array() && !value.is_object()) return switched_off(value);
  return std::all_of(value.begin(), value.end(), [](const Json& v) { return says_nothing(v); });
}

/// The Error of a field that cannot be followed, or a warning for each that is not used. `json` has a list of frames.
template <class Json>
[[nodiscard]] Result<Done> look_at_fields(const std::string& file, const Json& json, Dataset& dataset) {
  std::map<std::string_view, std::set<std::string>> unused;  // what they would mean: the fields
  std::set<std::string> unknown;
  std::set<std::string> times;
  const auto look = [&](const Json& object, const std::string& where) -> Result<Done> {
    for (auto item = object.begin(); item != object.end(); ++item) {
      const std::string& key = item.key();
      const TransformsField* field = transforms_field(key);
      if (field != nullptr && (field->use == FieldUse::used || field->use == FieldUse::harmless)) continue;
      if (key.compare(0, 7, "ftheta_") == 0) continue;  // transforms_lens.hpp
      if (key == "time") {
        times.insert(item->dump());
      } else if (field == nullptr) {
        if (unknown.size() < 1000) unknown.insert(key);
      } else if (says_nothing(*item) || (key == "n_frames" && item->is_number() &&
                                         item->template get<double>() >= static_cast<double>(json["frames"].size()))) {
        continue;
      } else if (field->use == FieldUse::refused) {
        return Error{ErrorKind::unsupported, file, where + key, std::string(field->what) + ", which is not read",
                     std::string(field->remedy)};
      } else {
        unused[field->what].insert(key);
      }
    }
    return Done{};
  };
  if (const Result<Done> done = look(json, ""); !done) return done.error();
  for (std::size_t i = 0; i < json["frames"].size(); ++i) {
    const Json& frame = json["frames"][i];
    if (!frame.is_object()) continue;  // the reader of frames says so
    if (const Result<Done> done = look(frame, "frames[" + std::to_string(i) + "]."); !done) return done.error();
  }
  if (times.size() > 1) unused["the scene moves"].insert("time");
  for (const auto& [what, keys] : unused) {
    std::string list;
    for (const std::string& key : keys) list += (list.empty() ? "" : ", ") + key;
    dataset.warnings.push_back(file + ": " + list + (keys.size() > 1 ? " are" : " is") + " not used (" +
                               std::string(what) + ")");
  }
  if (!unknown.empty()) {
    std::string list;
    std::size_t named = 0;
    for (const std::string& key : unknown) {
      if (named++ < 6) list += (list.empty() ? "\"" : ", \"") + key.substr(0, 40) + "\"";
    }
    dataset.warnings.push_back(
        file + ": " + list + (unknown.size() > 6 ? " and " + std::to_string(unknown.size() - 6) + " others" : "") +
        (unknown.size() > 1 ? " are fields" : " is a field") + " that this reader does not know, and not used");
  }
  return Done{};
}

}  // namespace detail
}  // namespace compmark
