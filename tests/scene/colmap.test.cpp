// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/extent.hpp>
#include <compmark/scene/open.hpp>

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

TEST_CASE("scene/colmap: text and binary files of one model give one model") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  put_colmap_text(folder.path() / "text", model);
  put_colmap_binary(folder.path() / "binary", model);
  for (const char* name : {"text", "binary"}) {
    CAPTURE(name);
    const Result<ColmapModel> read = read_colmap_model(folder.path() / name, {true});
    REQUIRE(read.ok());
    REQUIRE(read->images.size() == 9);
    REQUIRE(read->cameras.size() == 2);
    REQUIRE(read->points.size() == 2);
    for (const auto& [id, camera] : model.cameras) {
      CHECK(read->cameras.at(id).model == camera.model);
      CHECK(read->cameras.at(id).width == camera.width);
      CHECK(read->cameras.at(id).parameters == camera.parameters);
    }
    for (const auto& [id, image] : model.images) {
      const ColmapImage& other = read->images.at(id);
      CHECK(other.name == image.name);
      CHECK(other.rotation_wxyz == image.rotation_wxyz);
      CHECK(other.translation == image.translation);
      CHECK(other.camera_id == image.camera_id);
      REQUIRE(other.observations.size() == image.observations.size());
      for (std::size_t i = 0; i < image.observations.size(); ++i) {
        CHECK(other.observations[i].x == image.observations[i].x);
        CHECK(other.observations[i].point_id == image.observations[i].point_id);
      }
    }
    CHECK(read->points.at(11).position == model.points.at(11).position);
    CHECK(read->points.at(500).color == model.points.at(500).color);
  }
}

TEST_CASE("scene/colmap: views, split, intrinsics and points") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  put_colmap_binary(folder.path() / "sparse/0", model);
  put_colmap_images(folder.path() / "images", model);
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(dataset->kind == "colmap");
  CHECK(dataset->warnings.empty());
  REQUIRE(dataset->views.size() == 9);
  // Sorted: view0, view1, view2, view3, view5 … view8, "with space"; every 8th from the first is a test view.
  CHECK(dataset->views[0].name == "view0.png");
  CHECK(dataset->views[8].name == "with space.png");
  CHECK(dataset->indices(Split::test) == std::vector<std::size_t>{0, 8});
  CHECK(dataset->views[0].camera.fy == 21);
  CHECK(dataset->views[0].camera.cx == 8.25);
  CHECK(dataset->views[1].camera.fx == 18);  // a camera of its own
  // COLMAP: x_camera = R x + t. Rotation about y by 0.3 (view3: half angle 0.15), t = (0.3, -0.2, 4): a point by hand.
  const Camera<double>& camera = dataset->views[3].camera;
  const double c = std::cos(0.3);
  const double s = std::sin(0.3);
  const std::array<double, 3> point{0.5, -0.25, 1};
  const std::array<double, 3> expected{c * point[0] + s * point[2] + 0.3, point[1] - 0.2,
                                       -s * point[0] + c * point[2] + 4};
  for (std::size_t i = 0; i < 3; ++i) {
    double value = 0;
    for (std::size_t j = 0; j < 3; ++j)
      value += camera.rotation_camera_world[3 * i + j] * (point[j] - camera.center_world[j]);
    CHECK(value == doctest::Approx(expected[i]).epsilon(1e-13));
  }
  CHECK(detail::determinant(camera.rotation_camera_world) == doctest::Approx(1.0).epsilon(1e-14));
  REQUIRE(dataset->points.size() == 2);
  CHECK(dataset->points.color[0] == std::array<std::uint8_t, 3>{10, 20, 255});
  DatasetSettings all;
  all.test_every = 0;
  CHECK(open_dataset(folder.path(), all)->indices(Split::test).empty());
}

TEST_CASE(
    "scene/colmap: the model may lie in sparse/0, sparse or the folder, and files may be smaller than the cameras") {
  const ColmapModel model = small_colmap_model();
  for (const char* place : {"sparse/0", "sparse", "."}) {
    CAPTURE(place);
    const TemporaryFolder folder;
    put_colmap_text(folder.path() / place, model);
    put_colmap_images(folder.path() / "images_2", model, 8, 6);
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    CHECK(dataset->views[0].camera.width == 8);
    CHECK(dataset->views[0].camera.fx == 10);
    CHECK(dataset->views[0].camera.fy == 10.5);
    CHECK(dataset->views[0].camera.cx == 4.125);
    REQUIRE(dataset->warnings.size() == 1);
    CHECK(dataset->warnings[0].find("16 x 12") != std::string::npos);
  }
}

