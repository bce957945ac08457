// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/novel_view.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <set>
#include <vector>

using namespace compmark;

namespace {

/// A camera on the unit circle of the plane z = 0, at `angle`, that looks at the origin.
Camera<double> on_circle(double angle) {
  Camera<double> camera;
  camera.width = camera.height = 8;
  camera.fx = camera.fy = 5 + angle;
  const double c = std::cos(angle), s = std::sin(angle);
  camera.rotation_camera_world = {-s, c, 0, 0, 0, -1, -c, -s, 0};
  camera.center_world = {c, s, 0};
  return camera;
}

/// Of cameras at these places of a line.
ViewClearance clearance_on_line(const std::vector<double>& x) {
  return ViewClearance(
      [&](std::size_t i) {
        Camera<double> camera;
        camera.center_world = {x[i], 0, 0};
        return camera;
      },
      x.size());
}

}  // namespace

TEST_CASE("scene/novel_view: half way between two cameras of a circle it stands on the chord and looks at the centre") {
  const Camera<double> from = on_circle(0.3), to = on_circle(1.1);
  const Camera<double> middle = camera_between(from, to, 0.5);
  const double mean = 0.7;
  const double chord = std::cos(0.4);
  CHECK(middle.center_world[0] == doctest::Approx(chord * std::cos(mean)).epsilon(1e-14));
  CHECK(middle.center_world[1] == doctest::Approx(chord * std::sin(mean)).epsilon(1e-14));
  const Camera<double> wanted = on_circle(mean);
  for (std::size_t i = 0; i < 9; ++i)
    CHECK(std::abs(middle.rotation_camera_world[i] - wanted.rotation_camera_world[i]) < 1e-15 * 8);
  CHECK(middle.fx == from.fx);
  // Negative control: the mean of the two matrices is no rotation.
  double row = 0;
  for (std::size_t c = 0; c < 3; ++c)
    row += std::pow((from.rotation_camera_world[6 + c] + to.rotation_camera_world[6 + c]) / 2, 2);
  CHECK(row < 0.9);
}

TEST_CASE("scene/novel_view: the ends are the two cameras") {
  const Camera<double> from = on_circle(-2.0), to = on_circle(-1.5);
  const Camera<double> begin = camera_between(from, to, 0), end = camera_between(from, to, 1);
  CHECK(begin.rotation_camera_world == from.rotation_camera_world);
  CHECK(begin.center_world == from.center_world);
  CHECK(end.center_world == to.center_world);
  for (std::size_t i = 0; i < 9; ++i)
    CHECK(std::abs(end.rotation_camera_world[i] - to.rotation_camera_world[i]) < 1e-15 * 8);
}

TEST_CASE("scene/novel_view: a neighbour is one of the six nearest that look the same way, and every one is drawn") {
  std::vector<Camera<double>> cameras;
  for (int i = 0; i < 24; ++i) cameras.push_back(on_circle(i * std::numbers::pi / 12));
  // Beside camera 0, and turned round: the nearest of all, and of no use.
  Camera<double> turned = on_circle(0.001);
  for (std::size_t i = 0; i < 9; ++i)
    if (i < 3 || i > 5) turned.rotation_camera_world[i] = -turned.rotation_camera_world[i];
  cameras.push_back(turned);
  const auto camera = [&](std::size_t i) { return cameras[i]; };
  std::set<std::size_t> sampled;
  for (std::uint64_t t = 0; t < 200; ++t)
    sampled.insert(neighbouring_view(camera, cameras.size(), 0, Random(1, t, random_stage("test"))));
  CHECK(sampled == std::set<std::size_t>{1, 2, 3, 21, 22, 23});
  // With nobody beside it, a view is its own neighbour.
  CHECK(neighbouring_view(camera, 1, 0, Random(1, 0, 0)) == 0);
  const auto opposite = [&](std::size_t i) { return i == 0 ? cameras[0] : turned; };
  CHECK(neighbouring_view(opposite, 2, 0, Random(1, 0, 0)) == 0);
}

