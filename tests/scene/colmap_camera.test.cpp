// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/colmap_camera.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

/// COLMAP's parameter lists, as its documentation of camera models has them (src/colmap/sensor/models.h).
struct Documented {
  int id;
  const char* parameters;
};
const std::vector<Documented> documented{{0, "f cx cy"},
                                         {1, "fx fy cx cy"},
                                         {2, "f cx cy k"},
                                         {3, "f cx cy k1 k2"},
                                         {4, "fx fy cx cy k1 k2 p1 p2"},
                                         {5, "fx fy cx cy k1 k2 k3 k4"},
                                         {6, "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"},
                                         {7, "fx fy cx cy omega"},
                                         {8, "f cx cy k"},
                                         {9, "f cx cy k1 k2"},
                                         {10, "fx fy cx cy k1 k2 p1 p2 k3 k4 sx1 sy1"},
                                         {11, "fx fy cx cy k0 k1 k2 k3 k4 k5 p0 p1 s0 s1 s2 s3"},
                                         {12, "f cx cy k"},
                                         {13, "fx fy cx cy k"},
                                         {14, "f cx cy"},
                                         {15, "fx fy cx cy"},
                                         {16, "fx fy cx cy alpha beta"}};

std::vector<std::string> words(const std::string& text) {
  std::vector<std::string> result{""};
  for (const char c : text) {
    if (c == ' ') {
      result.emplace_back();
    } else {
      result.back() += c;
    }
  }
  return result;
}

}  // namespace

TEST_CASE("scene/colmap_camera: each model's parameters go where its documentation says") {
  REQUIRE(documented.size() == lens_model_count);
  for (const Documented& model : documented) {
    CAPTURE(model.id);
    const std::vector<std::string> names = words(model.parameters);
    REQUIRE(colmap_models[static_cast<std::size_t>(model.id)].parameters == names.size());
    ColmapCamera camera{model.id, 640, 480, {}};
    camera.parameters.fill(77);  // what a model does not have must not be looked at
    Camera<double> expected;
    Lens lens{static_cast<LensModel>(model.id), {}};
    std::size_t distortion = 0;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const double value =
          names[i][0] == 'f' || names[i][0] == 'c' ? 300 + static_cast<double>(i) : 0.01 * static_cast<double>(i);
      camera.parameters[i] = value;
      if (names[i] == "f") expected.fx = expected.fy = value;
      if (names[i] == "fx") expected.fx = value;
      if (names[i] == "fy") expected.fy = value;
      if (names[i] == "cx") expected.cx = value;
      if (names[i] == "cy") expected.cy = value;
      if (names[i][0] != 'f' && names[i][0] != 'c') lens.parameters[distortion++] = value;
    }
    const Result<detail::ColmapIntrinsics> read = detail::colmap_intrinsics(camera, 5, "cameras.bin");
    REQUIRE(read.ok());
    CHECK(read->camera.width == 640);
    CHECK(read->camera.height == 480);
    CHECK(read->camera.fx == expected.fx);
    CHECK(read->camera.fy == expected.fy);
    CHECK(read->camera.cx == expected.cx);
    CHECK(read->camera.cy == expected.cy);
    CHECK(read->lens == (model.id < 2 ? Lens{} : lens));
  }
}

TEST_CASE("scene/colmap_camera: coefficients of zero are a pinhole, but an equidistant lens is none") {
  for (const Documented& model : documented) {
    CAPTURE(model.id);
    ColmapCamera camera{model.id, 640, 480, {500, 500, 240, 240}};
    if (model.id == 16) camera.parameters[5] = 1;  // EUCM's beta is of no meaning without alpha, but cannot be zero
    const Result<detail::ColmapIntrinsics> read = detail::colmap_intrinsics(camera, 1, "cameras.txt");
    REQUIRE(read.ok());
    const bool fisheye = model.id == 5 || (model.id >= 8 && model.id <= 11) || model.id == 14 || model.id == 15;
    // With three intrinsics the fourth number is k.
    const bool three = lens_intrinsics(static_cast<LensModel>(model.id)) == 3 && model.id != 0 && model.id != 14;
    CHECK((read->lens == Lens{}) == (!fisheye && !three));
  }
}

