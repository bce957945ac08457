// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <cmath>
#include <set>

#include "pinhole_projection.hpp"
#include "scene/cube_dialects.hpp"
#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/transforms: OpenGL poses land where the optics say") {
  // Camera at z = 4 looking down -z with y up. A point to the right and above the origin appears right of and above (smaller v) the centre.
  const TemporaryFolder folder;
  put_blender(folder.path());
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(dataset->kind == "blender");
  REQUIRE(dataset->views.size() == 3);
  CHECK(dataset->indices(Split::train) == std::vector<std::size_t>{0, 1});
  CHECK(dataset->indices(Split::test) == std::vector<std::size_t>{2});
  const Camera<double>& camera = dataset->views[0].camera;
  const double f = 8 / std::tan(0.4);  // width 16, half angle 0.4
  CHECK(camera.fx == doctest::Approx(f).epsilon(1e-14));
  CHECK(camera.fy == camera.fx);
  const std::array<double, 3> pixel = project(camera, {1, 0.5, 0});
  CHECK(pixel[0] == doctest::Approx(8 + f / 4).epsilon(1e-14));
  CHECK(pixel[1] == doctest::Approx(6 - f / 8).epsilon(1e-14));
  CHECK(pixel[2] == doctest::Approx(4).epsilon(1e-14));
  Camera<double> unturned =
      camera;  // negative control (CA2): the file's own axes, y up and z backwards: the scene is behind
  for (std::size_t k = 3; k < 9; ++k) unturned.rotation_camera_world[k] *= -1;
  CHECK(project(unturned, {1, 0.5, 0})[2] == doctest::Approx(-4).epsilon(1e-14));
  CHECK(dataset->views[0].has_alpha);
}

TEST_CASE("scene/transforms: rotations are re-orthonormalised, scale and mirror are noticed") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  const auto open_with = [&](const std::string& matrix) {
    put(folder.path() / "transforms_train.json", transforms_text(frame_text("train/a", matrix)));
    return open_dataset(folder.path(), {});
  };
  SUBCASE("four digits of rounding") {
    // A rotation of 0.3 about y, written with 4 digits: off by up to 5e-5, corrected to 1e-15.
    const Result<Dataset> dataset = open_with("[[0.9553,0,0.2955,0],[0,1,0,0],[-0.2955,0,0.9553,4],[0,0,0,1]]");
    REQUIRE(dataset.ok());
    const auto& r = dataset->views[0].camera.rotation_camera_world;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        double sum = 0;
        for (std::size_t k = 0; k < 3; ++k) sum += r[3 * i + k] * r[3 * j + k];
        CHECK(std::abs(sum - (i == j ? 1.0 : 0.0)) < 4e-16 * 4);
      }
    }
    CHECK(detail::determinant(r) == doctest::Approx(1.0).epsilon(1e-14));
    CHECK(dataset->warnings.empty());
  }
  SUBCASE("uniform scale") {
    const Result<Dataset> dataset = open_with("[[2,0,0,0],[0,2,0,0],[0,0,2,4],[0,0,0,1]]");
    REQUIRE(dataset.ok());
    REQUIRE(dataset->warnings.size() == 1);
    CHECK(dataset->warnings[0].find("scale of 2.0") != std::string::npos);
    CHECK(project(dataset->views[0].camera, {0, 0, 0})[2] == doctest::Approx(4));
  }
  SUBCASE("mirrored") {
    const Result<Dataset> dataset = open_with("[[-1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]");
    REQUIRE(!dataset.ok());
    CHECK(names(dataset.error(), "transforms_train.json", "frames[0].transform_matrix", "correct the pose"));
  }
}

