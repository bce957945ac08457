// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Intrinsics and lens of a frame of transforms*.json, in all dialects (ecosystem sheet, section 2.4). A frame's own values come before the
// file's. Focal length, by the first that is there: x_fov y_fov (degrees), fl_x fl_y (pixels), camera_angle_x camera_angle_y (radians); y
// falls back to x. The lens: k1 … k6 p1 p2, or distortion_params [k1 k2 k3 k4 p1 p2], of the camera_model (OPENCV if not named).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/scene/transforms_json.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark::inline v0 {
namespace detail {

/// Looks a key up in a frame, then in the file; remembers the first value that is there and of no use.
template <class Json>
class TransformsFields {
 public:
  TransformsFields(const Json& file, const Json& frame, std::string name, std::string where)
      : file_(file),
        frame_(frame),
        name_(std::move(name)),
        where_(std::move(where)) {}

  [[nodiscard]] const Json* find(const char* key) const {
    if (frame_.contains(key)) return &frame_[key];
    return file_.contains(key) ? &file_[key] : nullptr;
  }
  [[nodiscard]] std::string field(const char* key) const { return frame_.contains(key) ? where_ + "." + key : key; }
  [[nodiscard]] bool in_frame(const char* key) const { return frame_.contains(key); }

  /// A number in (low, high), or nothing if the key is not there.
  [[nodiscard]] Result<std::optional<double>> number(const char* key, double low, double high, const char* what,
                                                     const char* remedy) const {
    const Json* value = find(key);
    if (value == nullptr) return std::optional<double>();
    const std::optional<double> number = finite_number(*value);
    if (!number || !(*number > low) || !(*number < high)) return error(ErrorKind::invalid, key, what, remedy);
    return number;
  }
  [[nodiscard]] Error error(ErrorKind kind, const char* key, std::string problem, std::string remedy) const {
    return {kind, name_, field(key), std::move(problem), std::move(remedy)};
  }

