// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/extent.hpp>
#include <compmark/scene/image_store.hpp>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <cmath>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// Largest difference of any number of the cameras, paired by the names of the images; -1 if they do not pair.
double camera_difference(const Dataset& dataset, const CubeCapture& capture) {
  if (dataset.views.size() != capture.cameras.size()) return -1;
  double worst = 0;
  for (std::size_t i = 0; i < capture.cameras.size(); ++i) {
    const auto view = std::find_if(dataset.views.begin(), dataset.views.end(), [&](const View& v) {
      return v.image_path.filename().string().find(cube_image(i)) != std::string::npos;
    });
    if (view == dataset.views.end()) return -1;
    const Camera<double>&a = view->camera, &b = capture.cameras[i];
    if (a.width != b.width || a.height != b.height) return -1;
    for (const double d : {a.fx - b.fx, a.fy - b.fy, a.cx - b.cx, a.cy - b.cy}) worst = std::fmax(worst, std::abs(d));
    for (std::size_t k = 0; k < 9; ++k)
      worst = std::fmax(worst, std::abs(a.rotation_camera_world[k] - b.rotation_camera_world[k]));
    for (std::size_t k = 0; k < 3; ++k)
      worst = std::fmax(worst, std::abs(a.center_world[k] * dataset.unit + dataset.origin[k] - b.center_world[k]));
  }
  return worst;
}

Dataset open(const std::filesystem::path& path, const DatasetSettings& settings = {}) {
  const Result<Dataset> dataset = open_dataset(path, settings);
  if (!dataset.ok()) MESSAGE(dataset.error().line());
  REQUIRE(dataset.ok());
  return *dataset;
}

const std::string pixel_intrinsics = "\"fl_x\": 20.0, \"fl_y\": 20.0, \"cx\": 8.0, \"cy\": 6.0, \"w\": 16.0, \"h\": 12";

}  // namespace

TEST_CASE("scene/dialects: one cube written in every dialect loads to the same cameras") {
  const CubeCapture capture = cube_capture();
  const TemporaryFolder folder;
  const auto in_images = [](std::size_t i) { return "images/" + cube_image(i); };
  // Issue: within 1e-5. Poses are written with 17 digits, so rounding is all that may differ.
  constexpr double tolerance = 1e-13;
  std::vector<Dataset> opened;
  const auto check = [&](const char* kind, const std::string& what) {
    CAPTURE(what);
    opened.push_back(open(folder.path() / what));
    CHECK(opened.back().kind == kind);
    const double difference = camera_difference(opened.back(), capture);
    CHECK(difference >= 0);
    CHECK(difference < tolerance);
  };
  const auto base = [&](const std::string& what) {
    put_cube_images(folder.path() / what / "images", capture);
    return folder.path() / what;
  };
  {  // NeRF-synthetic: a field of view, no extension, everything trains
    std::filesystem::path place = base("blender");
    put(place / "transforms_train.json",
        cube_transforms(capture, "\"camera_angle_x\": " + number_text(2 * std::atan(8 / 20.0)),
                        [&](std::size_t i) { return "./images/" + cube_image(i).substr(0, 2); }));
    check("blender", "blender");
  }
  put(base("ngp") / "transforms.json",
      cube_transforms(
          capture,
          pixel_intrinsics + ", \"camera_angle_x\": 0.1, \"aabb_scale\": 4, \"scale\": 0.5, \"offset\": [1,2,3]",
          in_images));
  check("transforms", "ngp");
  put(base("ngp_degrees") / "transforms.json",
      cube_transforms(capture,
                      "\"x_fov\": " + number_text(2 * std::atan(8 / 20.0) * 180 / 3.14159265358979323846) +
                          ", \"y_fov\": " + number_text(2 * std::atan(6 / 20.0) * 180 / 3.14159265358979323846),
                      [](std::size_t i) { return ".\\\\images\\\\" + cube_image(i); }));
  check("transforms", "ngp_degrees");
  {  // nerfstudio: a point file, a transform that is already applied, lists
    std::filesystem::path place = base("nerfstudio");
    put(place / "sparse_pc.ply", cube_ply(capture));
    put(place / "transforms.json",
        cube_transforms(capture,
                        "\"camera_model\": \"OPENCV\", " + pixel_intrinsics +
                            ", \"k1\": 0.0, \"k2\": 0, \"p1\": 0, \"p2\": 0, \"ply_file_path\": \"sparse_pc.ply\", "
                            "\"applied_transform\": [[0,1,0,0],[1,0,0,0],[0,0,-1,0]]",
                        in_images));
    check("transforms", "nerfstudio");
    CHECK(opened.back().points.size() == 8);
    CHECK(!opened.back().points_are_random);
  }
  {  // intrinsics of each frame, which come before those of the file
    std::string text = cube_transforms(capture, "\"fl_x\": 99, \"w\": 16, \"h\": 12", in_images);
    for (std::size_t at = text.find("\"file_path\""); at != std::string::npos;
         at = text.find("\"file_path\"", at + pixel_intrinsics.size() + 20))
      text.insert(at, pixel_intrinsics + ", ");
    put(base("per_frame") / "transforms.json", text);
    check("transforms", "per_frame");
  }
  put_colmap_binary(base("colmap_bin") / "sparse/0", cube_colmap(capture));
  check("colmap", "colmap_bin");
  put_colmap_text(base("colmap_txt") / "sparse", cube_colmap(capture));
  check("colmap", "colmap_txt");
  put(base("llff") / "poses_bounds.npy", cube_poses_bounds(capture));
  check("llff", "llff");

  // Where the numbers are equal, everything that is trained on is: cameras, points and pixels, to the bit.
  const Dataset &bin = opened[5], &txt = opened[6];
  CHECK(bin.points.position == txt.points.position);
  CHECK(bin.points.color == txt.points.color);
  for (std::size_t i = 0; i < bin.views.size(); ++i) {
    CHECK(bin.views[i].camera.rotation_camera_world == txt.views[i].camera.rotation_camera_world);
    CHECK(bin.views[i].camera.center_world == txt.views[i].camera.center_world);
    CHECK(bin.views[i].split == txt.views[i].split);
  }
  // Every 8th by name, in every dialect without a split of its own.
  for (std::size_t k = 1; k < opened.size(); ++k) {
    CHECK(opened[k].indices(Split::test) == std::vector<std::size_t>{0, 8});
  }
  CHECK(opened[0].indices(Split::test).empty());
  // Random points of the dialects without points lie around the cube.
  const LookAt at = look_at(opened[1]);
  CHECK(std::hypot(at.center[0], at.center[1], at.center[2]) < 0.02);
  CHECK(opened[1].points_are_random);
}

