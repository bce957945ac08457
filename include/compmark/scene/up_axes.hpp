// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which way is up for cameras that stand round something: the direction that they have in common, and the same cameras
// turned so that another one is up. Of splats that come without cameras nobody says which way is up, but nearly always
// it is one of six axes: who looks for the camera of a picture looks about each of them. Cost: O(cameras).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "compmark/scene/camera.hpp"
#include "compmark/scene/views_around.hpp"

namespace compmark {

/// The axes that may be up, the usual one (-y) first, then that of Blender (z).
inline constexpr std::array<std::array<double, 3>, 6> up_axes{
    {{0, -1, 0}, {0, 0, 1}, {0, 1, 0}, {0, 0, -1}, {1, 0, 0}, {-1, 0, 0}}};

/// What is up in the pictures of these cameras, in the mean: of length 1. Nothing where they have no such direction, as
/// without cameras.
[[nodiscard]] inline std::optional<std::array<double, 3>> up_of_cameras(std::span<const Camera<double>> cameras) {
  std::array<double, 3> up{};
  for (const Camera<double>& camera : cameras) {
    for (std::size_t axis = 0; axis < 3; ++axis) up[axis] -= camera.rotation_camera_world[3 + axis];
  }
  return detail::unit(up);
}

/// The point that is nearest to the optical axes of the cameras, by least squares; nothing where these are parallel.
[[nodiscard]] inline std::optional<std::array<double, 3>> point_looked_at(std::span<const Camera<double>> cameras) {
  std::array<double, 9> m{};
  std::array<double, 3> b{};
  for (const Camera<double>& camera : cameras) {
    const std::array<double, 9>& r = camera.rotation_camera_world;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const double across = (i == j ? 1.0 : 0.0) - r[6 + i] * r[6 + j];
        m[3 * i + j] += across;
        b[i] += across * camera.center_world[j];
      }
    }
  }
  // The inverse of a symmetric matrix by its cofactors.
  const auto row = [&](std::size_t i) { return std::array<double, 3>{m[3 * i], m[3 * i + 1], m[3 * i + 2]}; };
  const std::array<std::array<double, 3>, 3> cofactor{detail::cross(row(1), row(2)), detail::cross(row(2), row(0)),
                                                      detail::cross(row(0), row(1))};
  const double determinant = m[0] * cofactor[0][0] + m[1] * cofactor[0][1] + m[2] * cofactor[0][2];
  const auto count = static_cast<double>(cameras.size());
  if (!(determinant > 1e-9 * count * count * count)) return std::nullopt;
  std::array<double, 3> point{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) point[i] += cofactor[j][i] * b[j] / determinant;
  }
  return point;
}

/// The rotation by the least angle that takes `from` to `to`, both of length 1, row-major: half a turn about a level
/// direction where they are opposite.
[[nodiscard]] inline std::array<double, 9> least_rotation(const std::array<double, 3>& from,
                                                          const std::array<double, 3>& to) {
  std::array<double, 9> turn{};
  const double cosine = from[0] * to[0] + from[1] * to[1] + from[2] * to[2];
  if (cosine < -1 + 1e-9) {
    const std::array<double, 3> axis = detail::level_direction(from);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) turn[3 * i + j] = 2 * axis[i] * axis[j] - (i == j ? 1 : 0);
    }
    return turn;
  }
  const std::array<double, 3> v = detail::cross(from, to);  // I + [v] + [v]^2 / (1 + cosine)
  const std::array<double, 9> skew{0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double square = 0;
      for (std::size_t k = 0; k < 3; ++k) square += skew[3 * i + k] * skew[3 * k + j];
      turn[3 * i + j] = (i == j ? 1 : 0) + skew[3 * i + j] + square / (1 + cosine);
    }
  }
  return turn;
}

/// The cameras, turned together about the point that they look at, so that `up` (of length 1) is up in their pictures.
/// As they are where it is so already, or where they have no such point or no up.
[[nodiscard]] inline std::vector<Camera<double>> cameras_turned_up(std::span<const Camera<double>> cameras,
                                                                   const std::array<double, 3>& up) {
  std::vector<Camera<double>> turned(cameras.begin(), cameras.end());
  const std::optional<std::array<double, 3>> now = up_of_cameras(cameras), point = point_looked_at(cameras);
  if (!now || !point || std::hypot(up[0] - (*now)[0], up[1] - (*now)[1], up[2] - (*now)[2]) < 1e-6) return turned;
  const std::array<double, 9> turn = least_rotation(*now, up);
  for (Camera<double>& camera : turned) {
    const std::array<double, 9> r = camera.rotation_camera_world;
    const std::array<double, 3> place = camera.center_world;
    for (std::size_t i = 0; i < 3; ++i) {
      camera.center_world[i] = (*point)[i];
      for (std::size_t j = 0; j < 3; ++j) {
        camera.center_world[i] += turn[3 * i + j] * (place[j] - (*point)[j]);
        double sum = 0;  // R T^t
        for (std::size_t k = 0; k < 3; ++k) sum += r[3 * i + k] * turn[3 * j + k];
        camera.rotation_camera_world[3 * i + j] = sum;
      }
    }
  }
  return turned;
}

}  // namespace compmark
