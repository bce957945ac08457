// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/camera_check.hpp"

#include <doctest/doctest.h>
#include <compmark/scene/open.hpp>

#include <algorithm>
#include <string>

#include "scene/cube_dialects.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

std::string said_of(const CubeCapture& capture, bool points = true) {
  Dataset dataset;
  for (const Camera<double>& camera : capture.cameras) {
    dataset.views.emplace_back();
    dataset.views.back().camera = camera;
  }
  for (std::size_t i = 0; points && i < capture.points.size(); ++i) {
    const auto& p = capture.points[i];
    dataset.points.position.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
  }
  dataset.points.color.resize(dataset.points.position.size());
  detail::say_strange_cameras(dataset);
  std::string text;
  for (const std::string& warning : dataset.warnings) text += warning + "\n";
  return text;
}

}  // namespace

TEST_CASE("scene/camera_check: cameras that look at their points are passed over, whatever their unit and place") {
  CHECK(said_of(cube_capture()).empty());
  CHECK(said_of(cube_capture(1e-3, {5, 5, 5})).empty());
  CHECK(said_of(cube_capture(1e3, {1e4, 0, 0})).empty());
  // A few that look elsewhere are what captures are like.
  CubeCapture capture = cube_capture();
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t k = 0; k < 9; ++k) capture.cameras[i].rotation_camera_world[k] *= k / 3 == 1 ? 1 : -1;
  CHECK(said_of(capture).empty());
}

TEST_CASE("scene/camera_check: other axes, and points elsewhere, are said, unless nobody knows what there is to see") {
  CubeCapture axes = cube_capture(), elsewhere = cube_capture();
  for (Camera<double>& camera : axes.cameras)
    for (std::size_t k = 3; k < 9; ++k) camera.rotation_camera_world[k] *= -1;
  for (std::array<double, 3>& p : elsewhere.points) p[2] += 100;
  for (const CubeCapture& capture : {axes, elsewhere}) {
    CHECK(said_of(capture).find("12 of 12 cameras see none of the points") != std::string::npos);
    CHECK(said_of(capture, false).empty());
  }
}

TEST_CASE("scene/camera_check: one pose for all photographs, and one place") {
  CubeCapture pose = cube_capture(), place = cube_capture();
  for (Camera<double>& camera : pose.cameras) camera = pose.cameras[2];
  for (Camera<double>& camera : place.cameras) camera.center_world = {0, 0, 0};
  CHECK(said_of(pose).find("all 12 photographs have the same pose") != std::string::npos);
  CHECK(said_of(place).find("all 12 cameras stand in one place") != std::string::npos);
  pose.cameras[5] = cube_capture().cameras[3];
  CHECK(said_of(pose).empty());
}