TEST_CASE("scene/colmap: renamed files are paired in sorted order, with a word") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  put_colmap_binary(folder.path() / "sparse/0", model);
  for (int i = 0; i < 9; ++i) put_image(folder.path() / ("images/image00" + std::to_string(i) + ".png"), 16, 12);
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(dataset->views[8].name == "with space.png");
  CHECK(dataset->views[8].image_path.filename() == "image008.png");
  CHECK(dataset->warnings.size() == 1);
}

TEST_CASE(
    "scene/colmap: a lens that moves no pixel by a quarter is a pinhole; what becomes of a stronger one is said") {
  const TemporaryFolder folder;
  ColmapModel model = small_colmap_model();
  put_colmap_images(folder.path() / "images", model);
  // f = 20, corner at (8, 6): r = 0.5, displacement = f k r^3 = 2.5 k.
  for (const double k : {0.08, 0.2}) {
    for (auto& [id, camera] : model.cameras) camera = {2, 16, 12, {20, 8, 6, k}};
    put_colmap_binary(folder.path() / "sparse/0", model);
    for (const LensTreatment treatment : {LensTreatment::undistort, LensTreatment::ignore, LensTreatment::keep}) {
      DatasetSettings settings;
      settings.lens = treatment;
      const Result<Dataset> dataset = open_dataset(folder.path(), settings);
      REQUIRE(dataset.ok());
      REQUIRE(dataset->warnings.size() == 1);
      const std::string expected = treatment == LensTreatment::ignore ? "it is ignored"
                                   : treatment == LensTreatment::keep ? "images keep it"
                                   : k < 0.1                          ? "it is treated as a pinhole"
                                                                      : "it is taken out";
      CHECK(dataset->warnings[0].find((k < 0.1 ? "0.20; " : "0.50; ") + expected) != std::string::npos);
      const View& view = dataset->views[0];
      CHECK(view.camera.fy == 20);
      CHECK(view.lens == Lens{LensModel::simple_radial, {k}});
      CHECK(view.lens_treatment ==
            (treatment == LensTreatment::undistort && k < 0.1 ? LensTreatment::ignore : treatment));
    }
  }
}

