// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/splat/training/view_row.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <span>
#include <vector>

namespace {

using namespace compmark;

Camera<double> example_camera() {
  Camera<double> camera;
  camera.width = 640;
  camera.height = 65536;
  camera.fx = 500.5;
  camera.fy = 1.0 / 3;
  camera.cx = -7;
  camera.cy = 239.5;
  for (std::size_t i = 0; i < 9; ++i) camera.rotation_camera_world[i] = 0.1 * static_cast<double>(i) - 0.4;
  camera.center_world = {1, -2, 5e-324};
  return camera;
}

bool reads_camera(const std::vector<double>& row) {
  Camera<double> camera;
  return detail::read_camera_row(std::span(row).first<detail::camera_numbers>(), camera);
}
bool reads_lens(const std::vector<double>& row) {
  Lens lens;
  return detail::read_lens_row(std::span(row).first<detail::lens_numbers>(), lens);
}

TEST_CASE("training/view_row: cameras and lenses come back bit for bit") {
  std::vector<double> row, lens_row;
  const Camera<double> camera = example_camera();
  detail::append_camera_row(camera, row);
  REQUIRE(row.size() == detail::camera_numbers);
  Camera<double> back;
  REQUIRE(detail::read_camera_row(std::span(row).first<detail::camera_numbers>(), back));
  std::vector<double> again;
  detail::append_camera_row(back, again);
  CHECK(again == row);
  CHECK(back.center_world == camera.center_world);
  CHECK(back.rotation_camera_world == camera.rotation_camera_world);
  for (std::size_t model = 0; model < lens_model_count; ++model) {
    Lens lens{static_cast<LensModel>(model), {}}, lens_back;
    for (std::size_t i = 0; i < 16; ++i) lens.parameters[i] = 0.01 * static_cast<double>(i) - 0.05;
    lens_row.clear();
    detail::append_lens_row(lens, lens_row);
    REQUIRE(lens_row.size() == detail::lens_numbers);
    REQUIRE(detail::read_lens_row(std::span(lens_row).first<detail::lens_numbers>(), lens_back));
    CHECK(lens_back == lens);
  }
}

TEST_CASE("training/view_row: numbers that no camera and no lens has are refused, wherever they stand") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  std::vector<double> good, lens;
  detail::append_camera_row(example_camera(), good);
  detail::append_lens_row({LensModel::opencv, {}}, lens);
  REQUIRE(reads_camera(good));
  REQUIRE(reads_lens(lens));
  for (const double wrong : {nan, infinity, -infinity}) {
    for (std::size_t i = 0; i < good.size(); ++i) {
      std::vector<double> row = good;
      row[i] = wrong;
      CHECK(!reads_camera(row));
    }
    for (std::size_t i = 0; i < lens.size(); ++i) {
      std::vector<double> row = lens;
      row[i] = wrong;
      CHECK(!reads_lens(row));
    }
  }
  for (const double wrong : {0.0, -1.0, 0.5, 100.5, 65537.0, 1e300}) {  // sizes, pixels
    for (const std::size_t i : {0u, 1u}) {
      std::vector<double> row = good;
      row[i] = wrong;
      CHECK(!reads_camera(row));
    }
  }
  for (const double wrong : {0.0, -0.0, -500.0}) {  // focal lengths
    for (const std::size_t i : {2u, 3u}) {
      std::vector<double> row = good;
      row[i] = wrong;
      CHECK(!reads_camera(row));
    }
  }
  for (const double wrong : {-1.0, 0.5, static_cast<double>(lens_model_count), 1e18}) {
    lens[0] = wrong;
    CHECK(!reads_lens(lens));
  }
}

}  // namespace
