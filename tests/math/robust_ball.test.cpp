// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The robust ball on planted scenes: what a few far places do to it (nothing), what they do to a box from minimum to
// maximum (the control), and that a scene whose far field is real keeps all of it.
#include "compmark/math/robust_ball.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"

using namespace compmark;

namespace {

using Place = std::array<double, 3>;
using Places = std::vector<Place>;

RobustBall ball_of(const Places& places) {
  return robust_ball(places.size(), [&](std::size_t i) -> const Place& { return places[i]; });
}
/// What the ball takes the place of: the half diagonal of the box from minimum to maximum.
double box_radius(const Places& places) {
  double square = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax_element(places.begin(), places.end(),
                                                 [&](const Place& a, const Place& b) { return a[axis] < b[axis]; });
    square += std::pow(((*high)[axis] - (*low)[axis]) / 2, 2);
  }
  return std::sqrt(square);
}

struct Planted {
  std::string name;
  Places places;
};
Places drawn(std::size_t count, std::uint64_t seed, double (*coordinate)(double), bool line = false) {
  const Random random(seed, count, random_stage("test/robust ball"));
  Places places(count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      places[i][c] = 3 + coordinate(random.uniform(line ? i : 3 * i + c)) * (line ? double(c) - 1 : 1);
  }
  return places;
}
/// Scenes without an outlier. The last has a real far field: a twentieth of it in a sky at 60 radii, and some all the
/// way there.
std::vector<Planted> planted_scenes() {
  std::vector<Planted> scenes{{"a cube", drawn(1000, 1, [](double u) { return 2 * u - 1; })},
                              {"a dense middle", drawn(3000, 2, [](double u) { return std::pow(2 * u - 1, 3); })},
                              {"a line", drawn(
                                             400, 3, [](double u) { return 5 * u; }, true)},
                              {"few", drawn(12, 4, [](double u) { return u; })}};
  Places open = drawn(2000, 5, [](double u) { return 2 * u - 1; });
  const Random random(6, 0, random_stage("test/robust ball"));
  for (std::size_t i = 0; i < 160; ++i) {
    Place way{};
    double norm = 0;
    for (std::size_t c = 0; c < 3; ++c) norm += std::pow(way[c] = random.normal(4 * i + c), 2);
    const double far = i % 2 == 0 ? 60 : std::pow(60, random.uniform(4 * i + 3));
    for (std::size_t c = 0; c < 3; ++c) way[c] = 3 + way[c] / std::sqrt(norm) * far;
    open.push_back(way);
  }
  scenes.push_back({"an open scene", open});
  return scenes;
}

}  // namespace

TEST_CASE("math/robust_ball: nothing of a scene without outliers is far, and all of a compact one is its core") {
  for (const Planted& scene : planted_scenes()) {
    CAPTURE(scene.name);
    const RobustBall ball = ball_of(scene.places);
    double farthest = 0;
    for (const Place& place : scene.places) farthest = std::max(farthest, ball.distance(place.data()));
    CHECK(farthest < ball.reach());
    if (scene.name != "an open scene") CHECK(farthest < ball.core());
  }
}