TEST_CASE("scene/colmap_camera: what no camera has is refused with its number and the model's name") {
  const auto refused = [](const ColmapCamera& camera, ErrorKind kind, const std::string& problem) {
    const Result<detail::ColmapIntrinsics> read = detail::colmap_intrinsics(camera, 7, "cameras.bin");
    REQUIRE(!read.ok());
    CAPTURE(read.error().line());
    CHECK(read.error().kind == kind);
    CHECK(read.error().field == "camera 7");
    CHECK(!read.error().remedy.empty());
    CHECK(read.error().problem.find(problem) != std::string::npos);
  };
  const ColmapCamera good{1, 640, 480, {500, 510, 320, 240}};
  const auto with = [&](auto change) {
    ColmapCamera camera = good;
    change(camera);
    return camera;
  };
  REQUIRE(detail::colmap_intrinsics(good, 7, "").ok());
  refused(with([](ColmapCamera& c) { c.model = 17; }), ErrorKind::unsupported, "EQUIRECTANGULAR");
  refused(with([](ColmapCamera& c) { c.model = 18; }), ErrorKind::unsupported, "18");
  refused(with([](ColmapCamera& c) { c.model = -1; }), ErrorKind::unsupported, "-1");
  refused(with([](ColmapCamera& c) { c.width = 0; }), ErrorKind::invalid, "0 x 480");
  refused(with([](ColmapCamera& c) { c.height = std::uint64_t{1} << 63; }), ErrorKind::invalid, "9223372036854775808");
  refused(with([](ColmapCamera& c) { c.width = 65537; }), ErrorKind::invalid, "65537");
  refused(with([](ColmapCamera& c) { c.parameters[0] = 0; }), ErrorKind::invalid, "focal");
  refused(with([](ColmapCamera& c) { c.parameters[1] = -510; }), ErrorKind::invalid, "focal");
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    refused(with([&](ColmapCamera& c) { c.parameters[3] = bad; }), ErrorKind::invalid, "not finite");
  const auto lens = [&](int model, double first, double second) {
    return with([&](ColmapCamera& c) {
      c.model = model;
      c.parameters[4] = first;
      c.parameters[5] = second;
    });
  };
  refused(lens(7, 3.2, 0), ErrorKind::invalid, "distortion");  // a field of view beyond the half circle
  refused(lens(16, -0.1, 1), ErrorKind::invalid, "distortion");
  refused(lens(16, 1.1, 1), ErrorKind::invalid, "distortion");
  refused(lens(16, 0.5, 0), ErrorKind::invalid, "distortion");
  CHECK(detail::colmap_intrinsics(lens(16, 1, 1), 7, "").ok());
  CHECK(detail::colmap_intrinsics(lens(7, -3.1, 0), 7, "").ok());
}

TEST_CASE("scene/colmap_camera: images are counted without believing the count") {
  const TemporaryFolder folder;
  const ColmapModel model = small_colmap_model();
  put_colmap_binary(folder.path() / "binary", model);
  put_colmap_text(folder.path() / "text", model);
  CHECK(detail::registered_images(folder.path() / "binary") == 9);
  CHECK(detail::registered_images(folder.path() / "text") == 9);
  CHECK(detail::registered_images(folder.path() / "nowhere") == 0);
  put(folder.path() / "binary/images.bin", Bytes().add(std::uint64_t{1} << 60).add(0.0).text());
  CHECK(detail::registered_images(folder.path() / "binary") == 0);
  put(folder.path() / "binary/images.bin", "1234567");
  CHECK(detail::registered_images(folder.path() / "binary") == 0);
  // 73 bytes are the least that an image takes: id, pose, camera, an empty name, no features.
  put(folder.path() / "binary/images.bin", Bytes().add(std::uint64_t{1}).text() + std::string(72, '\0'));
  CHECK(detail::registered_images(folder.path() / "binary") == 1);
}

TEST_CASE("scene/colmap_camera: where the model is looked for, in which order, and that damaged parts lose") {
  const TemporaryFolder folder;
  const std::filesystem::path& root = folder.path();
  const ColmapModel model = small_colmap_model();
  ColmapModel two = model;
  while (two.images.size() > 2) two.images.erase(two.images.begin());
  CHECK(detail::find_colmap_folder(root).path.empty());
  put_colmap_text(root, model);
  CHECK(detail::find_colmap_folder(root).path == root);
  put_colmap_text(root / "sparse", two);
  CHECK(detail::find_colmap_folder(root).path == root / "sparse");  // beside the root's own files
  put_colmap_binary(root / "sparse/3", two);
  CHECK(detail::find_colmap_folder(root).path == root / "sparse/3");
  CHECK(detail::find_colmap_folder(root).images == 2);
  CHECK(detail::find_colmap_folder(root).others ==
        std::vector<std::pair<std::string, std::uint64_t>>{{"that of sparse", 2}, {"the one in the folder itself", 9}});
  // The first of equals; text counts like binary; a larger one wins wherever it stands.
  put_colmap_text(root / "sparse/1", two);
  CHECK(detail::find_colmap_folder(root).path == root / "sparse/1");
  put_colmap_binary(root / "sparse/9", model);
  const detail::ColmapFolder found = detail::find_colmap_folder(root);
  CHECK(found.path == root / "sparse/9");
  CHECK(found.images == 9);
  REQUIRE(found.others.size() == 4);
  for (const char* name : {"1", "3"}) {
    CHECK(std::count(found.others.begin(), found.others.end(), std::pair<std::string, std::uint64_t>(name, 2)) == 1);
  }
  put(root / "sparse/9/images.bin", Bytes().add(std::uint64_t{1} << 60).text());
  CHECK(detail::find_colmap_folder(root).path == root / "sparse/1");
}
