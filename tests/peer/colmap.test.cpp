// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// COLMAP itself as a peer: what its model_converter makes of a model, text or binary, reads as the same model. Label
// peer; without the program the tests say so and are skipped.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/scene/open.hpp>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <initializer_list>
#include <string>

#include "support/data.hpp"
#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

namespace fs = std::filesystem;

bool colmap_is_there() {
  const bool there = std::system("command -v colmap >/dev/null 2>&1") == 0;
  if (!there) MESSAGE("skipped: no colmap (install the package colmap)");
  return there;
}

/// model_converter, quietly; the folder is made.
void convert(const fs::path& from, const fs::path& to, const std::string& type) {
  fs::create_directories(to);
  const std::string command = "QT_QPA_PLATFORM=offscreen colmap model_converter --input_path '" + from.string() +
                              "' --output_path '" + to.string() + "' --output_type " + type + " >/dev/null 2>&1";
  CAPTURE(command);
  REQUIRE(std::system(command.c_str()) == 0);
}

ColmapModel read(const fs::path& folder, bool binary) {
  CHECK(detail::has_binary(folder) == binary);
  const Result<ColmapModel> model = read_colmap_model(folder, {true});
  if (!model) MESSAGE(model.error().line());
  REQUIRE(model.ok());
  return *model;
}

/// How many numbers differ in any bit; -1 where the structure differs. Rotations are compared with `ulps` in units of
/// the last place of 1: COLMAP normalises quaternions again when it reads them.
long differences(const ColmapModel& a, const ColmapModel& b, double ulps) {
  long different = 0;
  const auto compare = [&](double x, double y) { different += x == y ? 0 : 1; };
  if (a.cameras.size() != b.cameras.size() || a.images.size() != b.images.size() || a.points.size() != b.points.size())
    return -1;
  for (const auto& [id, camera] : a.cameras) {
    if (b.cameras.count(id) == 0) return -1;
    const ColmapCamera& other = b.cameras.at(id);
    if (camera.model != other.model || camera.width != other.width || camera.height != other.height) return -1;
    const std::size_t count = colmap_models[static_cast<std::size_t>(camera.model)].parameters;
    for (std::size_t i = 0; i < count; ++i) compare(camera.parameters[i], other.parameters[i]);
  }
  for (const auto& [id, image] : a.images) {
    if (b.images.count(id) == 0) return -1;
    const ColmapImage& other = b.images.at(id);
    if (image.name != other.name || image.camera_id != other.camera_id ||
        image.observations.size() != other.observations.size())
      return -1;
    for (std::size_t i = 0; i < 3; ++i) compare(image.translation[i], other.translation[i]);
    for (std::size_t i = 0; i < 4; ++i)
      different += std::abs(image.rotation_wxyz[i] - other.rotation_wxyz[i]) <= ulps * 0x1p-53 ? 0 : 1;
    for (std::size_t i = 0; i < image.observations.size(); ++i) {
      compare(image.observations[i].x, other.observations[i].x);
      compare(image.observations[i].y, other.observations[i].y);
      if (image.observations[i].point_id != other.observations[i].point_id) return -1;
    }
  }
  for (const auto& [id, point] : a.points) {
    if (b.points.count(id) == 0) return -1;
    for (std::size_t i = 0; i < 3; ++i) compare(point.position[i], b.points.at(id).position[i]);
    if (point.color != b.points.at(id).color) return -1;
  }
  return different;
}

