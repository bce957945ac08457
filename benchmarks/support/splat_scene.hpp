// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The rasterizer's workload: random splats on the screen with a given median size of the long axis, log-normal(0.6),
// anisotropy 1 to 4, opacity sigmoid(1.5 n), random depths; built as Gaussians that face the camera, so that the whole
// way from Gaussians to pixels is measured.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>

#include "compmark/core/gaussians.hpp"
#include "compmark/core/random.hpp"
#include "compmark/scene/camera.hpp"

namespace compmark::benchmarks {

template <class T>
struct SplatScene {
  Camera<T> camera;
  GaussianBatch<T> gaussians;
};

template <class T>
[[nodiscard]] SplatScene<T> splat_scene(std::size_t count, int size, double median_sigma, std::uint64_t seed = 1234) {
  SplatScene<T> scene;
  scene.camera.width = scene.camera.height = size;
  scene.camera.fx = scene.camera.fy = static_cast<T>(size);
  scene.camera.cx = scene.camera.cy = static_cast<T>(size / 2.0);
  scene.gaussians.resize(count);
  scene.gaussians.set_zero();
  const GaussianColumns<T> columns = scene.gaussians.columns();
  const Random random(seed, 0, random_stage("splat_scene"));
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t base = 16 * i;
    const double z = 2 + 6 * random.uniform(base);
    const double u = size * random.uniform(base + 1), v = size * random.uniform(base + 2);
    const double sigma = median_sigma * std::exp(0.6 * random.normal(base + 3));
    const double anisotropy = 1 + 3 * random.uniform(base + 4);
    const double angle = std::numbers::pi * random.uniform(base + 5);
    const double pixel = z / size;
    const auto set = [&](T* column, double value) { column[i] = static_cast<T>(value); };
    set(columns.mean[0], (u - size / 2.0) * pixel);
    set(columns.mean[1], (v - size / 2.0) * pixel);
    set(columns.mean[2], z);
    set(columns.scale[0], sigma * pixel);
    set(columns.scale[1], sigma / anisotropy * pixel);
    set(columns.scale[2], 0.01 * sigma * pixel);
    set(columns.rotation[0], std::cos(angle / 2));
    set(columns.rotation[3], std::sin(angle / 2));
    set(columns.opacity, 1 / (1 + std::exp(-1.5 * random.normal(base + 6))));
    for (std::size_t c = 0; c < 3; ++c) set(columns.color[c], random.uniform(base + 7 + c));
  }
  return scene;
}

}  // namespace compmark::benchmarks
