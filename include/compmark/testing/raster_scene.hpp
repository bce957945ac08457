// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A random cloud of Gaussians before a camera, for tests of rasterizers: a pure function of its seed.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "compmark/core/gaussians.hpp"
#include "compmark/core/random.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark {
namespace testing {

template <class T>
struct RasterScene {
  GaussianBatch<T> gaussians;
  Camera<T> camera;
  std::array<T, 3> background{};
};

/// `count` Gaussians in the view cone, depths 2 to 8 and all different, standard deviations 0.01 to 0.2, opacities 0.05
/// to 0.95.
template <class T>
[[nodiscard]] RasterScene<T> raster_scene(std::uint64_t seed, std::size_t count, int width, int height) {
  const Random random(seed, 0, random_stage("testing/raster_scene"));
  const auto uniform = [&](std::size_t row, std::size_t column, double low, double high) {
    return static_cast<T>(low + (high - low) * random.uniform(row * 16 + column));
  };
  RasterScene<T> scene;
  scene.camera.width = width;
  scene.camera.height = height;
  scene.camera.fx = static_cast<T>(0.9 * width);
  scene.camera.fy = static_cast<T>(0.95 * width);
  scene.camera.cx = static_cast<T>(0.48 * width);
  scene.camera.cy = static_cast<T>(0.53 * height);
  scene.background = {T(0.2), T(0.5), T(0.9)};
  scene.gaussians.resize(count);
  scene.gaussians.set_zero();
  const GaussianColumns<T> columns = scene.gaussians.columns();
  for (std::size_t i = 0; i < count; ++i) {
    const T z = static_cast<T>(2 + 6 * (static_cast<double>(i * 7919 % count) + random.uniform(i * 16)) /
                                       static_cast<double>(count));
    columns.mean[0][i] = z * uniform(i, 1, -0.6, 0.6);
    columns.mean[1][i] = z * uniform(i, 2, -0.6, 0.6) * static_cast<T>(height) / static_cast<T>(width);
    columns.mean[2][i] = z;
    for (std::size_t axis = 0; axis < 3; ++axis)
      columns.scale[axis][i] = static_cast<T>(std::exp(uniform(i, 3 + axis, -4.6, -1.6)));
    std::array<T, 4> q{};
    T norm = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      q[c] = uniform(i, 6 + c, -1, 1);
      norm += q[c] * q[c];
    }
    for (std::size_t c = 0; c < 4; ++c) columns.rotation[c][i] = q[c] / std::sqrt(norm);
    columns.opacity[i] = uniform(i, 10, 0.05, 0.95);
    for (std::size_t c = 0; c < 3; ++c) columns.color[c][i] = uniform(i, 11 + c, 0, 1);
  }
  return scene;
}

/// All columns by index: mean, scale, rotation, opacity, color.
template <class T>
[[nodiscard]] std::array<T*, 14> all_columns(const GaussianColumns<T>& g) {
  return {g.mean[0],     g.mean[1],     g.mean[2],     g.scale[0], g.scale[1], g.scale[2], g.rotation[0],
          g.rotation[1], g.rotation[2], g.rotation[3], g.opacity,  g.color[0], g.color[1], g.color[2]};
}

/// The scene with its Gaussians in another order: row i of the result is row order[i].
template <class T, class Order>
[[nodiscard]] RasterScene<T> reordered(const RasterScene<T>& scene, const Order& order) {
  RasterScene<T> result;
  result.camera = scene.camera;
  result.background = scene.background;
  result.gaussians.resize(order.size());
  result.gaussians.set_zero();
  const auto from = all_columns(scene.gaussians.columns());
  const auto to = all_columns(result.gaussians.columns());
  for (std::size_t c = 0; c < to.size(); ++c) {
    for (std::size_t i = 0; i < order.size(); ++i) to[c][i] = from[c][order[i]];
  }
  return result;
}

/// The same scene in another scalar.
template <class U, class T>
[[nodiscard]] RasterScene<U> cast_scene(const RasterScene<T>& scene) {
  RasterScene<U> result;
  result.camera = scene.camera.template cast<U>();
  for (std::size_t c = 0; c < 3; ++c) result.background[c] = static_cast<U>(scene.background[c]);
  result.gaussians.resize(scene.gaussians.size());
  result.gaussians.set_zero();
  const auto from = all_columns(scene.gaussians.columns());
  const auto to = all_columns(result.gaussians.columns());
  for (std::size_t c = 0; c < to.size(); ++c) {
    for (std::size_t i = 0; i < scene.gaussians.size(); ++i) to[c][i] = static_cast<U>(from[c][i]);
  }
  return result;
}

}  // namespace testing
}  // namespace compmark