TEST_CASE("scene/transforms: random points fill the cube, depend on the seed alone and stay off the disk") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  DatasetSettings settings;
  const Result<Dataset> dataset = open_dataset(folder.path(), settings);
  REQUIRE(dataset.ok());
  CHECK(dataset->points_are_random);
  CHECK(dataset->points.size() == 10000);
  CHECK(dataset->points.color.size() == 10000);
  std::array<double, 3> mean{};
  float largest = 0;
  for (const auto& p : dataset->points.position) {
    for (std::size_t c = 0; c < 3; ++c) {
      mean[c] += static_cast<double>(p[c]) / 10000;
      largest = std::max(largest, std::abs(p[c]));
    }
  }
  // The mean of 10,000 uniforms in +-1.3 has standard deviation 1.3 / sqrt(3e4) = 0.0075; five of them.
  for (const double m : mean) CHECK(std::abs(m) < 0.0375);
  CHECK(largest <= 1.3f);
  CHECK(largest > 1.299f);
  CHECK(open_dataset(folder.path(), settings)->points.position == dataset->points.position);
  settings.seed = 1;
  CHECK(open_dataset(folder.path(), settings)->points.position != dataset->points.position);
  std::set<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    files.insert(entry.path().filename().string());
  CHECK(files == std::set<std::string>{"train", "test", "transforms_train.json", "transforms_test.json"});
}

TEST_CASE(
    "scene/transforms: a Blender scene in another unit starts with points around what its cameras look at (case PR8)") {
  const auto opened = [](double scale, std::array<double, 3> center) {
    const TemporaryFolder folder;
    const CubeCapture capture = cube_capture(scale, center);
    put_cube_images(folder.path(), capture);
    put(folder.path() / "transforms_train.json",
        cube_transforms(capture, "\"camera_angle_x\": 0.7", [](std::size_t i) { return cube_image(i); }));
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    CHECK(dataset->points_are_random);
    CHECK(dataset->points.size() == 10000);
    return *dataset;
  };
  // The largest distance of a random point from a place of the files, along an axis.
  const auto spread = [](const Dataset& dataset, const std::array<double, 3>& center) {
    double largest = 0;
    for (const auto& p : dataset.points.position) {
      for (std::size_t c = 0; c < 3; ++c)
        largest = std::max(largest, std::abs(static_cast<double>(p[c]) - place_in(dataset, center)[c]));
    }
    return largest;
  };
  const Dataset plain = opened(1, {0, 0, 0});
  CHECK(plain.unit == 1);
  CHECK(spread(plain, {0, 0, 0}) <= 1.3f);
  const Dataset small = opened(0x1p-10, {0, 0, 0}), large = opened(0x1p+10, {0, 0, 0});
  CHECK(small.unit == 0x1p-10);
  CHECK(large.unit == 0x1p+10);
  CHECK(small.points.position == large.points.position);
  for (std::size_t i = 0; i < 12; ++i) CHECK(small.views[i].camera.center_world == plain.views[i].camera.center_world);
  // Cameras at 4.27: the published 1.3 of 4.03 is 1.378 of them. Their circle is not quite flat, which moves what they look at by 0.01.
  CHECK(spread(small, {0, 0, 0}) == doctest::Approx(1.378).epsilon(0.01));
  // Where the object is not in the middle of its coordinates, the points are around it all the same.
  const std::array<double, 3> place{3000, -2000, 5000};
  CHECK(spread(opened(0x1p+10, place), place) == doctest::Approx(1.378).epsilon(0.01));
}

TEST_CASE("scene/transforms: downscaling follows the true size ratio (case CA1)") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  DatasetSettings settings;
  settings.downscale = 5;  // 16 x 12 -> 3 x 2: ratios 0.1875 and 0.1667, neither is 1/5
  const Result<Dataset> dataset = open_dataset(folder.path(), settings);
  REQUIRE(dataset.ok());
  const Camera<double>& camera = dataset->views[0].camera;
  CHECK(camera.width == 3);
  CHECK(camera.height == 2);
  const double f = 8 / std::tan(0.4);
  CHECK(camera.fx == doctest::Approx(f * 3 / 16).epsilon(1e-14));
  CHECK(camera.fy == doctest::Approx(f * 2 / 12).epsilon(1e-14));
  CHECK(camera.fx != doctest::Approx(f / 5).epsilon(0.01));  // negative control: the nominal factor
}