TEST_CASE("scene/dialects: lists of names decide the split, and a name of no frame is refused") {
  const CubeCapture capture = cube_capture();
  const TemporaryFolder folder;
  put_cube_images(folder.path() / "images", capture);
  const auto with = [&](const std::string& lists) {
    put(folder.path() / "transforms.json", cube_transforms(capture, pixel_intrinsics + ", " + lists,
                                                           [](std::size_t i) { return "images/" + cube_image(i); }));
    return open_dataset(folder.path(), {});
  };
  const Result<Dataset> listed = with(
      "\"train_filenames\": [\"images/00.png\", \"./images/02.png\"], \"val_filenames\": [\"images/01.png\"], "
      "\"test_filenames\": [\"images\\\\03.png\"]");
  REQUIRE(listed.ok());
  CHECK(listed->views.size() == 3);
  CHECK(listed->indices(Split::train).size() == 2);
  CHECK(listed->views[listed->indices(Split::test)[0]].name == "images/03.png");
  const Result<Dataset> validated =
      with("\"train_filenames\": [\"images/00.png\"], \"val_filenames\": [\"images/01.png\"]");
  REQUIRE(validated.ok());
  CHECK(validated->views[validated->indices(Split::test)[0]].name == "images/01.png");
  CHECK(
      names(with("\"train_filenames\": [\"images/77.png\"]").error(), "transforms.json", "train_filenames", "correct"));
  CHECK(names(with("\"test_filenames\": [\"images/01.png\"]").error(), "transforms.json", "train_filenames", "list"));
  CHECK(names(with("\"train_filenames\": []").error(), "transforms.json", "train_filenames", "list"));
}