TEST_CASE("scene/colmap: bad input is named by file, field and remedy") {
  const TemporaryFolder folder;
  const std::filesystem::path sparse = folder.path() / "sparse/0";
  ColmapModel model = small_colmap_model();
  put_colmap_images(folder.path() / "images", model);
  const auto error = [&] {
    put_colmap_binary(sparse, model);
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(!dataset.ok());
    return dataset.error();
  };
  SUBCASE("lens model") {
    model.cameras[3].model = 17;
    CHECK(names(error(), "cameras.bin", "camera 3", "perspective views"));
    CHECK(error().problem.find("EQUIRECTANGULAR") != std::string::npos);
    model.cameras[3] = {16, 16, 12, {20, 20, 8, 6, 1.5, 1}};  // EUCM with alpha above 1
    CHECK(names(error(), "cameras.bin", "camera 3", "export"));
  }
  SUBCASE("focal length") {
    model.cameras[3].parameters[0] = -1;
    CHECK(names(error(), "cameras.bin", "camera 3", "export"));
    model.cameras[3].parameters[0] = std::numeric_limits<double>::quiet_NaN();
    CHECK(names(error(), "cameras.bin", "camera 3", "export"));
  }
  SUBCASE("pose") {
    model.images[13].rotation_wxyz = {0, 0, 0, 0};
    CHECK(names(error(), "images.bin", "view1.png", "image_deleter"));
    model.images[13].rotation_wxyz = {1, 0, 0, 0};
    model.images[13].translation[1] = std::numeric_limits<double>::quiet_NaN();
    CHECK(names(error(), "images.bin", "view1.png", "image_deleter"));
  }
  SUBCASE("camera reference") {
    model.images[13].camera_id = 99;
    CHECK(names(error(), "images.bin", "view1.png", "export"));
  }
  SUBCASE("no images in the model") {
    model.images.clear();
    CHECK(names(error(), "images.bin", "images", "mapper"));
  }
  SUBCASE("no image is there") {
    for (int i = 0; i < 9; ++i) std::filesystem::remove(folder.path() / ("images/view" + std::to_string(i) + ".png"));
    std::filesystem::rename(folder.path() / "images/with space.png", folder.path() / "images/other.png");
    CHECK(names(error(), "images", "view0.png", "add the images"));
  }
  SUBCASE("no image at all") {
    std::filesystem::remove_all(folder.path() / "images");
    CHECK(names(error(), folder.path().string(), "images", "put the photographs"));
    std::filesystem::create_directories(folder.path() / "images");
    CHECK(names(error(), "images", "images", "put the photographs"));
  }
  SUBCASE("the model's folder in place of the capture") {
    put_colmap_binary(sparse, model);
    for (const char* inner : {"sparse/0", "sparse"}) {
      const Result<Dataset> dataset = open_dataset(folder.path() / inner, {});
      REQUIRE(!dataset.ok());
      CHECK(names(dataset.error(), inner, "", "give "));
      CHECK(dataset.error().remedy.find(std::filesystem::canonical(folder.path()).string() + ",") != std::string::npos);
    }
    // Photographs that are elsewhere, by a link, are as good; a model that has its own is a capture.
    const std::filesystem::path elsewhere = folder.path().string() + "_photographs";
    std::filesystem::rename(folder.path() / "images", elsewhere);
    std::filesystem::create_directory_symlink(elsewhere, folder.path() / "images");
    const Result<Dataset> linked = open_dataset(sparse, {});
    REQUIRE(!linked.ok());
    CHECK(names(linked.error(), "sparse/0", "", "give "));
    std::filesystem::create_directory_symlink(elsewhere, sparse / "images");
    CHECK(open_dataset(sparse, {}).ok());
    std::filesystem::remove(sparse / "images");
    std::filesystem::remove_all(elsewhere);
    std::filesystem::remove(folder.path() / "images");  // nobody has them: they are to be put somewhere
    const Result<Dataset> nowhere = open_dataset(sparse, {});
    REQUIRE(!nowhere.ok());
    CHECK(names(nowhere.error(), "sparse/0", "images", "put the photographs"));
  }
  SUBCASE("wrong proportions") {
    put_image(folder.path() / "images/view2.png", 12, 16);
    CHECK(names(error(), "view2.png", "image size", "neither cropped nor rotated"));
  }
}

TEST_CASE("scene/colmap: scaled copies fit their camera if one side is rounded to a pixel, upright or across") {
  const auto opens = [](std::array<int, 2> camera, std::array<int, 2> image, bool upright) {
    if (upright) {
      std::swap(camera[0], camera[1]);
      std::swap(image[0], image[1]);
    }
    CAPTURE(camera[0]);
    CAPTURE(camera[1]);
    CAPTURE(image[0]);
    CAPTURE(image[1]);
    const TemporaryFolder folder;
    ColmapModel model = small_colmap_model();
    for (auto& [id, of] : model.cameras) {
      const double w = camera[0], h = camera[1], f = w + h;
      of = {1, static_cast<std::uint64_t>(camera[0]), static_cast<std::uint64_t>(camera[1]), {f, f, w / 2, h / 2}};
    }
    put_colmap_binary(folder.path() / "sparse/0", model);
    put_colmap_images(folder.path() / "images", model, image[0], image[1]);
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    if (!dataset.ok()) CHECK(names(dataset.error(), "view0.png", "image size", "neither cropped nor rotated"));
    if (dataset.ok()) {
      CHECK(dataset->views[0].camera.width == image[0]);
      CHECK(dataset->views[0].camera.height == image[1]);
    }
    return dataset.ok();
  };
  for (const bool upright : {false, true}) {
    CAPTURE(upright);
    CHECK(opens({1448, 1087}, {181, 135}, upright));  // a phone's picture and an eighth of it, floored
    CHECK(opens({1448, 1087}, {181, 136}, upright));
    CHECK(opens({600, 400}, {100, 67}, upright));
    CHECK(opens({100, 67}, {600, 400}, upright));  // the camera is for the smaller ones
    // Two pixels are no rounding, nor are sides that were exchanged.
    CHECK_FALSE(opens({1448, 1087}, {181, 138}, upright));
    CHECK_FALSE(opens({1448, 1087}, {181, 134}, upright));
    CHECK_FALSE(opens({1448, 1087}, {179, 136}, upright));
    CHECK_FALSE(opens({100, 67}, {600, 414}, upright));
    CHECK_FALSE(opens({100, 67}, {67, 100}, upright));
  }
}

