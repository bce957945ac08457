// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One capture in every dialect that is read, whose numbers survive each of them exactly: twelve cameras turned by the rotations of a
// tetrahedron, whose quaternions and matrices are of 0, 1/2 and 1, at dyadic places. It trains to one hash, whatever it was written in.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/io/sha256.hpp>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/scene/extent.hpp>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/scene/procedural_write.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <functional>
#include <limits>
#include <map>
#include <numbers>
#include <span>
#include <string>
#include <vector>

#include "scene/cube_dialects.hpp"
#include "support/small_scene.hpp"

namespace {

using namespace compmark;
using namespace compmark::testing;

/// Cameras of 16 x 12 pixels with a focal length of 20, as cube_dialects.hpp writes them, around 125 points.
CubeCapture exact_capture() {
  CubeCapture capture;
  const int signs[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  for (std::size_t i = 0; i < 12; ++i) {
    Camera<double> camera;
    camera.width = 16;
    camera.height = 12;
    camera.fx = camera.fy = 20;
    camera.cx = 8;
    camera.cy = 6;
    camera.rotation_camera_world = {};
    for (std::size_t row = 0; row < 3; ++row)  // an even permutation of the axes with an even number of signs
      camera.rotation_camera_world[3 * row + (row + i) % 3] = signs[i / 3][row];
    for (std::size_t c = 0; c < 3; ++c) {
      camera.center_world[c] = (i < 6 ? -3.5 : -4.25) * camera.rotation_camera_world[6 + c] +
                               0.125 * camera.rotation_camera_world[c] * static_cast<double>(i);
    }
    capture.cameras.push_back(camera);
  }
  for (int i = 0; i < 125; ++i)
    capture.points.push_back({0.5 * (i % 5) - 1, 0.5 * (i / 5 % 5) - 1, 0.5 * (i / 25) - 1.25});
  return capture;
}

/// The built-in scene from these cameras, with the background behind it.
const std::vector<ImageBytes>& exact_photographs() {
  static const std::vector<ImageBytes> images = [] {
    std::vector<ImageBytes> result;
    SerialExecutor executor;
    const ProceduralScene scene(0);
    for (const Camera<double>& camera : exact_capture().cameras) {
      const ImageBytes rgba = render_procedural(scene, camera, executor);
      ImageBytes rgb{camera.width, camera.height, 3, {}};
      for (std::size_t k = 0; k < rgba.pixels.size(); k += 4) {
        for (std::size_t c = 0; c < 3; ++c)
          rgb.pixels.push_back(static_cast<std::uint8_t>(rgba.pixels[k + c] * rgba.pixels[k + 3] / 255));
      }
      result.push_back(std::move(rgb));
    }
    return result;
  }();
  return images;
}

/// The angle from which a reader that computes `focal` finds exactly `wanted`, among the neighbours of `angle`.
double exact_angle(double angle, const std::function<double(double)>& focal, double wanted) {
  double low = angle, high = angle;
  for (int i = 0; i < 64; ++i) {
    if (focal(low) == wanted) return low;
    if (focal(high) == wanted) return high;
    low = std::nextafter(low, 0.0);
    high = std::nextafter(high, 4e9);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

struct DatasetTraining {
  const Dataset* dataset;
  ImageStore* store;
  std::vector<std::size_t> index = dataset->indices(Split::train);
  [[nodiscard]] std::size_t size() const { return index.size(); }
  [[nodiscard]] Camera<double> camera(std::size_t i) const { return dataset->views[index[i]].camera; }
  [[nodiscard]] Result<Done> load(std::size_t i, ImageView<float> image) const { return store->load(index[i], image); }
};

/// Hash of all parameters after a short training, which grows anchors, and of a render of every test view.
std::string trained_hash(const Dataset& dataset) {
  TrainSettings settings;
  settings.iterations = 40;
  settings.statistics_after = 1500;
  settings.grow_after = 3000;
  settings.grow_until = 29000;
  settings.grow_interval = 10;
  settings.gradient_threshold = 1e-5;
  settings.voxel_size = 0.05;
  settings.init_factor = 4;
  SerialExecutor executor;
  ImageStore store(dataset, {});
  DatasetTraining views{&dataset, &store};
  Trainer<SmallRecipe, SerialExecutor> trainer(settings, views.size(), scene_extent(dataset).radius, executor);
  REQUIRE(trainer.initialise(dataset.points.position).ok());
  const std::size_t before = trainer.model().anchor_count();
  const Result<Done> done = trainer.run(views);
  if (!done) MESSAGE(done.error().line());
  REQUIRE(done.ok());
  CHECK(trainer.model().anchor_count() != before);
  Sha256 hash;
  hash.update(std::as_bytes(trainer.model().arena.all_values()));
  Pipeline<SmallRecipe>::Context context;
  for (const std::size_t i : dataset.indices(Split::test)) {
    static_cast<void>(
        Pipeline<SmallRecipe>{}.forward(trainer.model(), dataset.views[i].camera, unseen_view, context, executor));
    hash.update(std::as_bytes(std::span<const float>(context.image.flat())));
  }
  return hash.hex();
}

}  // namespace

TEST_CASE("training/dialects: one capture in every dialect trains to one hash") {
  const CubeCapture capture = exact_capture();
  const TemporaryFolder folder;
  const std::string pixels = "\"fl_x\": 20, \"fl_y\": 20, \"cx\": 8, \"cy\": 6, \"w\": 16, \"h\": 12";
  const std::vector<std::size_t> training{1, 2, 3, 4, 5, 6, 7, 9, 10, 11};  // all but every eighth
  const std::string size = "\"w\": 16, \"h\": 12";
  const auto in_images = [](std::size_t i) { return "images/" + cube_image(i); };
  const auto base = [&](const std::string& what) {
    for (std::size_t i = 0; i < 12; ++i) {
      std::filesystem::create_directories(folder.path() / what / "images");
      REQUIRE(write_png(folder.path() / what / "images" / cube_image(i), exact_photographs()[i]).ok());
    }
    return folder.path() / what;
  };
  std::map<std::string, Dataset> opened;
  const auto open = [&](const std::string& what, const std::string& kind, bool own_points) {
    CAPTURE(what);
    DatasetSettings settings;
    settings.use_point_file = true;
    const Result<Dataset> dataset = open_dataset(folder.path() / what, settings);
    if (!dataset) MESSAGE(dataset.error().line());
    REQUIRE(dataset.ok());
    CHECK(dataset->kind == kind);
    CHECK(dataset->points_are_random == !own_points);
    opened[what] = *dataset;
  };

  {  // NeRF-synthetic: a field of view, no extensions, two files
    const std::filesystem::path place = base("blender");
    CubeCapture part = capture;
    const std::string angle =
        "\"camera_angle_x\": " + number_text(exact_angle(
                                     2 * std::atan(8 / 20.0), [](double a) { return 16 / (2 * std::tan(a / 2)); }, 20));
    const auto write = [&](const char* file, const std::vector<std::size_t>& which) {
      part.cameras.clear();
      for (const std::size_t i : which) part.cameras.push_back(capture.cameras[i]);
      put(place / file,
          cube_transforms(part, angle, [&](std::size_t i) { return "./images/" + cube_image(which[i]).substr(0, 2); }));
    };
    write("transforms_train.json", training);
    write("transforms_test.json", {0, 8});
    put(place / "points3d.ply", cube_ply(capture));
    open("blender", "blender", true);
  }
  put(base("ngp") / "transforms.json",
      cube_transforms(capture, pixels + ", \"aabb_scale\": 4, \"scale\": 0.5, \"offset\": [1,2,3]", in_images));
  open("ngp", "transforms", false);
  {
    const auto focal = [](double side) {
      return [side](double degrees) { return side / (2 * std::tan(degrees * (std::numbers::pi / 180) / 2)); };
    };
    put(base("ngp_degrees") / "transforms.json",
        cube_transforms(capture,
                        size + ", \"x_fov\": " +
                            number_text(exact_angle(2 * std::atan(8 / 20.0) * 180 / std::numbers::pi, focal(16), 20)) +
                            ", \"y_fov\": " +
                            number_text(exact_angle(2 * std::atan(6 / 20.0) * 180 / std::numbers::pi, focal(12), 20)),
                        [](std::size_t i) { return ".\\\\images\\\\" + cube_image(i); }));
    open("ngp_degrees", "transforms", false);
  }
  {  // nerfstudio: points, lists of names, frames in another order
    const std::filesystem::path place = base("nerfstudio");
    CubeCapture turned = capture;
    std::reverse(turned.cameras.begin(), turned.cameras.end());
    std::string lists = "\"train_filenames\": [";
    for (const std::size_t i : training) lists += (i > 1 ? ", \"" : "\"") + in_images(i) + "\"";
    lists += "], \"test_filenames\": [\"images/00.png\", \"images/08.png\"]";
    put(place / "transforms.json",
        cube_transforms(turned,
                        "\"camera_model\": \"OPENCV\", " + pixels +
                            ", \"k1\": 0.0, \"k2\": 0, \"p1\": 0, \"p2\": 0, \"ply_file_path\": \"sparse_pc.ply\", "
                            "\"applied_transform\": [[0,1,0,0],[1,0,0,0],[0,0,-1,0]], " +
                            lists,
                        [&](std::size_t i) { return in_images(11 - i); }));
    put(place / "sparse_pc.ply", cube_ply(capture));
    open("nerfstudio", "transforms", true);
  }
  put_colmap_binary(base("colmap_bin") / "sparse/0", cube_colmap(capture));
  open("colmap_bin", "colmap", true);
  put_colmap_text(base("colmap_txt") / "sparse", cube_colmap(capture));
  open("colmap_txt", "colmap", true);
  put(base("llff") / "poses_bounds.npy", cube_poses_bounds(capture));
  open("llff", "llff", false);

  const Dataset& reference = opened.at("colmap_bin");
  CHECK(reference.indices(Split::train).size() == 10);
  const std::string expected = trained_hash(reference);
  const std::string random_expected = trained_hash(opened.at("ngp"));
  CHECK(random_expected != expected);
  for (auto& entry : opened) {
    const std::string& what = entry.first;
    Dataset& dataset = entry.second;
    CAPTURE(what);
    // The numbers are equal, those of training and those of test views, each in its order.
    for (const Split split : {Split::train, Split::test}) {
      const std::vector<std::size_t> mine = dataset.indices(split), theirs = reference.indices(split);
      REQUIRE(mine.size() == theirs.size());
      for (std::size_t i = 0; i < mine.size(); ++i) {
        const Camera<double>&a = dataset.views[mine[i]].camera, &b = reference.views[theirs[i]].camera;
        CHECK(a.fx == b.fx);
        CHECK(a.fy == b.fy);
        CHECK(a.cx == b.cx);
        CHECK(a.cy == b.cy);
        CHECK(a.center_world == b.center_world);
        CHECK(a.rotation_camera_world == b.rotation_camera_world);
      }
    }
    // instant-ngp's files know no points, in pixels as in degrees: random ones, the same; LLFF's lie between its bounds. Given the points,
    // they train to the hash of the others.
    if (what == "ngp_degrees") CHECK(trained_hash(dataset) == random_expected);
    if (dataset.points_are_random) dataset.points = reference.points;
    CHECK(dataset.points.position == reference.points.position);
    CHECK(trained_hash(dataset) == expected);
  }

  // The control: a thousandth of a pixel, or one view that was another's, is another hash.
  Dataset other = reference;
  other.views[3].camera.cx += 0.001;
  CHECK(trained_hash(other) != expected);
  other = reference;
  std::swap(other.views[3].image_path, other.views[4].image_path);
  CHECK(trained_hash(other) != expected);
}