TEST_CASE(
    "scene/transforms: an angle comes back from its focal length; none of half a turn and more is believed (CA4)") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  const auto open_with = [&](double angle) {
    put(folder.path() / "transforms_train.json",
        "{\"camera_angle_x\": " + std::to_string(angle) + ", \"frames\": [" + frame_text("train/a") + "]}");
    return open_dataset(folder.path(), {});
  };
  for (const double angle : {0.001, 0.5, 1.5, 3.0, 3.14}) {
    const Result<Dataset> dataset = open_with(angle);
    REQUIRE(dataset.ok());
    const Camera<double>& camera = dataset->views[0].camera;
    CHECK(std::abs(2 * std::atan(camera.width / (2 * camera.fx)) - angle) < 4 * 2.3e-16 * angle);
  }
  for (const double angle : {3.1416, 3.2, 0.0, -1.0}) CHECK_FALSE(open_with(angle).ok());
  CHECK(8 / std::tan(3.2 / 2) < 0);  // negative control: the formula's own focal length
}

TEST_CASE("scene/transforms: points3d.ply is used only if asked for") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  put(folder.path() / "points3d.ply",
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\nproperty double z\nproperty "
      "uchar red\nproperty uchar green\n"
      "property uchar blue\nend_header\n1 2 3 4 5 6\nnan 0 0 1 1 1\n");
  DatasetSettings settings;
  CHECK(open_dataset(folder.path(), settings)->points.size() == 10000);
  settings.use_point_file = true;
  const Result<Dataset> dataset = open_dataset(folder.path(), settings);
  REQUIRE(dataset.ok());
  CHECK(!dataset->points_are_random);
  REQUIRE(dataset->points.size() == 1);
  CHECK(dataset->points.position[0] == std::array<float, 3>{1, 2, 3});
  CHECK(dataset->points.color[0] == std::array<std::uint8_t, 3>{4, 5, 6});
}

TEST_CASE("scene/transforms: a point file whose path was written with backslashes is found") {
  const TemporaryFolder folder;
  put_image(folder.path() / "images/a.png", 16, 12);
  put(folder.path() / "sparse_pc/points.ply",
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
      "1 2 3\n");
  put(folder.path() / "transforms.json",
      R"({"camera_angle_x": 0.8, "ply_file_path": ".\\sparse_pc\\points.ply", "frames": [)" + frame_text("images/a") +
          "]}");
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(!dataset->points_are_random);
  CHECK(dataset->points.size() == 1);
}

TEST_CASE("scene/transforms: a missing image is never replaced by another frame's own") {
  const TemporaryFolder folder;
  const auto views = [&](const std::string& frames) {
    put(folder.path() / "transforms.json", transforms_text(frames));
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    std::string names;
    for (const View& view : dataset->views)
      names += view.name + ">" + view.image_path.lexically_relative(folder.path()).generic_string() + " ";
    return names;
  };
  put_image(folder.path() / "images/a.png", 16, 12);
  put_image(folder.path() / "images_2/b.png", 8, 6);
  // Before and after the frame whose file it is; a name without its extension is a name all the same.
  CHECK(views(frame_text("images/a.PNG") + "," + frame_text("images/a.png")) == "images/a.png>images/a.png ");
  CHECK(views(frame_text("images/a.png") + "," + frame_text("images/a.PNG")) == "images/a.png>images/a.png ");
  CHECK(views(frame_text("images/a.PNG") + "," + frame_text("./images/a")) == "./images/a>images/a.png ");
  CHECK(views(frame_text("images/b.png") + "," + frame_text("images_2/b.png")) == "images_2/b.png>images_2/b.png ");
  // Nobody's: taken, as ever. One image named twice is one view of it.
  CHECK(views(frame_text("images/a.PNG")) == "images/a.PNG>images/a.png ");
  CHECK(views(frame_text("images/b.png")) == "images/b.png>images_2/b.png ");
  CHECK(views(frame_text("images/a") + "," + frame_text("images/a.png")) == "images/a>images/a.png ");
}

TEST_CASE("scene/transforms: a missing training image is not taken from the test images, nor the other way round") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  for (const bool test : {false, true}) {
    put(folder.path() / "transforms_train.json",
        transforms_text(frame_text("train/a") + (test ? "" : "," + frame_text("test/a.PNG"))));
    put(folder.path() / "transforms_test.json",
        transforms_text(frame_text("test/a") + (test ? "," + frame_text("train/a.PNG") : "")));
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    CHECK(dataset->indices(Split::train).size() == 1);
    CHECK(dataset->indices(Split::test).size() == 1);
  }
}

