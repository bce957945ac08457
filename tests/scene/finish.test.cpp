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

TEST_CASE("scene/finish: a scene of size 0.1 to 100 keeps its unit, others are brought to 4 ... 8 (case PR8)") {
  const auto finished = [](double radius, const std::vector<std::array<double, 3>>& points) {
    Dataset dataset = cross_of_cameras({0, 0, 0}, radius);
    detail::finish_dataset(dataset, points_at(points), {});
    CHECK(says(dataset, "lengths are counted in units of") == (dataset.unit != 1));
    CHECK(dataset.views[0].camera.center_world[0] * dataset.unit == radius);
    return dataset;
  };
  const auto unit = [&](double radius, double distance) {
    return finished(radius, {{0, 0, distance}, {0, 0, -distance}}).unit;
  };
  CHECK(unit(0.1, 0.01) == 1);
  CHECK(unit(std::nextafter(0.1, 0.0), 0.01) == 0x1p-6);  // 0.1 = 6.4 / 64
  CHECK(unit(100, 1) == 1);
  CHECK(unit(std::nextafter(100.0, 1e3), 1) == 16);
  CHECK(unit(0.01, 0.1) == 1);  // the larger one of the two says
  CHECK(unit(0.01, 0.09) == 0x1p-6);
  CHECK(unit(1, 128) == 32);
  CHECK(unit(1, std::nextafter(128.0, 0.0)) == 16);
  CHECK(unit(4 * 0x1p-40, 0x1p-40) == 0x1p-40);
  CHECK(finished(4096, {{0, 512, 1024}}).points.position[0] == std::array<float, 3>{0, 0.5f, 1});
  // The smallest numbers there are have a unit that can be divided by.
  const Dataset least = finished(0x1p-1070, {{0, 0, 0x1p-1072}});
  CHECK(least.unit == 0x1p-1021);
  CHECK(least.views[0].camera.center_world[0] == 0x1p-49);
  // One place: what is seen from there says; where nothing is, nothing does.
  CHECK(unit(0, 0.002) == 0x1p-11);
  CHECK(finished(0, {}).unit == 1);
  CHECK(!says(finished(4, {}), "units"));
}

TEST_CASE("scene/finish: one camera registered far away does not decide the unit") {
  for (const std::array<double, 3>& lost : {std::array<double, 3>{1e4, 0, 0}, {0, -1e4, 3e3}, {6e3, 6e3, -6e3}}) {
    for (const bool has_points : {true, false}) {
      const auto unit = [&](double radius) {
        Dataset dataset = cross_of_cameras({0, 0, 0}, radius);
        dataset.views.push_back(dataset.views[0]);
        dataset.views.back().camera.center_world = lost;
        CHECK(std::hypot(lost[0], lost[1], lost[2]) > 5 * 1000);  // what a largest distance would say
        detail::finish_dataset(
            dataset, has_points ? points_at({{0, 0, radius / 2}, {0, radius / 2, 0}, {0, 0, 0}}) : PrecisePoints{}, {});
        return dataset.unit;
      };
      CHECK(unit(5) == 1);
      if (!has_points) continue;
      CHECK(unit(400) == 64);
      CHECK(unit(0.01) == 0x1p-9);
    }
  }
  // Of two cameras the middle is between them, wherever they are: 60 apart from it is no large scene.
  Dataset pair = cross_of_cameras({0, 0, 0}, 60);
  pair.views = {pair.views[0], pair.views[2]};
  pair.views[0].camera.center_world = {-40, -40, 0};
  pair.views[1].camera.center_world = {40, 40, 0};
  detail::finish_dataset(pair, points_at({{0, 0, 1}}), {});
  CHECK(pair.unit == 1);
}

