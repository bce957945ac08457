// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/finish.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

using namespace compmark;

namespace {

/// Four cameras on a cross of radius `radius` around `center`.
Dataset cross_of_cameras(std::array<double, 3> center, double radius = 2) {
  Dataset dataset;
  dataset.root = "scene";
  for (const auto& [x, y] : {std::pair{1, 0}, std::pair{0, 1}, std::pair{-1, 0}, std::pair{0, -1}}) {
    View view;
    view.camera.center_world = {center[0] + radius * x, center[1] + radius * y, center[2]};
    view.camera.width = view.camera.height = 10;
    view.camera.fx = view.camera.fy = 10;
    dataset.views.push_back(view);
  }
  return dataset;
}
PrecisePoints points_at(const std::vector<std::array<double, 3>>& position) {
  PrecisePoints points{position, {}};
  for (std::size_t i = 0; i < position.size(); ++i) points.color.push_back({static_cast<std::uint8_t>(i), 0, 0});
  return points;
}
bool says(const Dataset& dataset, const std::string& piece) {
  return std::any_of(dataset.warnings.begin(), dataset.warnings.end(),
                     [&](const std::string& w) { return w.find(piece) != std::string::npos; });
}

}  // namespace

TEST_CASE("scene/finish: spread of cameras and distance of the middle point") {
  const detail::CameraSpread spread = detail::camera_spread(cross_of_cameras({7, -3, 5}));
  CHECK(spread.mean == std::array<double, 3>{7, -3, 5});
  CHECK(spread.radius == 2);
  CHECK(detail::camera_spread({}).radius == 0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  // Of an even number the upper one; a point that is nowhere has no distance.
  CHECK(detail::median_distance(points_at({{1, 0, 0}, {0, 2, 0}, {0, 0, 9}}), {0, 0, 0}) == 2);
  CHECK(detail::median_distance(points_at({{1, 0, 0}, {0, 2, 0}, {nan, 0, 0}, {0, 0, 3}, {0, 4, 0}}), {0, 0, 0}) == 3);
  CHECK(detail::median_distance(points_at({{nan, 0, 0}}), {0, 0, 0}) == 0);
}

TEST_CASE("scene/finish: a scene is moved from a hundred of its sizes on, by the mean of its cameras") {
  for (const bool far : {false, true}) {
    CAPTURE(far);
    const std::array<double, 3> center{0, 0, far ? 201.0 : 199.0};  // of radius 2: limit 200
    Dataset dataset = cross_of_cameras(center);
    detail::finish_dataset(dataset, points_at({{0.5, 0.25, center[2] - 1}, {0, 0, center[2]}}), {});
    CHECK(dataset.origin == (far ? center : std::array<double, 3>{0, 0, 0}));
    CHECK(says(dataset, "is moved to it") == far);
    CHECK(dataset.views[0].camera.center_world == std::array<double, 3>{2, 0, far ? 0.0 : center[2]});
    REQUIRE(dataset.points.size() == 2);
    CHECK(dataset.points.position[0][2] == (far ? -1.0f : 198.0f));
    CHECK(!dataset.points_are_random);
  }
  // Cameras in one place: the points say how large the scene is.
  Dataset spot = cross_of_cameras({0, 0, 1000}, 0);
  detail::finish_dataset(spot, points_at({{0, 0, 1050}, {3, 0, 1050}}), {});
  CHECK(spot.origin == std::array<double, 3>{0, 0, 0});  // 1000 of 50 is 20 times
  spot = cross_of_cameras({0, 0, 1000}, 0);
  detail::finish_dataset(spot, points_at({{0, 0, 1005}, {3, 0, 1005}}), {});
  CHECK(spot.origin[2] == 1000);
}

TEST_CASE("scene/finish: ten thousand kilometres away a millimetre is a millimetre (case PR7)") {
  // Offsets are powers of two, so that adding them is exact in double.
  const std::array<double, 3> away{8388608.0, -4194304.0, 1048576.0};
  std::vector<std::array<double, 3>> near_points, far_points;
  for (int i = 0; i < 40; ++i) {
    near_points.push_back({0.0009765625 * i, 0.5 - 0.001953125 * i, 1});
    far_points.push_back(near_points.back());
    for (std::size_t c = 0; c < 3; ++c) far_points.back()[c] += away[c];
  }
  Dataset here = cross_of_cameras({0, 0, 0}), there = cross_of_cameras(away);
  detail::finish_dataset(here, points_at(near_points), {});
  detail::finish_dataset(there, points_at(far_points), {});
  CHECK(there.origin == away);
  CHECK(there.points.position == here.points.position);
  for (std::size_t i = 0; i < 4; ++i) CHECK(there.views[i].camera.center_world == here.views[i].camera.center_world);
  // The control: rounded to float first and moved then, neighbours coincide.
  const auto rounded = [&](int i) { return static_cast<float>(far_points[static_cast<std::size_t>(i)][0]); };
  CHECK(rounded(0) == rounded(39));
}

TEST_CASE("scene/finish: points that no camera can use are left out and counted, colours stay with their points") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  Dataset dataset = cross_of_cameras({0, 0, 0});
  // The scene's size is 2: a point within 2e-6 of a camera is in it (case PR9).
  detail::finish_dataset(dataset,
                         points_at({{0, 0, 1},
                                    {nan, 0, 0},
                                    {0, 0, -infinity},
                                    {0, 1e39, 0},  // finite, but not in single precision
                                    {2, 0, 0},
                                    {2, 1.9e-6, 0},
                                    {2, 2.1e-6, 0},
                                    {0, -2 + 1e-7, 0},
                                    {0.5, 0, 0}}),
                         {});
  REQUIRE(dataset.points.size() == 3);
  CHECK(dataset.points.color[0][0] == 0);
  CHECK(dataset.points.color[1][0] == 6);
  CHECK(dataset.points.color[2][0] == 8);
  CHECK(says(dataset, "3 points that are not finite"));
  CHECK(says(dataset, "3 points in the centres of cameras"));
  CHECK(!dataset.points_are_random);
}

TEST_CASE("scene/finish: without a usable point random ones are drawn, the same for the same seed") {
  const auto finished = [](const PrecisePoints& points, std::uint64_t seed) {
    Dataset dataset = cross_of_cameras({0, 0, 0});
    DatasetSettings settings;
    settings.random_points = 500;
    settings.seed = seed;
    detail::finish_dataset(dataset, points, settings);
    CHECK(dataset.points_are_random);
    CHECK(dataset.points.size() == 500);
    return dataset;
  };
  const Dataset none = finished({}, 1), useless = finished(points_at({{2, 0, 0}}), 1), other = finished({}, 2);
  CHECK(says(none, "there are no points"));
  CHECK(says(useless, "there are no usable points"));
  CHECK(none.points.position == useless.points.position);
  CHECK(none.points.position != other.points.position);
}
