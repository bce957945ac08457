// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A stored view, and its camera and lens as the rows of numbers that model files and compressed files hold. Every
// number is checked before it is used.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_model.hpp"

namespace compmark {

/// A view that the model knows: enough to render it again without the dataset.
struct StoredView {
  std::string name;
  bool test = false;
  Camera<double> camera;
  Lens
      lens{};  ///< that the model is rendered through; a pinhole where the images were undistorted, or the lens ignored
};

namespace detail {

/// Camera: width, height, fx, fy, cx, cy, rotation[9], center[3]. Lens: model, parameters[16].
inline constexpr std::size_t camera_numbers = 18, lens_numbers = 17;

inline void append_camera_row(const Camera<double>& camera, std::vector<double>& table) {
  table.insert(table.end(), {static_cast<double>(camera.width), static_cast<double>(camera.height), camera.fx,
                             camera.fy, camera.cx, camera.cy});
  table.insert(table.end(), camera.rotation_camera_world.begin(), camera.rotation_camera_world.end());
  table.insert(table.end(), camera.center_world.begin(), camera.center_world.end());
}
inline void append_lens_row(const Lens& lens, std::vector<double>& table) {
  table.push_back(static_cast<double>(lens.model));
  table.insert(table.end(), lens.parameters.begin(), lens.parameters.end());
}

/// A whole number of [low, high]: a fraction or NaN is none.
[[nodiscard]] inline bool whole_between(double value, double low, double high) {
  return value >= low && value <= high && value == std::floor(value);
}

/// False for numbers that no camera has: `camera` is then as it was.
[[nodiscard]] inline bool read_camera_row(std::span<const double, camera_numbers> row, Camera<double>& camera) {
  if (!std::all_of(row.begin(), row.end(), [](double x) { return std::isfinite(x); }) ||
      !whole_between(row[0], 1, 65536) || !whole_between(row[1], 1, 65536) || !(row[2] > 0) || !(row[3] > 0)) {
    return false;
  }
  camera.width = static_cast<int>(row[0]);
  camera.height = static_cast<int>(row[1]);
  camera.fx = row[2];
  camera.fy = row[3];
  camera.cx = row[4];
  camera.cy = row[5];
  std::copy_n(row.begin() + 6, 9, camera.rotation_camera_world.begin());
  std::copy_n(row.begin() + 15, 3, camera.center_world.begin());
  return true;
}
/// False for numbers that no lens has: `lens` is then as it was.
[[nodiscard]] inline bool read_lens_row(std::span<const double, lens_numbers> row, Lens& lens) {
  if (!std::all_of(row.begin(), row.end(), [](double x) { return std::isfinite(x); }) ||
      !whole_between(row[0], 0, static_cast<double>(lens_model_count) - 1)) {
    return false;
  }
  lens.model = static_cast<LensModel>(static_cast<int>(row[0]));
  std::copy_n(row.begin() + 1, 16, lens.parameters.begin());
  return true;
}

}  // namespace detail

}  // namespace compmark