TEST_CASE("scene/colmap: images that are missing are counted and left out") {
  const TemporaryFolder folder;
  ColmapModel model = small_colmap_model();
  put_colmap_binary(folder.path() / "sparse/0", model);
  put_colmap_images(folder.path() / "images", model);
  std::filesystem::remove(folder.path() / "images/view5.png");
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(dataset->views.size() == 8);
  REQUIRE(dataset->warnings.size() == 1);
  CHECK(dataset->warnings[0].find("1 of 9 images are missing and left out, the first is \"view5.png\"") !=
        std::string::npos);
}

TEST_CASE("scene/colmap: without usable points random ones are drawn around what the cameras look at") {
  const TemporaryFolder folder;
  ColmapModel model = small_colmap_model();
  put_colmap_images(folder.path() / "images", model);
  for (const bool not_finite : {false, true}) {
    model.points.clear();
    if (not_finite) model.points[1] = {{std::numeric_limits<double>::quiet_NaN(), 0, 0}, {0, 0, 0}};
    put_colmap_binary(folder.path() / "sparse/0", model);
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    CHECK(dataset->points_are_random);
    CHECK(dataset->points.size() == 10000);
    CHECK(dataset->warnings.size() == (not_finite ? 2 : 1));
  }
}

TEST_CASE("scene/colmap: a model without its file of points starts from random ones, or from points3D.ply") {
  const ColmapModel model = small_colmap_model();
  for (const bool binary : {true, false}) {
    CAPTURE(binary);
    const TemporaryFolder folder;
    const std::filesystem::path sparse = folder.path() / "sparse/0";
    put_colmap_images(folder.path() / "images", model);
    binary ? put_colmap_binary(sparse, model) : put_colmap_text(sparse, model);
    const std::string file = binary ? "points3D.bin" : "points3D.txt";
    std::filesystem::remove(sparse / file);
    CHECK(read_colmap_model(sparse, {true})->points.empty());
    const Result<Dataset> dataset = open_dataset(folder.path(), {});
    REQUIRE(dataset.ok());
    CHECK(dataset->views.size() == 9);
    CHECK(dataset->points_are_random);
    CHECK(dataset->points.size() == 10000);
    REQUIRE(dataset->warnings.size() == 2);
    CHECK(dataset->warnings[0].find(file + ": is not there") != std::string::npos);
    CHECK(dataset->warnings[1].find("random ones are used") != std::string::npos);
    put(sparse / "points3D.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nproperty uchar "
        "red\nproperty uchar green\nproperty uchar blue\nend_header\n1 2 3 4 5 6\n");
    const Result<Dataset> copied = open_dataset(folder.path(), {});
    REQUIRE(copied.ok());
    CHECK(!copied->points_are_random);
    REQUIRE(copied->points.size() == 1);
    CHECK(copied->points.color[0] == std::array<std::uint8_t, 3>{4, 5, 6});
    REQUIRE(copied->warnings.size() == 1);
    CHECK(copied->warnings[0].find("taken from points3D.ply") != std::string::npos);
  }
}

TEST_CASE("scene/colmap: files whose extension has other capitals than the model's are found, exact names first") {
  const TemporaryFolder folder;
  ColmapModel model = small_colmap_model();
  put_colmap_images(folder.path() / "images", model);
  model.images[10].name = "view0.PNG";   // on the disk: view0.png
  model.images[13].name = "other.jpeg";  // not there, in any capitals
  model.images[25].name = "view6.PNG";   // not there either: view6.png is another image of the model
  put_colmap_binary(folder.path() / "sparse/0", model);
  put_image(folder.path() / "images/view2.PNG", 16, 12);  // beside view2.png, which is the one
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  REQUIRE(dataset->views.size() == 7);
  CHECK(dataset->views[0].name == "view0.PNG");
  CHECK(dataset->views[0].image_path == folder.path() / "images/view0.png");
  CHECK(dataset->views[1].image_path == folder.path() / "images/view2.png");
  REQUIRE(dataset->warnings.size() == 1);
  CHECK(dataset->warnings[0].find("2 of 9 images are missing") != std::string::npos);
}

