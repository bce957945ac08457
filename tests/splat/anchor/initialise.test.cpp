// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// First anchors: against brute force, and the cases AN1 to AN4 of docs/spec/numerics.md with their negative controls.
#include "compmark/splat/anchor/initialise.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;
using CloudPoint = std::array<float, 3>;

std::vector<CloudPoint> random_cloud(std::size_t n, double spread, std::uint64_t seed = 1) {
  std::vector<CloudPoint> cloud(n);
  const Random random(seed, 0, 0);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      cloud[i][axis] = static_cast<float>(spread * (random.uniform(3 * i + axis) - 0.5));
  }
  return cloud;
}

InitialAnchors<float> anchors_of(const std::vector<CloudPoint>& cloud, double voxel_size, bool squared = false) {
  auto result = initial_anchors<float>(cloud, {voxel_size, squared});
  REQUIRE(result.ok());
  return *result;
}

}  // namespace

TEST_CASE("anchor/initialise: one anchor a voxel, sorted, with the scale of its neighbours") {
  const std::vector<CloudPoint> cloud = random_cloud(600, 1);
  const double voxel = 0.15;
  const InitialAnchors<float> anchors = anchors_of(cloud, voxel);
  std::set<std::array<int, 3>> cells;
  for (const CloudPoint& p : cloud) {
    std::array<int, 3> cell{};
    for (std::size_t i = 0; i < 3; ++i) cell[i] = static_cast<int>(std::nearbyint(static_cast<double>(p[i]) / voxel));
    cells.insert(cell);
  }
  REQUIRE(anchors.count() == cells.size());
  CHECK(anchors.count() < 600);
  CHECK(anchors.voxel_size == voxel);
  CHECK(anchors.skipped_points == 0);
  std::size_t row = 0;
  for (const auto& cell : cells) {  // std::set is in lexicographic order
    for (std::size_t i = 0; i < 3; ++i) CHECK(anchors.position[3 * row + i] == static_cast<float>(cell[i] * voxel));
    std::vector<double> squared;
    for (const auto& other : cells) {
      double d = 0;
      for (std::size_t i = 0; i < 3; ++i) d += std::pow((cell[i] - other[i]) * voxel, 2);
      squared.push_back(d);
    }
    std::sort(squared.begin(), squared.end());
    const double mean = (squared[1] + squared[2] + squared[3]) / 3;
    for (std::size_t i = 0; i < 6; ++i)
      CHECK(std::abs(static_cast<double>(anchors.scaling[6 * row + i]) - 0.5 * std::log(mean)) < 1e-6);
    ++row;
  }
}

TEST_CASE("anchor/initialise: voxels round half to even (AN1)") {
  const std::vector<CloudPoint> cloud{{0.5f, 0, 0},  {-0.5f, 0, 0}, {1.5f, 0, 0},
                                      {-1.5f, 0, 0}, {2.5f, 0, 0},  {-2.5f, 0, 0}};
  const InitialAnchors<float> anchors = anchors_of(cloud, 1);
  REQUIRE(anchors.count() == 3);
  CHECK(anchors.position[0] == -2);
  CHECK(anchors.position[3] == 0);
  CHECK(anchors.position[6] == 2);
  // Negative control: half away from zero gives six cells.
  std::set<double> away;
  for (const CloudPoint& p : cloud) away.insert(std::round(static_cast<double>(p[0])));
  CHECK(away.size() == 6);
}

TEST_CASE("anchor/initialise: a cloud of one point many times gives one anchor (AN2, AN4)") {
  for (const double voxel : {0.0, 0.001}) {
    const InitialAnchors<float> anchors = anchors_of(std::vector<CloudPoint>(500, CloudPoint{1, 2, 3}), voxel);
    CHECK(anchors.count() == 1);
    CHECK(anchors.voxel_size > 0);
    for (const float s : anchors.scaling) CHECK(std::isfinite(s));
    for (std::size_t i = 0; i < 3; ++i) CHECK(std::abs(anchors.position[i] - static_cast<float>(i + 1)) < 1e-3f);
  }
  CHECK_FALSE(std::isfinite(std::log(0.0)));  // negative control of both: log of distance 0, and division by it
  // Most points duplicated: the median distance is 0, and the automatic size is still a length.
  std::vector<CloudPoint> cloud = random_cloud(100, 2);
  for (std::size_t i = 0; i < 70; ++i) cloud[i] = cloud[i % 3];
  const InitialAnchors<float> anchors = anchors_of(cloud, 0);
  CHECK(anchors.count() == 33);
  for (const float s : anchors.scaling) CHECK(std::isfinite(s));
}

TEST_CASE("anchor/initialise: fewer than four points") {
  for (std::size_t n = 1; n <= 3; ++n) {
    std::vector<CloudPoint> cloud;
    for (std::size_t i = 0; i < n; ++i) cloud.push_back({static_cast<float>(i), 0, 0});
    const InitialAnchors<float> anchors = anchors_of(cloud, 0.01);
    CHECK(anchors.count() == n);
    for (const float s : anchors.scaling) CHECK(std::isfinite(s));
    if (n == 2) CHECK(std::abs(anchors.scaling[0]) < 1e-6f);  // their distance is 1
  }
}

