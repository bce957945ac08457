// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A point cloud from a PLY file: x y z and, where there, red green blue (8-bit, or floats in [0, 1]).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/ply.hpp"
#include "compmark/scene/dataset.hpp"

namespace compmark {

/// Points before they are rounded to float, so that a scene far from the origin can be moved to it first
/// (docs/spec/numerics.md, PR7).
struct PrecisePoints {
  std::vector<std::array<double, 3>> position;
  std::vector<std::array<std::uint8_t, 3>> color;
  std::size_t left_out = 0;  ///< that are not finite
};

/// Points that are not finite are left out and counted.
[[nodiscard]] inline Result<PrecisePoints> read_precise_points(const std::filesystem::path& path) {
  const Result<PlyFile> file = read_ply(path);
  if (!file) return file.error();
  const PlyElement* vertex = file->find("vertex");
  for (const char* name : {"x", "y", "z"}) {
    if (vertex == nullptr || vertex->find(name) == nullptr) {
      return Error{ErrorKind::malformed, path.string(), std::string("vertex.") + name, "is missing",
                   "give a PLY file with vertices x y z"};
    }
  }
  const std::array<std::vector<double>, 3> position{vertex->column<double>("x"), vertex->column<double>("y"),
                                                    vertex->column<double>("z")};
  std::array<std::vector<double>, 3> color;
  constexpr std::array<const char*, 3> color_names{"red", "green", "blue"};
  bool fractions = true;  // colours in [0, 1]: none is declared a whole number, and none is above 1
  double largest = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const PlyProperty* property = vertex->find(color_names[c]);
    if (property == nullptr) continue;
    color[c] = vertex->column<double>(color_names[c]);
    for (const double v : color[c]) largest = std::fmax(largest, v);
    fractions = fractions && property->declared >= PlyType::float32;
  }
  const double scale = fractions && largest <= 1 ? 255 : 1;
  PrecisePoints points;
  for (std::size_t i = 0; i < vertex->count; ++i) {
    const std::array<double, 3> p{position[0][i], position[1][i], position[2][i]};
    if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) {
      ++points.left_out;
      continue;
    }
    std::array<std::uint8_t, 3> rgb{127, 127, 127};
    for (std::size_t c = 0; c < 3; ++c) {
      if (!color[c].empty())
        rgb[c] = static_cast<std::uint8_t>(std::fmin(std::fmax(color[c][i] * scale + 0.5, 0.0), 255.0));
    }
    points.position.push_back(p);
    points.color.push_back(rgb);
  }
  if (points.position.empty())
    return Error{ErrorKind::invalid, path.string(), "vertex", "holds no finite point", "give a file with points"};
  return points;
}

/// The same in float, as a Dataset holds them.
[[nodiscard]] inline Result<PointCloud> read_point_file(const std::filesystem::path& path) {
  Result<PrecisePoints> precise = read_precise_points(path);
  if (!precise) return precise.error();
  PointCloud points;
  points.color = std::move(precise->color);
  points.position.reserve(precise->position.size());
  for (const std::array<double, 3>& p : precise->position)
    points.position.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
  return points;
}

}  // namespace compmark