TEST_CASE("scene/colmap: the largest sub-model is taken and the others are named") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  ColmapModel small = model;
  while (small.images.size() > 2) small.images.erase(small.images.begin());
  put_colmap_images(folder.path() / "images", model);
  put_colmap_binary(folder.path() / "sparse/0", small);
  put_colmap_text(folder.path() / "sparse/1", model);
  put_colmap_binary(folder.path() / "sparse/10", small);
  // Files of rigs and frames, of any content, are of no concern; nor is a folder without a model.
  put(folder.path() / "sparse/1/rigs.txt", "1 1 CAMERA 1");
  put(folder.path() / "sparse/1/frames.bin", "x");
  put(folder.path() / "sparse/2/notes.txt", "x");
  const Result<Dataset> dataset = open_dataset(folder.path(), {});
  REQUIRE(dataset.ok());
  CHECK(dataset->views.size() == 9);
  REQUIRE(dataset->warnings.size() == 1);
  CHECK(dataset->warnings[0].find("sparse/1: the largest sub-model, with 9 images, is used; left out: 0 with 2 10 with "
                                  "2") != std::string::npos);
}

TEST_CASE("scene/colmap_binary: a file cut anywhere is an error, and no count is believed") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  put_colmap_binary(folder.path(), model);
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
    const Result<std::vector<std::byte>> bytes = read_file(folder.path() / name);
    REQUIRE(bytes.ok());
    for (std::size_t length = 0; length < bytes->size(); ++length) {
      CAPTURE(length);
      REQUIRE(write_file(folder.path() / name, std::span<const std::byte>(*bytes).first(length)).ok());
      const Result<ColmapModel> read = read_colmap_binary(folder.path());
      REQUIRE(!read.ok());
      CHECK(read.error().kind == ErrorKind::truncated);
      CHECK(names(read.error(), name, "", "copy the file again"));
    }
    for (const std::size_t place :
         {std::size_t{0}, bytes->size() - 9}) {  // the count of records; bytes inside the last record
      std::vector<std::byte> damaged = *bytes;
      for (std::size_t i = 0; i < 8; ++i) damaged[place + i] = std::byte{0xFF};
      REQUIRE(write_file(folder.path() / name, std::span<const std::byte>(damaged)).ok());
      static_cast<void>(read_colmap_binary(folder.path()));  // any answer, but no crash and no huge allocation
      if (place == 0) CHECK(!read_colmap_binary(folder.path()).ok());
    }
    REQUIRE(write_file(folder.path() / name, std::span<const std::byte>(*bytes)).ok());
  }
}

TEST_CASE("scene/colmap_text: a bad line is named") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  const auto error = [&](const char* name, const std::string& text) {
    put_colmap_text(folder.path(), model);
    put(folder.path() / name, text);
    const Result<ColmapModel> read = read_colmap_text(folder.path(), {true});
    REQUIRE(!read.ok());
    return read.error();
  };
  CHECK(names(error("cameras.txt", "# c\n1 PINHOLE 16 12 20 21 8\n"), "cameras.txt", "line 2", "export"));
  CHECK(names(error("cameras.txt", "1 WIDE 16 12 20 21 8\n"), "cameras.txt", "line 1", "image_undistorter"));
  CHECK(names(error("images.txt", "1 1 0 0 0 0 0 4 3\n\n"), "images.txt", "line 1", "export"));
  CHECK(names(error("images.txt", "1 1 0 0 0 0 x 4 3 a.png\n\n"), "images.txt", "line 1", "export"));
  CHECK(names(error("images.txt", "1 1 0 0 0 0 0 4 3 a.png\n1 2\n"), "images.txt", "line 2", "export"));
  CHECK(names(error("points3D.txt", "1 0 0 0 256 0 0 0.1\n"), "points3D.txt", "line 1", "export"));
}

TEST_CASE("scene/extent: mean and 1.1 times the largest distance, of training cameras only") {
  Dataset dataset;
  for (const double x : {0.0, 2.0, 4.0, 1000.0}) {
    View view;
    view.camera.center_world = {x, 1e6, 0};
    view.split = x > 100 ? Split::test : Split::train;
    dataset.views.push_back(view);
  }
  const SceneExtent extent = scene_extent(dataset);
  CHECK(extent.center == std::array<double, 3>{2, 1e6, 0});
  CHECK(extent.radius == doctest::Approx(2.2).epsilon(1e-15));
  CHECK(scene_extent({}).radius == 0);
}