TEST_CASE("anchor/initialise: far voxels do not merge (AN3)") {
  std::vector<CloudPoint> cloud = random_cloud(300, 1);
  for (std::size_t i = 0; i < 60; ++i) {
    cloud.push_back({1e6f + 0.25f * static_cast<float>(i % 20), -1e6f + 0.25f * static_cast<float>(i / 20), 1e6f});
  }
  const double voxel = 0.001;
  const InitialAnchors<float> anchors = anchors_of(cloud, voxel);
  std::set<std::array<double, 3>> cells;
  std::set<std::uint64_t> packed;
  for (const CloudPoint& p : cloud) {
    std::array<double, 3> cell{};
    std::uint64_t key = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      cell[i] = std::nearbyint(static_cast<double>(p[i]) / voxel);
      key = key << 21 | (static_cast<std::uint64_t>(static_cast<std::int64_t>(cell[i])) & ((1u << 21) - 1));
    }
    cells.insert(cell);
    packed.insert(key % 1000003);  // any key of too few bits merges some
  }
  CHECK(anchors.count() == cells.size());
  CHECK(anchors.count() == 360);
  // Negative control: cells of 21 bits an axis wrap around, so that far points coincide with near ones.
  const double far = 1e6 / voxel;
  CHECK((static_cast<std::int64_t>(far) & ((1 << 21) - 1)) != static_cast<std::int64_t>(far));
}

TEST_CASE("anchor/initialise: the automatic voxel size is a length") {
  // Points on a grid of spacing h: three neighbours at distance h, so the size is h; the published value is h squared.
  std::vector<CloudPoint> cloud;
  for (int x = 0; x < 6; ++x) {
    for (int y = 0; y < 6; ++y) {
      for (int z = 0; z < 6; ++z)
        cloud.push_back({0.25f * static_cast<float>(x), 0.25f * static_cast<float>(y), 0.25f * static_cast<float>(z)});
    }
  }
  CHECK(std::abs(anchors_of(cloud, 0).voxel_size - 0.25) < 1e-12);
  CHECK(anchors_of(cloud, 0).count() == 216);
  CHECK(std::abs(anchors_of(cloud, -1, true).voxel_size - 0.0625) < 1e-12);
  // Scaling the scene scales the size: true for a length, false for the published area (negative control).
  for (CloudPoint& p : cloud) {
    for (float& x : p) x *= 8;
  }
  CHECK(std::abs(anchors_of(cloud, 0).voxel_size - 2) < 1e-12);
  CHECK(std::abs(anchors_of(cloud, 0, true).voxel_size - 8 * 0.0625) > 1);
}

TEST_CASE("anchor/initialise: the order of the points does not matter") {
  std::vector<CloudPoint> cloud = random_cloud(400, 1);
  const InitialAnchors<float> first = anchors_of(cloud, 0.05);
  std::reverse(cloud.begin(), cloud.end());
  const InitialAnchors<float> second = anchors_of(cloud, 0.05);
  CHECK(first.position == second.position);
  CHECK(first.scaling == second.scaling);
}

TEST_CASE("anchor/initialise: bad points are skipped and counted, a cloud of nothing else is an error") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  std::vector<CloudPoint> cloud = random_cloud(50, 1);
  cloud.push_back({nan, 0, 0});
  cloud.push_back({0, infinity, 0});
  cloud.push_back({0, 0, 3e38f});
  const InitialAnchors<float> anchors = anchors_of(cloud, 0.001);
  CHECK(anchors.skipped_points == 3);
  CHECK(anchors.count() == 50);
  for (const float x : anchors.position) CHECK(std::isfinite(x));
  CHECK_FALSE(initial_anchors<float>({}, {}).ok());
  const std::vector<CloudPoint> all_bad{{nan, nan, nan}};
  const auto bad = initial_anchors<float>(all_bad, {});
  REQUIRE_FALSE(bad.ok());
  CHECK_FALSE(bad.error().remedy.empty());
  const std::vector<CloudPoint> far{{3e38f, 0, 0}};
  CHECK_FALSE(initial_anchors<float>(far, {0.001}).ok());
}

TEST_CASE("anchor/initialise: no scale is greater than the greatest, which only a point that stands alone would have") {
  std::vector<CloudPoint> cloud = random_cloud(200, 1);
  cloud.push_back({90, 0, 0});
  InitialiseSettings settings{0.01};
  const auto free = initial_anchors<float>(cloud, settings);
  settings.greatest_scale = 16;
  const auto held = initial_anchors<float>(cloud, settings);
  REQUIRE((free.ok() && held.ok()));
  CHECK(free->position == held->position);
  std::size_t alone = 0;
  for (std::size_t i = 0; i < free->scaling.size(); ++i) {
    if (free->scaling[i] == held->scaling[i]) continue;
    ++alone;
    CHECK(std::exp(free->scaling[i]) > 80);  // the control: its distance from the others
    CHECK(std::exp(held->scaling[i]) == doctest::Approx(16));
  }
  CHECK(alone == 6);
}
