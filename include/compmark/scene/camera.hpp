// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The pinhole camera. One convention inside the library, all conversions at the readers:
//   camera frame  x right, y down, z forward (OpenCV, COLMAP);   point_camera = rotation * (point_world - center)
//   image frame   pixel (i, j) covers [i, i+1) x [j, j+1), its centre is (i + 1/2, j + 1/2);
//                 u = fx x/z + cx,  v = fy y/z + cy
// The published rasterizer puts pixel centres at integers and the principal point at the image centre minus one half:
// the same rays.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace compmark {

/// Where in a pixel its ray goes through (docs/spec/numerics.md, PR6). The only place that says so.
template <class T>
inline constexpr T pixel_center = T(0.5);

/// Pinhole with full intrinsics. The centre is kept in double and subtracted before rotating, so that a scene far from
/// the origin keeps its digits (docs/spec/numerics.md, PR7).
template <class T>
struct Camera {
  int width = 0;                                                      ///< pixels
  int height = 0;                                                     ///< pixels
  T fx = 1, fy = 1;                                                   ///< focal lengths, pixels
  T cx = 0, cy = 0;                                                   ///< principal point, pixels, image frame above
  std::array<T, 9> rotation_camera_world{1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< world to camera, row-major
  std::array<double, 3> center_world{0, 0, 0};                        ///< camera centre, world units

  /// The same camera over an image resized to new_width x new_height: intrinsics scale by the true ratios
  /// (docs/spec/numerics.md, CA1).
  [[nodiscard]] Camera resized(int new_width, int new_height) const {
    Camera camera = *this;
    const T sx = static_cast<T>(static_cast<double>(new_width) / width);
    const T sy = static_cast<T>(static_cast<double>(new_height) / height);
    camera.width = new_width;
    camera.height = new_height;
    camera.fx *= sx;
    camera.cx *= sx;
    camera.fy *= sy;
    camera.cy *= sy;
    return camera;
  }
  /// The camera of the sub-image whose top-left pixel is (left, top).
  [[nodiscard]] Camera cropped(int left, int top, int new_width, int new_height) const {
    Camera camera = *this;
    camera.cx -= static_cast<T>(left);
    camera.cy -= static_cast<T>(top);
    camera.width = new_width;
    camera.height = new_height;
    return camera;
  }
  template <class U>
  [[nodiscard]] Camera<U> cast() const {
    Camera<U> camera;
    camera.width = width;
    camera.height = height;
    camera.fx = static_cast<U>(fx);
    camera.fy = static_cast<U>(fy);
    camera.cx = static_cast<U>(cx);
    camera.cy = static_cast<U>(cy);
    for (std::size_t i = 0; i < 9; ++i) camera.rotation_camera_world[i] = static_cast<U>(rotation_camera_world[i]);
    camera.center_world = center_world;
    return camera;
  }
};

}  // namespace compmark