TEST_CASE("scene/finish: without points a small baseline in front of something far is no small scene") {
  const auto finished = [](double scale, double distance) {
    Dataset dataset = cross_of_cameras({0, 0, 0}, 0.0625 * scale);
    for (View& view : dataset.views) {  // towards a point `distance` in front
      const auto& p = view.camera.center_world;
      const double x = -p[0] / scale, y = -p[1] / scale, norm = std::hypot(x, y, distance);
      view.camera.rotation_camera_world = {1, 0, 0, 0, 1, 0, x / norm, y / norm, distance / norm};
    }
    detail::finish_dataset(dataset, {}, {});
    return dataset;
  };
  CHECK(look_at(finished(1, 0.5)).distance == doctest::Approx(0.5).epsilon(0.1));
  CHECK(finished(1, 0.5).unit == 1);
  CHECK(finished(1, 0.0625).unit == 0x1p-6);  // as small as their circle: 0.09 away
  // Copies of one scene are one scene, too small or too large.
  const Dataset small = finished(0x1p-10, 0.5), large = finished(0x1p+12, 0.5);
  CHECK(small.unit != 1);
  CHECK(large.unit == small.unit * 0x1p+22);
  CHECK(large.views[1].camera.center_world == small.views[1].camera.center_world);
  CHECK(large.points.position == small.points.position);
}

TEST_CASE("scene/finish: a scene in other units that are powers of two is the same scene, to the bit") {
  const auto finished = [](double scale, double away) {
    Dataset dataset = cross_of_cameras({0, 0, 0}, 3.7);
    std::vector<std::array<double, 3>> points;
    for (int i = 1; i < 60; ++i)
      points.push_back({std::sin(3.0 * i), std::cos(5.0 * i) / 3, std::sin(7.0 * i) / 7 - 4});
    for (View& view : dataset.views) {
      for (double& x : view.camera.center_world) x = scale * (x / 3 + away);
    }
    for (auto& p : points) {
      for (double& x : p) x = scale * (x + away);
    }
    detail::finish_dataset(dataset, points_at(points), {});
    return dataset;
  };
  for (const double away : {0.0, 1e4 / 3}) {
    CAPTURE(away);
    const Dataset plain = finished(1, away);
    CHECK(plain.unit == 1);
    for (const int power : {-60, -10, -7, 7, 10, 60}) {
      CAPTURE(power);
      const double scale = std::ldexp(1.0, power);
      const Dataset copy = finished(scale, away);
      CHECK(copy.unit == scale);  // of size 4.0: nothing is left of the other unit
      for (std::size_t c = 0; c < 3; ++c) CHECK(copy.origin[c] == scale * plain.origin[c]);
      for (std::size_t i = 0; i < 4; ++i)
        CHECK(copy.views[i].camera.center_world == plain.views[i].camera.center_world);
      CHECK(copy.points.position == plain.points.position);
    }
    // Other factors cost the rounding of doubles, and another binade where the size comes to lie in one.
    const Dataset thousandth = finished(1e-3, away);
    CHECK(thousandth.unit == 0x1p-10);
    for (std::size_t i = 0; i < 59; ++i) {
      for (std::size_t c = 0; c < 3; ++c)
        CHECK(static_cast<double>(thousandth.points.position[i][c]) ==
              doctest::Approx(1.024 * static_cast<double>(plain.points.position[i][c])).epsilon(1e-6));
    }
  }
}

TEST_CASE("scene/dataset: another unit or origin leaves everything at its place in the files") {
  Dataset dataset = cross_of_cameras({4096, 0, 512}, 1024);
  detail::finish_dataset(dataset, points_at({{4096, 256, 640}, {4000, 0, 512}}), {});
  CHECK(dataset.unit == 256);
  const auto check = [&](double unit, const std::array<double, 3>& origin) {
    CHECK(dataset.unit == unit);
    CHECK(dataset.origin == origin);
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(dataset.views[0].camera.center_world[c] * unit + origin[c] == std::array<double, 3>{5120, 0, 512}[c]);
      CHECK(static_cast<double>(dataset.points.position[0][c]) * unit + origin[c] ==
            std::array<double, 3>{4096, 256, 640}[c]);
    }
    CHECK(place_in(dataset, {5120, 0, 512}) == dataset.views[0].camera.center_world);
  };
  check(256, {0, 0, 0});
  change_unit(dataset, 0.5);
  check(0.5, {0, 0, 0});
  move_origin(dataset, {1024, -64, 3});
  check(0.5, {1024, -64, 3});
  change_unit(dataset, 1);
  move_origin(dataset, {0, 0, 0});
  check(1, {0, 0, 0});
  CHECK(dataset.points.position[1] == std::array<float, 3>{4000, 0, 512});
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
