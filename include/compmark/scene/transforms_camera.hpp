// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Intrinsics of a frame of transforms*.json, in all dialects (docs/spec/formats.md, 4). A frame's own values come
// before the file's. Focal length, by the first that is there: x_fov y_fov (degrees), fl_x fl_y (pixels),
// camera_angle_x camera_angle_y (radians); y falls back to x. Pixels are those of the images of size w x h; where a
// file does not give them and only smaller copies of its images are there, what else it says of the size must decide.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/scene/camera.hpp"
#include "compmark/scene/transforms_json.hpp"
#include "compmark/scene/view_reader.hpp"

namespace compmark {
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
  /// All keys that begin so, those of the frame first.
  [[nodiscard]] std::vector<std::string> keys_from(const std::string& begin) const {
    std::vector<std::string> keys;
    for (const Json* object : {&frame_, &file_}) {
      for (auto item = object->begin(); object->is_object() && item != object->end(); ++item) {
        if (item.key().compare(0, begin.size(), begin) == 0) keys.push_back(item.key());
      }
    }
    return keys;
  }

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

/// w and h, each zero where the file does not say.
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
  return size;
}

/// A pair of fields that define the focal length.
struct FocalSource {
  const char* x;
  const char* y;
  double unit;  ///< radians in one, 0: pixels
  double high;
  const char* what;
  const char* remedy;
};

/// The fields to take: any focal length of the frame comes before those of the file. Null if there are none.
template <class Json>
[[nodiscard]] const FocalSource* focal_source(const TransformsFields<Json>& fields) {
  static constexpr std::array<FocalSource, 3> sources{
      {{"x_fov", "y_fov", std::numbers::pi / 180, 179.99, "is not an angle between 0 and 180 degrees",
        "give the field of view in degrees"},
       {"fl_x", "fl_y", 0, 1e12, "is not a positive focal length", "give the focal length in pixels"},
       {"camera_angle_x", "camera_angle_y", 1, 3.14159, "is not an angle between 0 and pi",
        "give the horizontal field of view in radians"}}};
  for (const bool in_frame : {true, false}) {
    for (const FocalSource& source : sources) {
      if (fields.find(source.x) != nullptr && (!in_frame || fields.in_frame(source.x))) return &source;
    }
  }
  return nullptr;
}

/// True if the intrinsics are in pixels, and so belong to one image size; angles are the same at any size.
template <class Json>
[[nodiscard]] bool counts_pixels(const TransformsFields<Json>& fields) {
  const FocalSource* source = focal_source(fields);
  return (source != nullptr && source->unit == 0) || fields.find("cx") != nullptr || fields.find("cy") != nullptr;
}

/// The factor between the image found, a copy made smaller by `reduction`, and the images whose pixels the intrinsics
/// count: 1 or `reduction`, whichever agrees with all other information about their size. Sizes of copies are rounded
/// and principal points are not quite central, so the answer is one of the two and not the quotient. Asked only where w
/// and h are missing.
template <class Json>
[[nodiscard]] Result<int> pixel_reduction(const TransformsFields<Json>& fields, int width, int height, int reduction) {
  const auto number = [&](const char* key) {
    const Json* value = fields.find(key);
    return value == nullptr ? std::optional<double>() : finite_number(*value);
  };
  const std::optional<double> w = number("w"), h = number("h"), cx = number("cx"), cy = number("cy");
  std::vector<double> ratios;
  if (w) ratios.push_back(*w / width);
  if (h) ratios.push_back(*h / height);
  if (cx) ratios.push_back(2 * *cx / width);
  if (cy) ratios.push_back(2 * *cy / height);
  const std::optional<double> focal = number("fl_x"), angle = number("camera_angle_x");
  if (focal && angle) ratios.push_back(2 * *focal * std::tan(*angle / 2) / width);
  for (const int candidate : {reduction, 1}) {
    // A quarter off: less than half the way to the other candidate, more than any principal point of an uncropped
    // image.
    const bool agrees = std::all_of(ratios.begin(), ratios.end(),
                                    [&](double ratio) { return ratio < 1.25 * candidate && ratio > candidate / 1.25; });
    if (agrees && !ratios.empty()) return candidate;
  }
  return fields.error(ErrorKind::malformed, "w",
                      "is missing, and only a smaller copy (images_" + std::to_string(reduction) +
                          ") of the image is there, so it is not known which pixels the intrinsics count",
                      "give w and h of the images that the focal length is for, or add those images");
}

/// The size whose pixels the intrinsics count: w and h; where only one of them is there, of the image's proportions;
/// where none is, the image's own, or that of the folder which it is a smaller copy of. What was not written is noted.
template <class Json>
[[nodiscard]] Result<std::array<int, 2>> counted_size(const TransformsFields<Json>& fields,
                                                      const std::array<int, 2>& written, const ImageInfo& image,
                                                      int reduction, ReaderNotes& notes) {
  if (written[0] > 0 && written[1] > 0) return written;
  std::array<int, 2> size{image.width, image.height};
  if (!counts_pixels(fields)) return size;
  if (reduction > 1) {
    const Result<int> times = pixel_reduction(fields, image.width, image.height, reduction);
    if (!times) return times.error();
    for (int& side : size) side *= *times;
  } else if (written[0] > 0 || written[1] > 0) {
    const double times =
        written[0] > 0 ? static_cast<double>(written[0]) / image.width : static_cast<double>(written[1]) / image.height;
    size = {static_cast<int>(std::lround(times * image.width)), static_cast<int>(std::lround(times * image.height))};
  }
  if (reduction > 1 || size[0] != image.width || size[1] != image.height)
    notes.assumed.insert({size[0], size[1], image.width, image.height});
  return size;
}

/// Camera without pose for images of width x height, which w and h are where the file has them.
template <class Json>
[[nodiscard]] Result<Camera<double>> transforms_intrinsics(const TransformsFields<Json>& fields, int width,
                                                           int height) {
  Camera<double> camera;
  camera.width = width;
  camera.height = height;
  const FocalSource* source = focal_source(fields);
  if (source == nullptr) {
    return fields.error(ErrorKind::malformed, "camera_angle_x", "is missing, so the focal length is not known",
                        "give the horizontal field of view in radians (or fl_x in pixels)");
  }
  const auto x = fields.number(source->x, 0, source->high, source->what, source->remedy);
  if (!x) return x.error();
  const auto y = fields.number(source->y, 0, source->high, source->what, source->remedy);
  if (!y) return y.error();
  const auto focal = [&](double value, int side) {
    return source->unit == 0   ? value
           : source->unit == 1 ? side / (2 * std::tan(value / 2))
                               : side / (2 * std::tan(value * source->unit / 2));
  };
  camera.fx = focal(**x, width);
  camera.fy = *y ? focal(**y, height) : camera.fx;
  const auto cx = fields.number("cx", -1e6, 1e6, "is not a place in pixels", "give the principal point in pixels");
  if (!cx) return cx.error();
  const auto cy = fields.number("cy", -1e6, 1e6, "is not a place in pixels", "give the principal point in pixels");
  if (!cy) return cy.error();
  camera.cx = *cx ? **cx : width / 2.0;
  camera.cy = *cy ? **cy : height / 2.0;
  return camera;
}

}  // namespace detail
}  // namespace compmark