TEST_CASE("scene/transforms: pixels of images of which only smaller copies are there, with w and h missing") {
  // The file is for 16 x 12 with a focal length of 20 pixels; what is there has 8 x 6 in images_2.
  const TemporaryFolder folder;
  put_image(folder.path() / "images_2/a.png", 8, 6);
  const auto open = [&](const std::string& head) {
    put(folder.path() / "transforms.json", "{" + head + ", \"frames\": [" + frame_text("images/a.png") + "]}");
    return open_dataset(folder.path(), {});
  };
  const auto check = [&](const std::string& head, double focal, double center, const std::string& said) {
    CAPTURE(head);
    const Result<Dataset> dataset = open(head);
    REQUIRE(dataset.ok());
    const Camera<double>& camera = dataset->views[0].camera;
    CHECK(camera.width == 8);
    CHECK(camera.fx == doctest::Approx(focal).epsilon(1e-14));
    CHECK(camera.fy == doctest::Approx(focal).epsilon(1e-14));
    CHECK(camera.cx == doctest::Approx(center).epsilon(1e-14));
    std::string all;
    for (const std::string& warning : dataset->warnings) all += warning + "\n";
    CHECK((said.empty() ? all.find("8 x 6") == std::string::npos : all.find(said) != std::string::npos));
  };
  check(R"("fl_x": 20, "w": 16, "h": 12)", 10, 4, "cameras for 16 x 12");  // nothing to guess
  check(R"("fl_x": 20, "cx": 8.25, "cy": 6)", 10, 4.125, "taken to be for 16 x 12");
  check(R"("fl_x": 20, "cy": 5.5)", 10, 4, "taken to be for 16 x 12");
  check(R"("fl_x": 20, "w": 16)", 10, 4, "taken to be for 16 x 12");
  // An angle and a length together give the size: 2 * 20 tan(a / 2) = 16.
  check(R"("fl_x": 20, "camera_angle_x": 0.761)", 10, 4, "taken to be for 16 x 12");
  // The intrinsics of the copies themselves, under the name of the folder that is not there.
  check(R"("fl_x": 10, "cx": 4.125, "cy": 3)", 10, 4.125, "taken to be for 8 x 6");
  // Angles are the same at any size; the principal point beside them is not.
  check(R"("camera_angle_x": 0.761012822)", 4 / std::tan(0.380506411), 4, "");
  check(R"("camera_angle_x": 0.761012822, "cx": 8.25)", 4 / std::tan(0.380506411), 4.125, "taken to be for 16 x 12");
  // Nothing tells, or what there is disagrees: not guessed.
  for (const char* head : {R"("fl_x": 20)", R"("fl_x": 20, "cx": 8, "cy": 3)", R"("fl_x": 20, "cx": 5.7)",
                           R"("fl_x": 20, "cx": 30, "cy": 30)"}) {
    CAPTURE(head);
    const Result<Dataset> dataset = open(head);
    REQUIRE(!dataset.ok());
    CHECK(names(dataset.error(), "transforms.json", "w", "give w and h"));
  }
  // A file for images that are there counts their pixels, as ever.
  put_image(folder.path() / "images/a.png", 8, 6);
  check(R"("fl_x": 20)", 20, 4, "");
}