 private:
  const Json& file_;
  const Json& frame_;
  std::string name_;
  std::string where_;
};

/// w and h, zero where the file does not say.
template <class Json>
[[nodiscard]] Result<std::array<int, 2>> transforms_size(const TransformsFields<Json>& fields) {
  std::array<int, 2> size{0, 0};
  constexpr std::array<const char*, 2> keys{"w", "h"};
  for (std::size_t i = 0; i < 2; ++i) {
    const auto side = fields.number(keys[i], 0.5, 65536.5, "is not a width or height in pixels",
                                    "give the size of the images the poses were computed from");
    if (!side) return side.error();
    if (*side) size[i] = static_cast<int>(std::lround(**side));
  }
  if (size[0] == 0 || size[1] == 0) return std::array<int, 2>{0, 0};
  return size;
}

/// Camera without pose for images of width x height, which w and h are where the file has them.
template <class Json>
[[nodiscard]] Result<Camera<double>> transforms_intrinsics(const TransformsFields<Json>& fields, int width,
                                                           int height) {
  Camera<double> camera;
  camera.width = width;
  camera.height = height;
  struct Source {
    const char* x;
    const char* y;
    double unit;  // radians in one, 0: pixels
    double high;
    const char* what;
    const char* remedy;
  };
  constexpr std::array<Source, 3> sources{
      {{"x_fov", "y_fov", std::numbers::pi / 180, 179.99, "is not an angle between 0 and 180 degrees",
        "give the field of view in degrees"},
       {"fl_x", "fl_y", 0, 1e12, "is not a positive focal length", "give the focal length in pixels"},
       {"camera_angle_x", "camera_angle_y", 1, 3.14159, "is not an angle between 0 and pi",
        "give the horizontal field of view in radians"}}};
  bool found = false;
  for (const bool in_frame : {true, false}) {  // any focal length of the frame comes before those of the file
    for (const Source& source : sources) {
      if (found || fields.find(source.x) == nullptr || (in_frame && !fields.in_frame(source.x))) continue;
      const auto x = fields.number(source.x, 0, source.high, source.what, source.remedy);
      if (!x) return x.error();
      const auto y = fields.number(source.y, 0, source.high, source.what, source.remedy);
      if (!y) return y.error();
      const auto focal = [&](double value, int side) {
        return source.unit == 0   ? value
               : source.unit == 1 ? side / (2 * std::tan(value / 2))
                                  : side / (2 * std::tan(value * source.unit / 2));
      };
      camera.fx = focal(**x, width);
      camera.fy = *y ? focal(**y, height) : camera.fx;
      found = true;
    }
  }
  if (!found) {
    return fields.error(ErrorKind::malformed, "camera_angle_x", "is missing, so the focal length is not known",
                        "give the horizontal field of view in radians (or fl_x in pixels)");
  }
  const auto cx = fields.number("cx", -1e6, 1e6, "is not a place in pixels", "give the principal point in pixels");
  if (!cx) return cx.error();
  const auto cy = fields.number("cy", -1e6, 1e6, "is not a place in pixels", "give the principal point in pixels");
  if (!cy) return cy.error();
  camera.cx = *cx ? **cx : width / 2.0;
  camera.cy = *cy ? **cy : height / 2.0;
  return camera;
}

/// The lens of a frame.
template <class Json>
[[nodiscard]] Result<Lens> transforms_lens(const TransformsFields<Json>& fields) {
  std::string model = "OPENCV";
  const Json* named = fields.find("camera_model");
  if (named != nullptr) {
    if (!named->is_string())
      return fields.error(ErrorKind::malformed, "camera_model", "is not a name",
                          "use \"OPENCV\" or \"OPENCV_FISHEYE\"");
    model = named->template get<std::string>();
  }
  const Json* flag = fields.find("is_fisheye");
  if (flag != nullptr && flag->is_boolean() && flag->template get<bool>()) model = "OPENCV_FISHEYE";

  // k1 … k6 and p1 p2 by name; distortion_params [k1 k2 k3 k4 p1 p2] where there are none.
  constexpr std::array<const char*, 8> names{"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"};
  constexpr std::array<std::size_t, 6> order{0, 1, 2, 3, 6, 7};
  std::array<double, 8> k{};
  if (const Json* list = fields.find("distortion_params"); list != nullptr && !list->is_null()) {
    if (!list->is_array() || list->size() > order.size())
      return fields.error(ErrorKind::malformed, "distortion_params", "is not a list of up to 6 numbers",
                          "give [k1, k2, k3, k4, p1, p2]");
    for (std::size_t i = 0; i < list->size(); ++i) {
      const std::optional<double> value = finite_number((*list)[i]);
      if (!value)
        return fields.error(ErrorKind::invalid, "distortion_params", "holds something that is not a finite number",
                            "give [k1, k2, k3, k4, p1, p2]");
      k[order[i]] = *value;
    }
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto value = fields.number(names[i], -1e6, 1e6, "is not a distortion coefficient", "give a finite number");
    if (!value) return value.error();
    if (*value) k[i] = **value;
  }
  if (model == "PINHOLE" || model == "SIMPLE_PINHOLE") return Lens{};
  if (model == "OPENCV_FISHEYE" || model == "SIMPLE_RADIAL_FISHEYE" || model == "RADIAL_FISHEYE")
    return Lens{LensModel::opencv_fisheye, {k[0], k[1], k[2], k[3]}};
  if (model == "FULL_OPENCV") return Lens{LensModel::full_opencv, {k[0], k[1], k[6], k[7], k[2], k[3], k[4], k[5]}};
  if (model == "OPENCV" || model == "PERSPECTIVE" || model == "SIMPLE_RADIAL" || model == "RADIAL") {
    if (k[3] != 0 || k[4] != 0 || k[5] != 0) {
      return fields.error(ErrorKind::unsupported, "k4", "is not a coefficient of the camera model " + model,
                          "name the camera_model (OPENCV_FISHEYE or FULL_OPENCV), or undistort the images");
    }
    if (k[2] != 0) return Lens{LensModel::full_opencv, {k[0], k[1], k[6], k[7], k[2]}};
    const Lens lens{LensModel::opencv, {k[0], k[1], k[6], k[7]}};
    return is_pinhole(lens) ? Lens{} : lens;
  }
  return fields.error(ErrorKind::unsupported, "camera_model",
                      "\"" + model + "\" is no lens that can be brought to a pinhole",
                      "export perspective or fisheye images (cut panoramas into perspective views)");
}

}  // namespace detail
}  // namespace compmark::inline v0