TEST_CASE("scene/dialects: lenses of transforms files") {
  const CubeCapture capture = cube_capture();
  const TemporaryFolder folder;
  put_cube_images(folder.path() / "images", capture);
  const auto with = [&](const std::string& head) {
    put(folder.path() / "transforms.json", cube_transforms(capture, pixel_intrinsics + ", " + head,
                                                           [](std::size_t i) { return "images/" + cube_image(i); }));
    return open_dataset(folder.path(), {});
  };
  CHECK(with("\"k1\": 0.1, \"k2\": -0.2, \"p1\": 0.01, \"p2\": 0.02")->views[3].lens ==
        Lens{LensModel::opencv, {0.1, -0.2, 0.01, 0.02}});
  CHECK(with("\"k1\": 0.1, \"k2\": 0.2, \"k3\": 0.3, \"k4\": 0.4, \"is_fisheye\": true")->views[0].lens ==
        Lens{LensModel::opencv_fisheye, {0.1, 0.2, 0.3, 0.4}});
  CHECK(
      with("\"camera_model\": \"OPENCV_FISHEYE\", \"distortion_params\": [0.1, 0.2, 0.3, 0.4, 0, 0]")->views[0].lens ==
      Lens{LensModel::opencv_fisheye, {0.1, 0.2, 0.3, 0.4}});
  CHECK(with("\"distortion_params\": [0.1, 0, 0, 0, 0.01, 0.02]")->views[0].lens ==
        Lens{LensModel::opencv, {0.1, 0, 0.01, 0.02}});
  CHECK(with("\"k1\": 0.1, \"k3\": 0.3")->views[0].lens == Lens{LensModel::full_opencv, {0.1, 0, 0, 0, 0.3}});
  CHECK(with("\"camera_model\": \"PINHOLE\", \"k1\": 0")->views[0].lens == Lens{});
  // nerfstudio undistorts by the coefficients whatever perspective name stands beside them.
  CHECK(with("\"camera_model\": \"PINHOLE\", \"k1\": 0.1, \"p2\": 0.02")->views[0].lens ==
        Lens{LensModel::opencv, {0.1, 0, 0, 0.02}});
  CHECK(names(with("\"k4\": 0.1").error(), "transforms.json", "k4", "OPENCV_FISHEYE"));
  CHECK(names(with("\"camera_model\": \"EQUIRECTANGULAR\"").error(), "transforms.json", "camera_model", "perspective"));
  CHECK(names(with("\"k1\": NaN").error(), "transforms.json", "k1", "finite"));
}

TEST_CASE("scene/dialects: masks by frame, by folder and by the image's full name; a missing one is counted") {
  const CubeCapture capture = cube_capture();
  const TemporaryFolder folder;
  put_cube_images(folder.path() / "images", capture);
  const auto path = [](std::size_t i) { return "images/" + cube_image(i); };
  put(folder.path() / "transforms.json", cube_transforms(capture, pixel_intrinsics, path));
  put_image(folder.path() / "masks/00.png", 16, 12, 1);
  put_image(folder.path() / "masks/01.png.png", 16, 12, 1);
  const Dataset found = open(folder.path());
  CHECK(found.views[0].mask_path == folder.path() / "masks/00.png");
  CHECK(found.views[1].mask_path == folder.path() / "masks/01.png.png");
  CHECK(found.views[2].mask_path.empty());
  CHECK(std::any_of(found.warnings.begin(), found.warnings.end(),
                    [](const std::string& w) { return w.find("10 of 12 images have no mask") != std::string::npos; }));
  DatasetSettings without;
  without.masks = false;
  CHECK(open(folder.path(), without).views[0].mask_path.empty());
  std::string text = cube_transforms(capture, pixel_intrinsics, path);
  text.insert(text.find("\"file_path\""), "\"mask_path\": \"elsewhere/m\", ");
  put(folder.path() / "transforms.json", text);
  CHECK(names(open_dataset(folder.path(), {}).error(), "transforms.json", "frames[0].mask_path", "add the mask"));
  put_image(folder.path() / "elsewhere/m.png", 16, 12, 1);
  CHECK(open(folder.path()).views[0].mask_path == folder.path() / "elsewhere/m.png");
}

TEST_CASE("scene/dialects: a scene far from the origin, large or small loads to the same scene (cases PR7, PR8)") {
  // The same numbers in another unit or place: cameras and points agree after undoing both. Without moving to the
  // origin floats at 1e5 would be off by 4e-3.
  const CubeCapture plain = cube_capture();
  double plain_radius = 0;  // of the first case, which is the plain one
  struct Case {
    double scale;
    std::array<double, 3> center;
  };
  for (const Case& c : {Case{1, {0, 0, 0}}, Case{1, {1e5, -2e5, 3e4}}, Case{1e-3, {0, 0, 0}}, Case{1e3, {0, 0, 0}},
                        Case{1e-3, {1e5, 0, 0}}, Case{1e3, {1e8, 1e8, 0}}}) {
    CAPTURE(c.scale);
    CAPTURE(c.center[0]);
    const TemporaryFolder folder;
    const CubeCapture capture = cube_capture(c.scale, c.center);
    put_colmap_binary(folder.path() / "sparse/0", cube_colmap(capture));
    put_cube_images(folder.path() / "images", capture);
    const Dataset dataset = open(folder.path());
    const bool far = c.center[0] != 0;
    CHECK((dataset.origin != std::array<double, 3>{0, 0, 0}) == far);
    CHECK(dataset.unit == (c.scale == 1 ? 1 : c.scale < 1 ? 0x1p-10 : 0x1p+9));  // of radius 4, 0.004 and 4,000
    CHECK(camera_difference(dataset, capture) < 1e-5 * c.scale + 1e-9);
    if (plain_radius == 0) plain_radius = scene_extent(dataset).radius;
    CHECK(scene_extent(dataset).radius * dataset.unit == doctest::Approx(c.scale * plain_radius).epsilon(1e-6));
    REQUIRE(dataset.points.size() == 8);
    for (std::size_t i = 0; i < 8; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        const double point = static_cast<double>(dataset.points.position[i][k]) * dataset.unit + dataset.origin[k];
        // Doubles at 1e5 with a scene of 1e-3: 1e-11 / 1e-3. Floats of the scene's size: 1e-7.
        CHECK(std::abs((point - c.center[k]) / c.scale - plain.points[i][k]) < 1e-6);
      }
    }
  }
}

