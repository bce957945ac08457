// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A small synthetic scene for tests of the whole pipeline: a ring of cameras around a cloud of points, and a smooth target image.
#pragma once

#include <array>
#include <cmath>
#include <compmark/core/random.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/views.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/camera.hpp>
#include <numbers>
#include <vector>

namespace compmark::testing {

inline constexpr DecoderShape small_shape{.feature_dim = 8, .offsets = 3};
struct SmallRecipe : DefaultRecipe<float, small_shape> {};

/// What photographs of the built-in scene need, and as many anchors after a training as before.
inline constexpr DecoderShape scene_shape{.feature_dim = 16, .offsets = 5};
struct UngrownRecipe : DefaultRecipe<float, scene_shape> {
  using DensityControl = NoGrowth;
};

/// Camera i of n on a circle of radius 3, looking at the origin.
inline Camera<double> ring_camera(std::size_t i, std::size_t n, int width, int height) {
  const double angle = 2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  Camera<double> camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 1.1 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.center_world = {3 * s, 0.0, -3 * c};
  camera.rotation_camera_world = {c, 0, s, 0, 1, 0, -s, 0, c};  // z axis towards the origin
  return camera;
}

inline std::vector<std::array<float, 3>> cloud(std::size_t count, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("test cloud"));
  std::vector<std::array<float, 3>> points(count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t a = 0; a < 3; ++a) points[i][a] = static_cast<float>(1.6 * random.uniform(3 * i + a) - 0.8);
  }
  return points;
}

/// Views with a smooth, view-dependent, coloured blob on black: easy to fit, never flat.
struct BlobViews {
  std::size_t count = 6;
  int width = 48, height = 40;

  [[nodiscard]] std::size_t size() const { return count; }
  [[nodiscard]] Camera<double> camera(std::size_t i) const { return ring_camera(i, count, width, height); }
  template <class T>
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<T> image) const {
    for (int c = 0; c < 3; ++c) {
      for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
          const double u = (x + 0.5) / width - 0.5;
          const double v = (y + 0.5) / height - 0.5;
          const double blob = std::exp(-12 * (u * u + v * v));
          image(c, y, x) = static_cast<T>(
              blob * (0.5 + 0.4 * std::sin(9 * u + 2 * c + static_cast<double>(i)) * std::cos(7 * v + c)));
        }
      }
    }
    return Done{};
  }
};

}  // namespace compmark::testing
