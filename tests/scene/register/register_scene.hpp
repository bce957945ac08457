// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Pictures of a random cloud of Gaussians, for tests that look for their cameras.
#pragma once

#include <array>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/core/views.hpp>
#include <compmark/scene/camera.hpp>
#include <compmark/scene/register/camera_step.hpp>
#include <compmark/splat/raster/camera_tangent.hpp>
#include <compmark/testing/raster_scene.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace compmark::testing {

struct SomePicture {
  std::vector<float> values;
  ImageView<float> view;
  SomePicture(int width, int height)
      : values(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
        view{values.data(), 3, height, width} {}
  SomePicture(const SomePicture& other)
      : values(other.values),
        view{values.data(), 3, other.view.height, other.view.width} {}
  SomePicture& operator=(const SomePicture&) = delete;
};

/// Draws a cloud; callable as fit_camera wants it.
struct CloudRender {
  RasterScene<float> scene;
  mutable CameraTangent<float>::Context context{};

  CloudRender(std::uint64_t seed, std::size_t count, int width, int height)
      : scene(raster_scene<float>(seed, count, width, height)) {}

  [[nodiscard]] Camera<double> camera() const { return scene.camera.cast<double>(); }
  bool operator()(const Camera<double>& at, ImageView<float> image, ImageView<float> tangents) const {
    SerialExecutor serial;
    return CameraTangent<float>()
        .render(scene.gaussians.columns(), at.cast<float>(), scene.background, image, tangents, context, serial)
        .ok();
  }
  [[nodiscard]] SomePicture picture(const Camera<double>& at) const {
    SomePicture result(at.width, at.height);
    std::vector<float> tangents(9 * result.values.size());
    (*this)(at, result.view, ImageView<float>{tangents.data(), 27, at.height, at.width});
    return result;
  }
  /// Largest distance between where two cameras put points before the first one, pixels.
  [[nodiscard]] static double apart(const Camera<double>& a, const Camera<double>& b) {
    double most = 0;
    for (int k = 0; k < 27; ++k) {
      const double z = 3 + 2 * (k / 9), x = (0.2 + 0.3 * (k % 3)) * a.width, y = (0.2 + 0.3 * (k / 3 % 3)) * a.height;
      const std::array<double, 3> p{(x - a.cx) / a.fx * z, (y - a.cy) / a.fy * z, z};
      std::array<double, 3> q{};
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) {
          double world = a.center_world[c] - b.center_world[c];
          for (std::size_t i = 0; i < 3; ++i) world += a.rotation_camera_world[3 * i + c] * p[i];
          q[r] += b.rotation_camera_world[3 * r + c] * world;
        }
      }
      most = std::fmax(most, std::hypot(b.fx * q[0] / q[2] + b.cx - x, b.fy * q[1] / q[2] + b.cy - y));
    }
    return most;
  }
};

}  // namespace compmark::testing