TEST_CASE("scene/dialects: captures of one and two images") {
  const TemporaryFolder folder;
  for (const int count : {1, 2}) {
    CAPTURE(count);
    const CubeCapture capture = cube_capture(1, {0, 0, 0}, count);
    for (const char* kind : {"colmap", "transforms", "llff"}) {
      CAPTURE(kind);
      const std::filesystem::path place = folder.path() / (kind + std::to_string(count));
      put_cube_images(place / "images", capture);
      if (kind == std::string("colmap")) put_colmap_binary(place / "sparse/0", cube_colmap(capture));
      if (kind == std::string("llff")) put(place / "poses_bounds.npy", cube_poses_bounds(capture));
      if (kind == std::string("transforms"))
        put(place / "transforms.json",
            cube_transforms(capture, pixel_intrinsics, [](std::size_t i) { return "images/" + cube_image(i); }));
      const Dataset dataset = open(place);
      CHECK(dataset.views.size() == static_cast<std::size_t>(count));
      CHECK(dataset.indices(Split::train).size() == 1);  // one alone trains; of two the first is a test view
      CHECK(dataset.points.size() > 0);
      for (const auto& p : dataset.points.position) {
        for (const float v : p) CHECK(std::isfinite(v));
      }
      CHECK(ImageStore(dataset, {}).get(0).ok());
    }
  }
}

TEST_CASE("scene/dialects: points in the centres of cameras are dropped, near ones are not") {
  const TemporaryFolder folder;
  CubeCapture capture = cube_capture();
  const auto at = [&](std::size_t i) { return capture.cameras[i].center_world; };
  capture.points.push_back(at(3));
  capture.points.push_back({at(5)[0] + 1e-8, at(5)[1], at(5)[2] - 1e-8});
  capture.points.push_back({at(5)[0] + 0.01, at(5)[1], at(5)[2]});  // stays
  put_cube_images(folder.path() / "images", capture);
  put_colmap_binary(folder.path() / "sparse/0", cube_colmap(capture));
  const Dataset dataset = open(folder.path());
  CHECK(dataset.points.size() == 9);
  REQUIRE(dataset.warnings.size() == 1);
  CHECK(dataset.warnings[0].find("2 points in the centres of cameras") != std::string::npos);
}

TEST_CASE("scene/dialects: images of different sizes keep their own cameras") {
  const TemporaryFolder folder;
  const CubeCapture capture = cube_capture();
  ColmapModel model = cube_colmap(capture);
  model.cameras[2] = {1, 30, 10, {25, 26, 14, 5}};
  for (auto& [id, image] : model.images) image.camera_id = id % 2 == 0 ? 1 : 2;
  put_cube_images(folder.path() / "images", capture);
  for (const auto& [id, image] : model.images) {
    if (image.camera_id == 2) put_image(folder.path() / "images" / image.name, 30, 10);
  }
  put_colmap_binary(folder.path() / "sparse/0", model);
  DatasetSettings half;
  half.downscale = 2;
  for (const DatasetSettings& settings : {DatasetSettings{}, half}) {
    const Dataset dataset = open(folder.path(), settings);
    ImageStore store(dataset, settings);
    for (std::size_t i = 0; i < dataset.views.size(); ++i) {
      const Camera<double>& camera = dataset.views[i].camera;
      const Result<const StoredImage*> image = store.get(i);
      REQUIRE(image.ok());
      CHECK((*image)->width == camera.width);
      CHECK((*image)->height == camera.height);
      CHECK(camera.fx == (i % 2 == 0 ? 20.0 : 25.0) / settings.downscale);
      CHECK((*image)->mask.empty());
    }
  }
}