TEST_CASE(
    "scene/novel_view: a turned and zoomed camera sees the same points, turned and scaled round the principal point") {
  const Camera<double> camera = on_circle(0.4);
  const double roll = 0.2, zoom = 1.1;
  const Camera<double> turned = camera_turned(camera, roll, zoom);
  const auto project = [](const Camera<double>& c, std::array<double, 3> point) {
    std::array<double, 3> p{};
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t k = 0; k < 3; ++k) p[r] += c.rotation_camera_world[3 * r + k] * (point[k] - c.center_world[k]);
    return std::array<double, 2>{c.fx * p[0] / p[2], c.fy * p[1] / p[2]};
  };
  for (const std::array<double, 3> point : {std::array<double, 3>{0.1, 0.2, 0.3}, {-0.3, 0.1, -0.2}}) {
    const auto before = project(camera, point), after = project(turned, point);
    const double x = zoom * (std::cos(roll) * before[0] - std::sin(roll) * before[1]);
    const double y = zoom * (std::sin(roll) * before[0] + std::cos(roll) * before[1]);
    CHECK(after[0] == doctest::Approx(x).epsilon(1e-13));
    CHECK(after[1] == doctest::Approx(y).epsilon(1e-13));
  }
}

TEST_CASE("scene/novel_view: sampled cameras fill the triangle of a view and two neighbours and look at the scene") {
  std::vector<Camera<double>> cameras;
  for (int i = 0; i < 24; ++i) cameras.push_back(on_circle(i * std::numbers::pi / 12));
  const auto camera = [&](std::size_t i) { return cameras[i]; };
  std::set<double> places;
  for (std::uint64_t t = 0; t < 100; ++t) {
    const Camera<double> sampled = novel_view_camera(camera, cameras.size(), 0, Random(1, t, random_stage("test")));
    const double radius = std::hypot(sampled.center_world[0], sampled.center_world[1]);
    CHECK(radius <= 1 + 1e-12);
    CHECK(radius >= std::cos(std::numbers::pi / 4) - 1e-12);  // the longest chord is that of views 3 and 21
    double towards = 0;
    for (std::size_t c = 0; c < 3; ++c)
      towards -= sampled.rotation_camera_world[6 + c] * sampled.center_world[c] / radius;
    CHECK(towards > std::cos(std::numbers::pi / 4));
    CHECK(sampled.fx <= camera(0).fx * 1.2 + 1e-12);
    CHECK(sampled.fx >= camera(0).fx / 1.2 - 1e-12);
    places.insert(sampled.center_world[0]);
  }
  CHECK(places.size() > 90);
  // As often near by as far: a quarter of them in the quarter of the way that is nearest to the view. Uniform in the
  // triangle it were a sixteenth. A view and one neighbour, so that the way is a line; of 400 draws a quarter is 100
  // with a deviation of 8.7.
  int near_by = 0;
  for (std::uint64_t t = 0; t < 400; ++t) {
    const Camera<double> sampled = novel_view_camera(camera, 2, 0, Random(2, t, random_stage("test")));
    const double dx = sampled.center_world[0] - cameras[0].center_world[0];
    const double dy = sampled.center_world[1] - cameras[0].center_world[1];
    near_by += std::hypot(dx, dy) < 0.25 * 2 * std::sin(std::numbers::pi / 24) ? 1 : 0;
  }
  CHECK(near_by > 65);
  CHECK(near_by < 135);
  // A lonely view is turned and zoomed where it stands.
  const Camera<double> alone = novel_view_camera(camera, 1, 0, Random(1, 0, 0));
  CHECK(alone.center_world == cameras[0].center_world);
}

TEST_CASE("scene/novel_view: a camera is sampled by one look at the views, which all its neighbours come from") {
  constexpr std::size_t views = 40;
  std::size_t asked = 0;
  const auto camera = [&](std::size_t i) {
    ++asked;
    return on_circle(2 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(views));
  };
  static_cast<void>(novel_view_camera(camera, views, 3, Random(1, 2, random_stage("test"))));
  CHECK(asked <= views + 3);  // all of them once, and the three of the triangle; each draw looked at all before
}

