// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A capture that the tool trains in a tenth of a second: twelve photographs of 24 x 24 pixels, no two alike, around 125 points.
#pragma once

#include <doctest/doctest.h>

#include <compmark/io/image_file.hpp>
#include <compmark/scene/colmap_model.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "scene/cube_dialects.hpp"

namespace compmark::testing {

constexpr int ring_side = 24;
constexpr std::size_t photographs = 12;
/// Of the i-th photograph.
using Names = std::function<std::string(std::size_t)>;

/// No two are alike, and none is flat.
inline void put_photograph(const std::filesystem::path& path, std::size_t i) {
  ImageBytes image{ring_side, ring_side, 3, {}};
  for (int y = 0; y < ring_side; ++y) {
    for (int x = 0; x < ring_side; ++x) {
      const int n = static_cast<int>(i);
      for (const int v : {9 * x + 20 * n, 9 * y + 7 * n, 20 * n}) image.pixels.push_back(static_cast<std::uint8_t>(v));
    }
  }
  std::filesystem::create_directories(path.parent_path());
  REQUIRE(write_png(path, image).ok());
}

/// Twelve cameras around 125 points of a cube.
inline CubeCapture ring() {
  CubeCapture capture = cube_capture();
  for (Camera<double>& camera : capture.cameras) {
    camera.width = camera.height = ring_side;
    camera.cx = camera.cy = 12;
    camera.fx = camera.fy = 30;
  }
  capture.points.clear();
  for (int i = 0; i < 125; ++i)
    capture.points.push_back({0.5 * (i % 5) - 1, 0.5 * (i / 5 % 5) - 1, 0.5 * (i / 25) - 1});
  return capture;
}
inline std::string two_digits(std::size_t i) { return (i < 10 ? "0" : "") + std::to_string(i); }
inline std::string plain(std::size_t i) { return "v" + two_digits(i) + ".png"; }

inline ColmapModel ring_model(const Names& name) {
  ColmapModel result = cube_colmap(ring());
  result.cameras[1] = {0, ring_side, ring_side, {30, 12, 12}};
  std::size_t i = 0;
  for (auto& [id, image] : result.images) image.name = name(i++);
  return result;
}

}  // namespace compmark::testing
