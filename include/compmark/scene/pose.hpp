// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// From the poses of files to the rotation and centre of a Camera. Files carry rotations with the rounding of whoever
// wrote them, so each is replaced by the nearest rotation (docs/spec/numerics.md, CA2): the polar factor, by Newton's
// iteration X <- (X + X^-T) / 2 (Higham 1986).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include "compmark/core/config.hpp"

namespace compmark {

/// Row-major 3 x 3.
using Matrix3 = std::array<double, 9>;

/// World-to-camera rotation (x right, y down, z forward) and centre.
struct Pose {
  Matrix3 rotation_camera_world{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> center_world{0, 0, 0};
  double defect = 0;  ///< largest entry of the correction to the file's rotation, after dividing out a uniform scale
  double scale = 1;   ///< the uniform scale that was divided out
};

namespace detail {

[[nodiscard]] inline Matrix3 cofactors(const Matrix3& m) {
  return {m[4] * m[8] - m[5] * m[7], m[5] * m[6] - m[3] * m[8], m[3] * m[7] - m[4] * m[6],
          m[2] * m[7] - m[1] * m[8], m[0] * m[8] - m[2] * m[6], m[1] * m[6] - m[0] * m[7],
          m[1] * m[5] - m[2] * m[4], m[2] * m[3] - m[0] * m[5], m[0] * m[4] - m[1] * m[3]};
}
[[nodiscard]] inline double determinant(const Matrix3& m) {
  const Matrix3 c = cofactors(m);
  return m[0] * c[0] + m[1] * c[1] + m[2] * c[2];
}

}  // namespace detail

/// The rotation nearest to m / scale with scale = cbrt(det m); empty if m is singular, mirrored or not finite.
struct NearestRotation {
  Matrix3 rotation;
  double scale;
  double defect;
};
[[nodiscard]] inline std::optional<NearestRotation> nearest_rotation(const Matrix3& m) {
  double size = 0;
  for (const double v : m)
    size = std::isfinite(v) ? std::fmax(size, std::abs(v)) : std::numeric_limits<double>::infinity();
  const double det = detail::determinant(m);
  if (!std::isfinite(size) || !(det > 1e-9 * size * size * size)) return std::nullopt;
  const double scale = std::cbrt(det);
  Matrix3 start = m;
  for (double& v : start) v /= scale;
  Matrix3 x = start;
  for (int i = 0; i < 40; ++i) {  // quadratic convergence; 40 covers any condition number that passed the test above
    const Matrix3 c = detail::cofactors(x);
    const double d = detail::determinant(x);
    double change = 0;
    for (std::size_t k = 0; k < 9; ++k) {
      const double next = 0.5 * (x[k] + c[k] / d);
      change = std::fmax(change, std::abs(next - x[k]));
      x[k] = next;
    }
    if (change < 1e-16) break;
  }
  double defect = 0;
  for (std::size_t k = 0; k < 9; ++k) defect = std::fmax(defect, std::abs(x[k] - start[k]));
  return NearestRotation{x, scale, defect};
}

/// OpenGL camera-to-world matrix (row-major 4 x 4; x right, y up, looking along -z), as transforms.json stores it:
/// columns y and z change sign, the transpose of the rotation maps world to camera, the last column is the centre.
[[nodiscard]] inline std::optional<Pose> pose_from_opengl(const std::array<double, 16>& camera_to_world) {
  const std::array<double, 16>& m = camera_to_world;
  const std::optional<NearestRotation> nearest =
      nearest_rotation({m[0], -m[1], -m[2], m[4], -m[5], -m[6], m[8], -m[9], -m[10]});
  if (!nearest) return std::nullopt;
  Pose pose;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) pose.rotation_camera_world[3 * i + j] = nearest->rotation[3 * j + i];
    pose.center_world[i] = m[4 * i + 3];
    if (!std::isfinite(pose.center_world[i])) return std::nullopt;
  }
  pose.defect = nearest->defect;
  pose.scale = nearest->scale;
  return pose;
}

/// COLMAP: world-to-camera quaternion (w, x, y, z; Hamilton) and translation t; the centre is -R^T t.
[[nodiscard]] inline std::optional<Pose> pose_from_quaternion(const std::array<double, 4>& wxyz,
                                                              const std::array<double, 3>& t) {
  const double norm = std::sqrt(wxyz[0] * wxyz[0] + wxyz[1] * wxyz[1] + wxyz[2] * wxyz[2] + wxyz[3] * wxyz[3]);
  if (!(norm > 1e-9) || !std::isfinite(norm) || !std::isfinite(t[0] + t[1] + t[2])) return std::nullopt;
  const double w = wxyz[0] / norm;
  const double x = wxyz[1] / norm;
  const double y = wxyz[2] / norm;
  const double z = wxyz[3] / norm;
  Pose pose;
  pose.rotation_camera_world = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                                2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                                2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) pose.center_world[i] -= pose.rotation_camera_world[3 * j + i] * t[j];
  }
  pose.defect = std::abs(norm - 1);
  return pose;
}

}  // namespace compmark