TEST_CASE("scene/novel_view: views with clearance around them are drawn more often") {
  // Of so many equal parts of [0, 1), how many draw each view; cameras on a line.
  const auto sampled = [](const std::vector<double>& x, int parts) {
    const ViewClearance clearance = clearance_on_line(x);
    std::vector<int> count(x.size());
    for (int n = 0; n < parts; ++n) ++count[clearance.view((n + 0.5) / parts)];
    return count;
  };
  // The third nearest of 2 is at 0 or 4; 20 has 144, sixteen times the median of 9, instead of 324.
  CHECK(sampled({0, 1, 2, 3, 4, 20}, 174) == std::vector<int>{9, 4, 4, 4, 9, 144});
  CHECK(sampled({5}, 3) == std::vector<int>{3});
  CHECK(sampled({5, 5, 5}, 3) == std::vector<int>{1, 1, 1});
  CHECK(sampled({5, 5, 5, 5, 9}, 5) == std::vector<int>{1, 1, 1, 1, 1});  // a tripod's are not left out
  CHECK(sampled({0, 0, 0, 0, 1, 2, 3, 4, 5}, 1000).front() > 0);
  CHECK(sampled({0, 3}, 2) == std::vector<int>{1, 1});  // with fewer others, the farthest
  CHECK(ViewClearance().empty());
}

TEST_CASE("scene/novel_view: clearance and a factor together say how often a view is drawn") {
  const std::vector<double> x{0, 1, 2, 3, 4, 20};  // clearance 9, 4, 4, 4, 9, 144, as above
  const ViewClearance clearance = clearance_on_line(x);
  const auto sampled = [&](const std::vector<double>& factor, int parts) {
    std::vector<int> count(x.size());
    for (int n = 0; n < parts; ++n) ++count[clearance.view((n + 0.5) / parts, factor)];
    return count;
  };
  CHECK(sampled({}, 174) == std::vector<int>{9, 4, 4, 4, 9, 144});
  CHECK(sampled({1, 1, 1, 1, 1, 1}, 174) == sampled({}, 174));
  CHECK(sampled({2, 1, 0.5, 3, 0, 0.25}, 72) == std::vector<int>{18, 4, 2, 12, 0, 36});
}

TEST_CASE(
    "scene/novel_view: the distance from the photographs is in medians of their own, and of those that look the same "
    "way") {
  std::vector<Camera<double>> cameras;
  for (const double x : {0.0, 2.0, 4.0, 6.0, 20.0}) {  // the nearest is 2, 2, 2, 2 and 14 away
    cameras.push_back(on_circle(0));
    cameras.back().center_world = {x, 0, 0};
  }
  const auto at = [](double x, double angle) {
    Camera<double> camera = on_circle(angle);
    camera.center_world = {x, 0, 0};
    return camera;
  };
  const auto camera = [&](std::size_t i) { return cameras[i]; };
  const PhotographDistance distance(camera, cameras.size());
  CHECK(distance.medians(at(2, 0)) == 0);
  CHECK(distance.medians(at(5, 0)) == 0.5);
  CHECK(distance.medians(at(12, 0)) == 3);
  CHECK(distance.medians(at(-8, 1.0)) == 4);        // 57 degrees: the same way
  CHECK(std::isinf(distance.medians(at(2, 1.1))));  // 63: nobody looked there
  // Of another unit of length, the same. The distance in the scene's own units is not.
  std::vector<Camera<double>> larger = cameras;
  for (Camera<double>& one : larger) one.center_world[0] *= 10;
  const PhotographDistance same([&](std::size_t i) { return larger[i]; }, larger.size());
  CHECK(same.medians(at(120, 0)) == 3);
  // Of photographs from one place, and of a single one, nothing is known.
  CHECK(PhotographDistance([&](std::size_t) { return cameras[0]; }, 3).medians(at(7, 0)) == 1);
  CHECK(PhotographDistance(camera, 1).medians(at(7, 0)) == 1);
  // Nor where two of five happen to look the same way and the others each its own.
  std::vector<Camera<double>> apart{at(0, 0), at(0.1, 0), at(3, 1.2), at(6, 2.4), at(9, 3.6)};
  CHECK(PhotographDistance([&](std::size_t i) { return apart[i]; }, 5).medians(at(7, 0)) == 1);
  CHECK(PhotographDistance().empty());
}