TEST_CASE(
    "math/robust_ball: far places, one to a tenth of all, at every distance and in a cluster, are beyond the reach of "
    "a ball that they do not move") {
  for (const Planted& scene : planted_scenes()) {
    const RobustBall clean = ball_of(scene.places);
    for (const double away : {2e3, 1e5, 1e9, 1e30}) {
      for (const double share : {0.0, 0.002, 0.01, 0.03, 0.1}) {  // 0: one place
        const std::size_t far = std::max<std::size_t>(1, static_cast<std::size_t>(share * double(scene.places.size())));
        for (const bool cluster : {true, false}) {
          CAPTURE(scene.name);
          CAPTURE(away);
          CAPTURE(far);
          Places places = scene.places;
          for (std::size_t i = 0; i < far; ++i) {
            const double side = cluster || i % 2 == 0 ? 1 : -1;
            places.push_back(
                {side * away * clean.wide * (1 + 1e-3 * double(i)), side * away * clean.wide, 0.1 * double(i)});
          }
          const RobustBall ball = ball_of(places);
          CHECK(ball.distance(ball.center.data()) == 0);
          CHECK(clean.distance(ball.center.data()) <= 0.5 * clean.wide);
          CHECK(ball.middle <= 2 * clean.wide);
          std::vector<Place> near;
          const std::size_t left_out = leave_out_far<Place>(places, ball, ball.reach(), near);
          // Of a dozen places two in a tenth are one: the share that `wide` bears is a twentieth.
          CHECK(left_out == far);
          CHECK(near == scene.places);
          // The control: a box from minimum to maximum holds all of them, and is theirs.
          CHECK(box_radius(places) > 0.4 * away * clean.wide);
        }
      }
    }
  }
}

TEST_CASE("math/robust_ball: a place between core and reach stays and does not count") {
  Places places = drawn(500, 7, [](double u) { return 2 * u - 1; });
  const double wide = ball_of(places).wide;
  places.push_back({3 + 40 * wide, 3, 3});
  const RobustBall ball = ball_of(places);
  CHECK(ball.distance(places.back().data()) > ball.core());
  CHECK(ball.distance(places.back().data()) < ball.reach());
  // Cameras around it say that the scene is larger.
  CHECK(ball.distance(places.back().data()) < ball.core(10 * wide));
  CHECK(ball.core(10 * wide) == doctest::Approx(160 * wide));
  CHECK(ball.reach(10 * wide) == doctest::Approx(1000 * wide));
}

TEST_CASE("math/robust_ball: places that are one, none, or no numbers have no far ones") {
  const double inf = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  for (const Places& places :
       {Places{}, Places{{1, 2, 3}}, Places(50, Place{1, 2, 3}), Places{{nan, 0, 0}, {inf, 1, 1}}}) {
    const RobustBall ball = ball_of(places);
    CHECK(ball.wide == 0);
    CHECK(ball.core() == inf);
    CHECK(ball.reach() == inf);
    CHECK(ball.reach(2) == 200);
  }
  Places mixed = drawn(200, 8, [](double u) { return u; });
  const RobustBall clean = ball_of(mixed);
  for (const Place& odd : {Place{nan, 0, 0}, Place{0, inf, 0}, Place{-inf, nan, 0}}) mixed.push_back(odd);
  CHECK(ball_of(mixed).wide == clean.wide);
  std::vector<Place> near;
  CHECK(leave_out_far<Place>(mixed, clean, clean.reach(), near) == 0);  // whoever reads them says what they are
  CHECK(near.empty());
  // More than half in one place: no middle, and the rest is not far from nothing.
  Places heap(60, Place{0, 0, 0});
  for (int i = 0; i < 40; ++i) heap.push_back({1.0 + i, 0, 0});
  CHECK(ball_of(heap).middle == 0);
  CHECK(ball_of(heap).reach() == doctest::Approx(100 * ball_of(heap).wide));
}

TEST_CASE("math/robust_ball: the ball moves and scales with the places, and does not depend on their order") {
  Places places = drawn(300, 9, [](double u) { return std::pow(2 * u - 1, 3); });
  const RobustBall ball = ball_of(places);
  Places moved = places;
  for (Place& place : moved) {
    for (std::size_t c = 0; c < 3; ++c) place[c] = 4 * place[c] + 64;
  }
  CHECK(ball_of(moved).wide == doctest::Approx(4 * ball.wide).epsilon(1e-12));
  CHECK(ball_of(moved).center[1] == doctest::Approx(4 * ball.center[1] + 64).epsilon(1e-12));
  std::reverse(places.begin(), places.end());
  CHECK(ball_of(places).wide == ball.wide);
  CHECK(ball_of(places).middle == ball.middle);
  CHECK(ball_of(places).center == ball.center);
}
