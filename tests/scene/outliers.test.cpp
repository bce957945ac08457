// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A few points or one camera far away: the scene is the same as without them, and what is left out is said with its
// number.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/scene/far_field.hpp"
#include "compmark/scene/finish.hpp"

using namespace compmark;

namespace {

constexpr std::size_t near_points = 600;

/// A ring of cameras of radius 4 around a cube of points.
Dataset ring(std::size_t cameras = 24) {
  Dataset dataset;
  dataset.root = "capture";
  for (std::size_t i = 0; i < cameras; ++i) {
    const double angle = 2 * 3.14159265358979 * static_cast<double>(i) / static_cast<double>(cameras);
    View view;
    view.name = "photo" + std::to_string(i);
    view.camera.center_world = {4 * std::cos(angle), 4 * std::sin(angle), 0.1 * static_cast<double>(i % 3)};
    view.camera.width = view.camera.height = 20;
    view.camera.fx = view.camera.fy = 20;
    dataset.views.push_back(view);
  }
  return dataset;
}
PrecisePoints cube() {
  PrecisePoints points;
  const Random random(1, 0, random_stage("test/outliers"));
  for (std::size_t i = 0; i < near_points; ++i) {
    std::array<double, 3> p{};
    for (std::size_t c = 0; c < 3; ++c) p[c] = 2 * random.uniform(3 * i + c) - 1;
    points.position.push_back(p);
    points.color.push_back({1, 2, 3});
  }
  return points;
}
Dataset finished(Dataset dataset, PrecisePoints points) {
  detail::finish_dataset(dataset, std::move(points), {});
  return dataset;
}
std::string warnings_of(const Dataset& dataset) {
  std::string text;
  for (const std::string& warning : dataset.warnings) text += warning + "\n";
  return text;
}

}  // namespace

TEST_CASE("scene/outliers: points far away are left out, the others keep every bit, and the number is said") {
  const Dataset clean = finished(ring(), cube());
  CHECK(clean.warnings.empty());
  for (const double away : {4e3, 4e5, 1e20, 1e30, 1e37}) {
    for (const std::size_t far : {std::size_t{1}, std::size_t{3}, std::size_t{6}, std::size_t{60}}) {
      CAPTURE(away);
      CAPTURE(far);
      PrecisePoints points = cube();
      for (std::size_t i = 0; i < far; ++i) {
        points.position.insert(points.position.begin() + static_cast<std::ptrdiff_t>(5 * i),
                               {away * (i % 2 == 0 ? 1 : -1), away, 0.01 * static_cast<double>(i)});
        points.color.push_back({9, 9, 9});
      }
      const Dataset dataset = finished(ring(), points);
      CHECK(dataset.points.position == clean.points.position);
      CHECK(dataset.unit == clean.unit);
      CHECK(dataset.origin == clean.origin);
      const std::string said = warnings_of(dataset);
      CHECK(said.find(std::to_string(far) + " of " + std::to_string(near_points + far) + " points lie") !=
            std::string::npos);
      CHECK(said.find("left out") != std::string::npos);
    }
  }
  // How far is told in sizes of the scene, of which the cameras' 4 is the longer.
  PrecisePoints points = cube();
  points.position.push_back({4e5, 0, 0});
  points.color.push_back({});
  const std::string said = warnings_of(finished(ring(), points)), begin = "1 of 601 points lies ";
  REQUIRE(said.find(begin) != std::string::npos);
  CHECK(std::stod(said.substr(said.find(begin) + begin.size())) == doctest::Approx(1e5).epsilon(0.01));
  CHECK(said.find(" scene sizes away and is left out") != std::string::npos);
}

TEST_CASE("scene/outliers: a far field within the reach of triangulation is kept to the last point") {
  PrecisePoints points = cube();
  for (int i = 0; i < 20; ++i) {
    points.position.push_back({300 * std::cos(0.3 * i), 300 * std::sin(0.3 * i), 10.0 * i});  // 75 radii of the cameras
    points.color.push_back({});
  }
  const Dataset dataset = finished(ring(), points);
  CHECK(dataset.points.size() == near_points + 20);
  CHECK(warnings_of(dataset).find("left out") == std::string::npos);
}

TEST_CASE("scene/outliers: one camera far away does not decide extent, ball, origin, or which points lie at cameras") {
  const Dataset clean = finished(ring(), cube());
  for (const double away : {1e3, 1e6, 1e12, 1e30}) {
    CAPTURE(away);
    Dataset dataset = ring();
    View lost = dataset.views[3];
    lost.name = "lost";
    lost.camera.center_world = {away, -away, 0};
    dataset.views.insert(dataset.views.begin() + 2, lost);
    dataset = finished(dataset, cube());
    CHECK(dataset.points.position == clean.points.position);
    CHECK(dataset.origin == clean.origin);
    CHECK(dataset.unit == clean.unit);
    CHECK(camera_extent(dataset).radius == doctest::Approx(camera_extent(clean).radius).epsilon(1e-12));
    CHECK(scene_extent(dataset).center[0] == doctest::Approx(scene_extent(clean).center[0]).epsilon(1e-9));
    CHECK(camera_ball(dataset).radius == doctest::Approx(camera_ball(clean).radius).epsilon(1e-12));
    const std::string said = warnings_of(dataset);
    CHECK(said.find("the camera of \"lost\" stands") != std::string::npos);
    CHECK(said.find("does not count for the scene's extent") != std::string::npos);
  }
  // The control: a camera ten radii away is part of the capture.
  Dataset wide = ring();
  wide.views[5].camera.center_world = {40, 0, 0};
  wide = finished(wide, cube());
  CHECK(camera_extent(wide).radius > 9 * 4);
  CHECK(wide.warnings.empty());
}
