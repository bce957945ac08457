// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One capture in every dialect that is read: twelve cameras on a tilted circle around a cube, whose eight corners are
// the points. Poses are exact; each writer converts them to its own axes.
#pragma once

#include <array>
#include <cmath>
#include <compmark/scene/camera.hpp>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "support/scene_files.hpp"

namespace compmark::testing {

struct CubeCapture {
  std::vector<Camera<double>> cameras;
  std::vector<std::array<double, 3>> points;
};

/// Cameras at distance 4 * scale around `center`, looking at it, 16 x 12 pixels, focal length 20.
inline CubeCapture cube_capture(double scale = 1, std::array<double, 3> center = {0, 0, 0}, int count = 12) {
  CubeCapture capture;
  for (int i = 0; i < count; ++i) {
    const double phi = 0.3 + 2 * 3.14159265358979323846 * i / 12, height = 1.5 + 0.2 * std::sin(3 * phi);
    const std::array<double, 3> from{4 * std::cos(phi), 4 * std::sin(phi), height};
    const double norm = std::hypot(from[0], from[1], from[2]);
    const std::array<double, 3> forward{-from[0] / norm, -from[1] / norm, -from[2] / norm};
    const double flat = std::hypot(forward[0], forward[1]);
    const std::array<double, 3> right{forward[1] / flat, -forward[0] / flat, 0};
    const std::array<double, 3> down{forward[1] * right[2] - forward[2] * right[1],
                                     forward[2] * right[0] - forward[0] * right[2],
                                     forward[0] * right[1] - forward[1] * right[0]};
    Camera<double> camera;
    camera.width = 16;
    camera.height = 12;
    camera.fx = camera.fy = 20;
    camera.cx = 8;
    camera.cy = 6;
    for (std::size_t c = 0; c < 3; ++c) {
      camera.rotation_camera_world[c] = right[c];
      camera.rotation_camera_world[3 + c] = down[c];
      camera.rotation_camera_world[6 + c] = forward[c];
      camera.center_world[c] = center[c] + scale * from[c];
    }
    capture.cameras.push_back(camera);
  }
  for (int i = 0; i < 8; ++i)
    capture.points.push_back({center[0] + scale * (i & 1 ? 0.5 : -0.5), center[1] + scale * (i & 2 ? 0.5 : -0.5),
                              center[2] + scale * (i & 4 ? 0.5 : -0.5)});
  return capture;
}

inline std::string number_text(double v) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", v);
  return text;
}

inline std::string cube_image(std::size_t i) { return (i < 10 ? "0" : "") + std::to_string(i) + ".png"; }

inline void put_cube_images(const std::filesystem::path& folder, const CubeCapture& capture) {
  for (std::size_t i = 0; i < capture.cameras.size(); ++i) put_image(folder / cube_image(i), 16, 12);
}

/// OpenGL camera to world, as transform_matrix text.
inline std::string opengl_text(const Camera<double>& camera) {
  std::string text = "[";
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& r = camera.rotation_camera_world;
    text += "[" + number_text(r[i]) + "," + number_text(-r[3 + i]) + "," + number_text(-r[6 + i]) + "," +
            number_text(camera.center_world[i]) + "],";
  }
  return text + "[0,0,0,1]]";
}

/// A transforms file: `head` is what stands before the frames, `path` gives the file_path of frame i.
inline std::string cube_transforms(const CubeCapture& capture, const std::string& head,
                                   const std::function<std::string(std::size_t)>& path) {
  std::string frames;
  for (std::size_t i = 0; i < capture.cameras.size(); ++i)
    frames += (i > 0 ? "," : "") + frame_text(path(i), opengl_text(capture.cameras[i]));
  return "{" + head + ", \"frames\": [" + frames + "]}";
}

inline ColmapModel cube_colmap(const CubeCapture& capture) {
  ColmapModel model;
  model.cameras[1] = {0, 16, 12, {20, 8, 6}};
  for (std::size_t i = 0; i < capture.cameras.size(); ++i) {
    const auto& r = capture.cameras[i].rotation_camera_world;
    ColmapImage image;
    // The largest of the four, for digits; then the others from it.
    const std::array<double, 4> square{1 + r[0] + r[4] + r[8], 1 + r[0] - r[4] - r[8], 1 - r[0] + r[4] - r[8],
                                       1 - r[0] - r[4] + r[8]};
    std::size_t k = 0;
    for (std::size_t j = 1; j < 4; ++j) k = square[j] > square[k] ? j : k;
    const double s = 2 * std::sqrt(square[k]);
    const double a = r[7] - r[5], b = r[2] - r[6], c = r[3] - r[1];
    const double xy = r[1] + r[3], xz = r[2] + r[6], yz = r[5] + r[7];
    if (k == 0) image.rotation_wxyz = {s / 4, a / s, b / s, c / s};
    if (k == 1) image.rotation_wxyz = {a / s, s / 4, xy / s, xz / s};
    if (k == 2) image.rotation_wxyz = {b / s, xy / s, s / 4, yz / s};
    if (k == 3) image.rotation_wxyz = {c / s, xz / s, yz / s, s / 4};
    for (std::size_t row = 0; row < 3; ++row) {
      for (std::size_t j = 0; j < 3; ++j) image.translation[row] -= r[3 * row + j] * capture.cameras[i].center_world[j];
    }
    image.camera_id = 1;
    image.name = cube_image(i);
    model.images[static_cast<std::uint32_t>(3 * i + 2)] = image;
  }
  for (std::size_t i = 0; i < capture.points.size(); ++i)
    model.points[10 + i] = {capture.points[i], {10, 20, static_cast<std::uint8_t>(30 * i)}};
  return model;
}

/// A float64 .npy file of the given shape text.
inline std::string npy_text(const std::string& shape, const std::vector<double>& values) {
  std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': " + shape + ", }";
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string text("\x93NUMPY\x01\x00", 8);
  text += static_cast<char>(header.size() & 255);
  text += static_cast<char>(header.size() >> 8);
  text += header;
  text.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
  return text;
}

inline std::string cube_poses_bounds(const CubeCapture& capture) {
  std::vector<double> rows;
  for (const Camera<double>& camera : capture.cameras) {
    const auto& r = camera.rotation_camera_world;
    const std::array<double, 3> hwf{12, 16, 20};
    for (std::size_t i = 0; i < 3; ++i)  // columns: down, right, backwards, centre, (H, W, f)
      rows.insert(rows.end(), {r[3 + i], r[i], -r[6 + i], camera.center_world[i], hwf[i]});
    rows.insert(rows.end(), {2.0, 8.0});
  }
  return npy_text("(" + std::to_string(capture.cameras.size()) + ", 17)", rows);
}

inline std::string cube_ply(const CubeCapture& capture) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(capture.points.size()) +
                     "\nproperty double x\nproperty double y\nproperty double z\nproperty uchar red\nproperty uchar "
                     "green\nproperty uchar blue\nend_header\n";
  for (const auto& p : capture.points)
    text += number_text(p[0]) + " " + number_text(p[1]) + " " + number_text(p[2]) + " 1 2 3\n";
  return text;
}

}  // namespace compmark::testing
