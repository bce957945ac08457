// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A COLMAP sparse model in memory, as its files have it, and the table of COLMAP's camera models (docs/spec/formats.md,
// 3).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {

struct ColmapCamera {
  int model = 0;  ///< index into colmap_models
  std::uint64_t width = 0;
  std::uint64_t height = 0;
  std::array<double, 16> parameters{};  ///< the first colmap_models[model].parameters are meant
};

/// A feature of an image and the point it belongs to.
struct ColmapObservation {
  double x = 0;  ///< pixels; the first pixel's centre is (0.5, 0.5)
  double y = 0;
  std::uint64_t point_id = ~std::uint64_t{0};  ///< all ones: none
};

struct ColmapImage {
  std::array<double, 4> rotation_wxyz{1, 0, 0, 0};  ///< world to camera
  std::array<double, 3> translation{0, 0, 0};
  std::uint32_t camera_id = 0;
  std::string name;                             ///< may contain folders and spaces
  std::vector<ColmapObservation> observations;  ///< only if asked for
};

struct ColmapPoint {
  std::array<double, 3> position{0, 0, 0};
  std::array<std::uint8_t, 3> color{0, 0, 0};
};

/// Ids are not contiguous, hence maps; ordered, so that everything made from them has one order.
struct ColmapModel {
  std::map<std::uint32_t, ColmapCamera> cameras;
  std::map<std::uint32_t, ColmapImage> images;
  std::map<std::uint64_t, ColmapPoint> points;
};

struct ColmapCameraModel {
  std::string_view name;
  std::size_t parameters;
};

/// By COLMAP's model id.
inline constexpr std::array<ColmapCameraModel, 18> colmap_models{{{"SIMPLE_PINHOLE", 3},
                                                                  {"PINHOLE", 4},
                                                                  {"SIMPLE_RADIAL", 4},
                                                                  {"RADIAL", 5},
                                                                  {"OPENCV", 8},
                                                                  {"OPENCV_FISHEYE", 8},
                                                                  {"FULL_OPENCV", 12},
                                                                  {"FOV", 5},
                                                                  {"SIMPLE_RADIAL_FISHEYE", 4},
                                                                  {"RADIAL_FISHEYE", 5},
                                                                  {"THIN_PRISM_FISHEYE", 12},
                                                                  {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                                                  {"SIMPLE_DIVISION", 4},
                                                                  {"DIVISION", 5},
                                                                  {"SIMPLE_FISHEYE", 3},
                                                                  {"FISHEYE", 4},
                                                                  {"EUCM", 6},
                                                                  {"EQUIRECTANGULAR", 2}}};

[[nodiscard]] inline std::optional<int> colmap_model_id(std::string_view name) {
  for (std::size_t i = 0; i < colmap_models.size(); ++i) {
    if (colmap_models[i].name == name) return static_cast<int>(i);
  }
  return std::nullopt;
}

/// What to read beyond poses and points.
struct ColmapReadSettings {
  bool observations = false;  ///< keep the 2-D features of each image
};

}  // namespace compmark
