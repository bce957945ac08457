// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The result of every reader: cameras with the names of their images, a point cloud to start from, and warnings. No
// pixel is decoded here; ImageStore does that on demand.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_model.hpp"

namespace compmark {

enum class Split { train, test };

/// How a lens that is not a pinhole is treated.
enum class LensTreatment : std::uint8_t {
  /// images are resampled to the pinhole when they are loaded, with a mask of the pixels that the photograph has
  undistort,
  ignore,  ///< as if it were a pinhole (what the published loaders do with SIMPLE_RADIAL)
  keep     ///< images stay as they are; whoever renders projects through the lens
};

/// How the numbers of a mask become the weight of a pixel (scene/mask_reading.hpp).
enum class MaskReading : std::uint8_t {
  level,     ///< the brightness is the weight
  any,       ///< what is not black counts whole
  alpha,     ///< the alpha channel is the weight
  any_alpha  ///< what is not transparent counts whole
};

/// One photograph: where its pixels are and the camera that took it.
struct View {
  std::string name;                  ///< as the dataset calls it
  std::filesystem::path image_path;  ///< file to decode; with Dataset::pictures: what they are made of
  Camera<double> camera;             ///< at the size after downscaling, which is the size ImageStore delivers
  Split split = Split::train;
  bool has_alpha = false;  ///< the file has an alpha channel, to be composited over the background
  int file_width = 0;      ///< size of the file, turned, when the dataset was opened; 0: not known
  int file_height = 0;
  Lens lens;  ///< of the photograph, on the camera's normalised coordinates
  LensTreatment lens_treatment =
      LensTreatment::ignore;        ///< never undistort for a lens that moves no pixel by a quarter
  std::filesystem::path mask_path;  ///< an image of the file's size, black = ignore; empty: none
  MaskReading mask_reading = MaskReading::level;
  int orientation = 1;  ///< how the file is turned when decoded (io/exif.hpp)
};

/// Points of structure from motion, or random ones. Rows of both columns correspond.
struct PointCloud {
  std::vector<std::array<float, 3>> position;      ///< world units
  std::vector<std::array<std::uint8_t, 3>> color;  ///< 8-bit RGB

  [[nodiscard]] std::size_t size() const { return position.size(); }
};

class PictureSource;

struct Dataset {
  std::string kind;            ///< "blender" (transforms_train.json), "transforms", "colmap", "llff" or "splats"
  std::filesystem::path root;  ///< the folder, or the file, that was opened
  std::vector<View> views;     ///< a deterministic order: the file's own (Blender), by name (the others)
  PointCloud points;
  bool points_are_random = false;
  std::vector<std::string> warnings;  ///< one complete sentence each, for the user
  std::array<double, 3> origin{0, 0,
                               0};  ///< plus `unit` times a position here is the position in the files' coordinates
  double unit = 1;                  ///< length in the files' coordinates of a length of 1 here
  std::optional<std::array<double, 3>> splat_up = {};  ///< up, of splats: of length 1
  std::shared_ptr<const PictureSource> pictures = {};  ///< makes the pictures (picture_source.hpp); null: files do

  [[nodiscard]] std::vector<std::size_t> indices(Split split) const {
    std::vector<std::size_t> result;
    for (std::size_t i = 0; i < views.size(); ++i) {
      if (views[i].split == split) result.push_back(i);
    }
    return result;
  }
};

/// Where a place of the files' coordinates is in a dataset.
[[nodiscard]] inline std::array<double, 3> place_in(const Dataset& dataset, std::array<double, 3> place) {
  for (std::size_t c = 0; c < 3; ++c) place[c] = (place[c] - dataset.origin[c]) / dataset.unit;
  return place;
}

/// Counts a dataset's lengths in `unit`, which is positive: everything keeps its place in the files' coordinates.
inline void change_unit(Dataset& dataset, double unit) {
  const double factor = dataset.unit / unit;
  for (View& view : dataset.views) {
    for (double& x : view.camera.center_world) x *= factor;
  }
  for (std::array<float, 3>& p : dataset.points.position) {
    for (float& x : p) x = static_cast<float>(static_cast<double>(x) * factor);
  }
  dataset.unit = unit;
}

/// Moves a dataset so that its origin is `origin`: everything keeps its place in the files' coordinates.
inline void move_origin(Dataset& dataset, const std::array<double, 3>& origin) {
  std::array<double, 3> shift{};
  for (std::size_t c = 0; c < 3; ++c) shift[c] = (dataset.origin[c] - origin[c]) / dataset.unit;
  for (View& view : dataset.views) {
    for (std::size_t c = 0; c < 3; ++c) view.camera.center_world[c] += shift[c];
  }
  for (std::array<float, 3>& p : dataset.points.position) {
    for (std::size_t c = 0; c < 3; ++c) p[c] = static_cast<float>(static_cast<double>(p[c]) + shift[c]);
  }
  dataset.origin = origin;
}

/// How to open a dataset. The defaults are the published ones (docs/spec/method.md, 3.4 and 3.5), but for the lens,
/// which they ignore.
struct DatasetSettings {
  double downscale = 1;                      ///< divides width and height, rounded; intrinsics follow the true ratio
  std::array<float, 3> background{0, 0, 0};  ///< behind transparent images
  std::uint64_t seed = 0;                    ///< of the random points
  std::size_t random_points = 10000;         ///< where a dataset has no points: uniform in [-1.3, 1.3]^3 (Blender)
  int test_every = 8;           ///< datasets without a split: every n-th image by name is a test view; 0: none
  int max_width = 1600;         ///< with downscale 1, wider images are scaled down to this; 0: no limit
  bool use_point_file = false;  ///< Blender: take points3d.ply, if there, instead of random points
  LensTreatment lens = LensTreatment::undistort;
  /// Of splats, a direction of length 1; not set: what the file says, or -y, as in the captures of the standard PLY.
  std::optional<std::array<double, 3>> splat_up;  ///< up, of splats, of length 1, where somebody says it
  bool masks = true;  ///< take masks (mask_path of a frame, folder masks) where there are any
};

}  // namespace compmark