/// Binary files with a camera of each model that COLMAP 3.8 knows, an image for each, and points that all of them see:
/// tracks and features name each other, as COLMAP insists.
void put_model_of_every_camera(const fs::path& folder) {
  constexpr std::uint32_t models = 11;
  constexpr std::uint64_t points = 3;
  Bytes cameras, images, cloud;
  cameras.add(std::uint64_t{models});
  images.add(std::uint64_t{models});
  cloud.add(points);
  for (std::uint32_t m = 0; m < models; ++m) {
    cameras.add(m + 4).add(static_cast<std::int32_t>(m)).add(std::uint64_t{640 + m}).add(std::uint64_t{480});
    const std::size_t intrinsics = lens_intrinsics(static_cast<LensModel>(m));
    for (std::size_t i = 0; i < colmap_models[m].parameters; ++i)
      cameras.add(i < intrinsics ? 300 + 0.1 * static_cast<double>(i) : 0.001 * static_cast<double>(i) / 3);
    images.add(3 * m + 2);
    // Rotations whose quaternions are exact, so that normalising them again changes nothing.
    const std::array<double, 4> quaternion =
        m % 2 == 0 ? std::array<double, 4>{1, 0, 0, 0} : std::array<double, 4>{0.5, -0.5, m % 3 == 0 ? 0.5 : -0.5, 0.5};
    for (const double q : quaternion) images.add(q);
    for (const double t : {0.1 * m, -1.0 / 3, 1e-7 * m + 4}) images.add(t);
    images.add(m + 4).add_string("folder/image" + std::to_string(m) + ".jpg").add(points + 1);
    for (std::uint64_t p = 0; p < points; ++p)
      images.add(10.0 / 3 + m).add(20.1 * static_cast<double>(p + 1)).add(7 * p + 5);
    images.add(1.5).add(2.5).add(~std::uint64_t{0});
  }
  for (std::uint64_t p = 0; p < points; ++p) {
    cloud.add(7 * p + 5);
    for (const double x : {0.1 * static_cast<double>(p), -2.0 / 3, 1e6 + 1e-6 * static_cast<double>(p)}) cloud.add(x);
    for (const int c : {0, 128, 255}) cloud.add(static_cast<std::uint8_t>(c));
    cloud.add(0.7).add(std::uint64_t{models});
    for (std::uint32_t m = 0; m < models; ++m) cloud.add(3 * m + 2).add(static_cast<std::uint32_t>(p));
  }
  put(folder / "cameras.bin", cameras.text());
  put(folder / "images.bin", images.text());
  put(folder / "points3D.bin", cloud.text());
}

}  // namespace

TEST_CASE("peer/colmap: a model with every camera, through COLMAP to text and back, is the same model to the bit") {
  if (!colmap_is_there()) return;
  const TemporaryFolder folder;
  put_model_of_every_camera(folder.path() / "ours");
  convert(folder.path() / "ours", folder.path() / "text", "TXT");
  convert(folder.path() / "text", folder.path() / "binary", "BIN");
  const ColmapModel ours = read(folder.path() / "ours", true), text = read(folder.path() / "text", false),
                    binary = read(folder.path() / "binary", true);
  CHECK(ours.cameras.size() == 11);
  CHECK(ours.images.at(2).observations.size() == 4);
  CHECK(differences(ours, text, 0) == 0);
  CHECK(differences(ours, binary, 0) == 0);
  // The control: one bit of one number is noticed.
  ColmapModel other = ours;
  other.cameras.at(8).parameters[5] = std::nextafter(other.cameras.at(8).parameters[5], 1.0);
  CHECK(differences(ours, other, 0) == 1);
}

TEST_CASE("peer/colmap: real models read alike as binary, as COLMAP's text of it and as its binary of that text") {
  if (!colmap_is_there()) return;
  const auto data = data_dir();
  if (!data) {
    MESSAGE("skipped: no real data (set COMPMARK_DATA_DIR)");
    return;
  }
  for (const std::string scene : {"colmap_king", "colmap_cup", "colmap_gerrard_hall"}) {
    CAPTURE(scene);
    fs::path sparse = *data / scene / "sparse";
    if (fs::is_directory(sparse / "0")) sparse /= "0";
    if (!detail::has_binary(sparse)) continue;
    const TemporaryFolder folder;
    convert(sparse, folder.path() / "text", "TXT");
    convert(folder.path() / "text", folder.path() / "binary", "BIN");
    const ColmapModel ours = read(sparse, true), text = read(folder.path() / "text", false),
                      binary = read(folder.path() / "binary", true);
    CHECK(ours.images.size() > 10);
    CHECK(ours.points.size() > 100);
    CHECK(differences(ours, text, 2) == 0);
    CHECK(differences(text, binary, 2) == 0);
    MESSAGE(scene, ": ", ours.images.size(), " images, ", ours.points.size(),
            " points; numbers that differ in any bit: ", differences(ours, text, 0), " as text, ",
            differences(text, binary, 0), " as binary of the text");
  }
}
