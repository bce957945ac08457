// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Small steps of a camera: the nine numbers by which an optimiser moves one.
//   0..2  rotation vector in the camera frame, radians: the camera's axes turn, its centre stays
//   3..5  translation of the scene in the camera frame, world units
//   6     logarithm of both focal lengths
//   7, 8  principal point, pixels
// A point goes from X in the camera frame to exp([w]) X + t.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "compmark/scene/camera.hpp"

namespace compmark {

inline constexpr std::size_t camera_parameters = 9;
using CameraStep = std::array<double, camera_parameters>;

namespace detail {

/// exp([w]), row-major: Rodrigues' formula, with the series of sine and versine by the angle where it is small.
[[nodiscard]] inline std::array<double, 9> rotation_of(double x, double y, double z) {
  const double square = x * x + y * y + z * z, angle = std::sqrt(square);
  const double a = angle < 1e-4 ? 1 - square / 6 : std::sin(angle) / angle;
  const double half = std::sin(angle / 2);
  const double b = angle < 1e-4 ? 0.5 - square / 24 : 2 * half * half / square;
  return {1 - b * (y * y + z * z), b * x * y - a * z,       b * x * z + a * y,
          b * x * y + a * z,       1 - b * (x * x + z * z), b * y * z - a * x,
          b * x * z - a * y,       b * y * z + a * x,       1 - b * (x * x + y * y)};
}

/// The nearest right-angled axes to rows that have drifted by rounding: Gram and Schmidt.
inline void orthonormalise(std::array<double, 9>& r) {
  const double first = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
  for (std::size_t k = 0; k < 3; ++k) r[k] /= first;
  const double along = r[0] * r[3] + r[1] * r[4] + r[2] * r[5];
  for (std::size_t k = 0; k < 3; ++k) r[3 + k] -= along * r[k];
  const double second = std::sqrt(r[3] * r[3] + r[4] * r[4] + r[5] * r[5]);
  for (std::size_t k = 0; k < 3; ++k) r[3 + k] /= second;
  r[6] = r[1] * r[5] - r[2] * r[4];
  r[7] = r[2] * r[3] - r[0] * r[5];
  r[8] = r[0] * r[4] - r[1] * r[3];
}

}  // namespace detail

/// The camera after a step. Exact for steps of any size; a step of zero changes nothing but rounding.
[[nodiscard]] inline Camera<double> moved(const Camera<double>& camera, const CameraStep& step) {
  Camera<double> result = camera;
  const std::array<double, 9> turn = detail::rotation_of(step[0], step[1], step[2]);
  const std::array<double, 9>& from = camera.rotation_camera_world;
  std::array<double, 9>& to = result.rotation_camera_world;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c)
      to[3 * r + c] = turn[3 * r] * from[c] + turn[3 * r + 1] * from[3 + c] + turn[3 * r + 2] * from[6 + c];
  }
  detail::orthonormalise(to);
  for (std::size_t c = 0; c < 3; ++c)
    result.center_world[c] -= to[c] * step[3] + to[3 + c] * step[4] + to[6 + c] * step[5];
  const double zoom = std::exp(step[6]);
  result.fx *= zoom;
  result.fy *= zoom;
  result.cx += step[7];
  result.cy += step[8];
  return result;
}

}  // namespace compmark