TEST_CASE("scene/transforms: bad input is named by file, field and remedy") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  const std::filesystem::path json = folder.path() / "transforms_train.json";
  const auto error = [&](const std::string& text) {
    put(json, text);
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(!dataset.ok());
    return dataset.error();
  };
  const std::string file = "transforms_train.json";
  CHECK(names(error(""), file, "", "create the dataset again"));
  CHECK(names(error("{\"frames\": ["), file, "", "correct it"));
  CHECK(names(error("{\"camera_angle_x\": 1e999, \"frames\": []}"), file, "", "correct it"));
  CHECK(names(error("[]"), file, "frames", "list of frames"));
  CHECK(names(error("{\"camera_angle_x\": 0.8}"), file, "frames", "list of frames"));
  CHECK(names(error(transforms_text("")), file, "frames", "at least one frame"));
  CHECK(names(error("{\"frames\": [" + frame_text("train/a") + "]}"), file, "camera_angle_x", "field of view"));
  CHECK(names(error("{\"camera_angle_x\": NaN, \"frames\": [" + frame_text("train/a") + "]}"), file, "camera_angle_x",
              "field of view"));
  CHECK(names(error("{\"camera_angle_x\": 4, \"frames\": [" + frame_text("train/a") + "]}"), file, "camera_angle_x",
              "field of view"));
  CHECK(names(error(transforms_text("{\"file_path\": \"train/a\"}")), file, "frames[0].transform_matrix",
              "correct the pose"));
  CHECK(names(error(transforms_text("{\"transform_matrix\": " + matrix_text() + "}")), file, "frames[0].file_path",
              "give the image"));
  CHECK(names(error(transforms_text(frame_text("train/a") + "," + frame_text("train/b", matrix_text("NaN")))), file,
              "frames[1].transform_matrix[0][0]", "correct the pose"));
  CHECK(names(error(transforms_text(frame_text("train/b", matrix_text("-Infinity")))), file,
              "frames[0].transform_matrix[0][0]", "correct the pose"));
  CHECK(names(error(transforms_text(frame_text("train/b", matrix_text("\"x\"")))), file,
              "frames[0].transform_matrix[0][0]", "correct the pose"));
  CHECK(names(error(transforms_text(frame_text("train/b", matrix_text("0")))), file, "frames[0].transform_matrix",
              "correct the pose"));
  CHECK(names(error(transforms_text(frame_text("train/b", "[[1,0,0],[0,1,0],[0,0,1]]"))), file, "transform_matrix[0]",
              "correct the pose"));
  CHECK(names(error(transforms_text(frame_text("train/b", "7"))), file, "frames[0].transform_matrix",
              "correct the pose"));
  CHECK(names(error(transforms_text(frame_text("train/missing"))), file, "frames[0].file_path", "add the image"));
  CHECK(error(transforms_text(frame_text("train/missing"))).kind == ErrorKind::not_found);
  put(folder.path() / "train/a.png", "not a picture");
  CHECK(names(error(transforms_text(frame_text("train/a"))), "a.png", "", "PNG or JPEG"));
  put(folder.path() / "train/a.png", "");
  CHECK(names(error(transforms_text(frame_text("train/a"))), "a.png", "", "copy it again"));
}

TEST_CASE("scene/transforms: a name with NaN in it is left alone") {
  const TemporaryFolder folder;
  put_blender(folder.path());
  put_image(folder.path() / "train/NaN \"inf\".png", 16, 12);
  put(folder.path() / "transforms_train.json", transforms_text(frame_text("train\\\\NaN \\\"inf\\\"")));
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(dataset->views[0].image_path.filename() == "NaN \"inf\".png");
}

TEST_CASE("scene/open: a folder that holds no dataset is named") {
  const TemporaryFolder folder;
  const auto error = [&](const std::filesystem::path& path, DatasetSettings settings = {}) {
    const Result<Dataset> dataset = open_dataset(path, settings);
    REQUIRE(!dataset.ok());
    return dataset.error();
  };
  CHECK(names(error(folder.path() / "nowhere"), "nowhere", "", "check the path"));
  CHECK(names(error(folder.path()), folder.path().string(), "", "check the path"));
  put(folder.path() / "note.txt", "x");
  CHECK(names(error(folder.path()), folder.path().string(), "", "contains one of them"));
  CHECK(names(error(folder.path() / "note.txt"), "note.txt", "", "give the folder"));
  put(folder.path() / "transforms.json", "{}");
  CHECK(names(error(folder.path()), "transforms.json", "frames", "list of frames"));
  put_blender(folder.path());
  DatasetSettings settings;
  settings.downscale = 0;
  CHECK(names(error(folder.path(), settings), folder.path().string(), "downscale", "use 1"));
}
