// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A folder with a capture in it, opened as the tool opens it, and its views decoded: what is accepted has finite
// cameras, and images of their cameras' size.
#pragma once

#include <cmath>
#include <compmark/scene/decode.hpp>
#include <compmark/scene/open.hpp>

#include "any_tensors.hpp"

namespace compmark::testing {

/// Good files of two kinds of capture, which the targets put beside any bytes.
inline const std::string capture_json =
    R"({"camera_angle_x":0.8,"frames":[{"file_path":"images/a.png","mask_path":"masks/a.png",)"
    R"("transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]},)"
    R"({"file_path":"images/b.png","transform_matrix":[[1,0,0,1],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}]})";
inline const std::string colmap_cameras =
    "# cameras\n1 PINHOLE 8 6 9 9 4 3\n2 SIMPLE_RADIAL 8 6 9 4 3 0.1\n3 OPENCV_FISHEYE 8 6 9 9 4 3 0.1 0 0 0\n";
inline const std::string colmap_images =
    "1 1 0 0 0 0 0 4 1 a.png\n1.5 2.5 1\n2 0.9 0.1 0 0 1 0 4 2 sub/b.jpg\n\n3 1 0 0 0 2 0 4 3 c.png\n\n"
    "4 1 0 0 0 3 0 4 1 d.png\n\n";
inline const std::string colmap_points = "1 0 0 0 10 20 30 0.5 1 0\n2 1 0.5 0 10 20 30 0.5 1 0 2 1\n";

inline void put_small_image(const std::filesystem::path& path, int width, int height, int channels) {
  ImageBytes image{width, height, channels, {}};
  for (int i = 0; i < width * height * channels; ++i) image.pixels.push_back(static_cast<std::uint8_t>(11 * i + width));
  std::filesystem::create_directories(path.parent_path());
  put_bytes(path, encode_png(image));
}

inline void look_at_capture(const std::filesystem::path& folder, std::size_t choices) {
  DatasetSettings settings;
  settings.random_points = 10;
  settings.max_width = 64;
  settings.downscale = choices % 2 == 0 ? 1 : 2;
  settings.lens = choices % 4 < 2 ? LensTreatment::undistort : LensTreatment::ignore;
  const Result<Dataset> dataset = open_dataset(folder, settings);
  if (!dataset) {
    require_words(dataset.error());
    return;
  }
  for (const std::string& warning : dataset->warnings) {
    if (warning.empty() || warning.find('\n') != std::string::npos) std::abort();
  }
  std::size_t pixels = 0;
  for (const View& view : dataset->views) {
    const Camera<double>& c = view.camera;
    for (const double x : {c.fx, c.fy, c.cx, c.cy, c.center_world[0], c.center_world[1], c.center_world[2],
                           c.rotation_camera_world[0], c.rotation_camera_world[8]}) {
      if (!std::isfinite(x)) std::abort();
    }
    if (!(c.fx > 0) || !(c.fy > 0) || c.width < 1 || c.height < 1) std::abort();
    pixels += static_cast<std::size_t>(view.file_width) * static_cast<std::size_t>(view.file_height);
    if (pixels > (std::size_t{1} << 21)) return;  // nothing new, but slow
    const Result<StoredImage> image =
        decode_view(view, {.alpha_mask = choices % 8 < 4, .keep_alpha = choices % 16 < 8});
    if (!image) {
      require_words(image.error());
      continue;
    }
    if (image->width != c.width || image->height != c.height || image->planes.size() != 3 * image->plane_size() ||
        (!image->mask.empty() && image->mask.size() != image->plane_size()))
      std::abort();
  }
}

}  // namespace compmark::testing
