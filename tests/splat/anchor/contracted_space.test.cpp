// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The contraction against its closed forms, the laws S1 and S2 of splat/anchor/space.hpp, and what it is for: a far field in
// few cells of the size that it is seen at. Negative control throughout: cells of the world.
#include "compmark/splat/anchor/contracted_space.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <set>
#include <type_traits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/splat/anchor/growth.hpp"
#include "compmark/splat/anchor/initialise.hpp"

using namespace compmark;

static_assert(!present<EuclideanSpace> && std::is_empty_v<EuclideanSpace> && present<ContractedSpace>);

namespace {

using Point = std::array<double, 3>;
constexpr ContractedSpace space{{0.7, -1.2, 0.4}, 2.5};

Point direction(const Random& random, std::uint64_t i) {
  const double z = 2 * random.uniform(2 * i) - 1, flat = std::sqrt(1 - z * z);
  const double angle = 2 * std::numbers::pi * random.uniform(2 * i + 1);
  return {flat * std::cos(angle), flat * std::sin(angle), z};
}
/// A point `radii` radii of the ball from its origin.
Point at(const ContractedSpace& s, const Point& towards, double radii) {
  Point p{};
  for (std::size_t c = 0; c < 3; ++c) p[c] = s.origin[c] + radii * s.radius * towards[c];
  return p;
}
double distance(const Point& a, const Point& b) { return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]); }
std::array<float, 3> rounded(const Point& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

}  // namespace

TEST_CASE("anchor/contracted_space: the inverse inverts, and everything fits into two radii") {
  const Random random(3, 0, random_stage("test contraction"));
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double radii = std::pow(10.0, -2 + 4.999 * random.uniform(10000 + i));  // 0.01 … 998
    const Point p = at(space, direction(random, i), radii);
    const Point y = space.contract(p.data());
    const double s = distance(y, space.origin) / space.radius;
    CHECK(s < 2);
    if (radii > 1.001) CHECK(s == doctest::Approx(2 - 1 / radii).epsilon(1e-13));
    // Rounding of y by 2e-16 of two radii is one of radii^2 at the point.
    CHECK(distance(space.expand(y), p) <= 4e-15 * space.radius * std::max(1.0, radii * radii));
  }
  for (const double radii : {1e6, 1e30, 1e150}) {
    const Point p = at(space, {0, 0.6, 0.8}, radii);
    const Point y = space.contract(p.data());
    CHECK(distance(y, space.origin) == doctest::Approx(2 * space.radius));
    CHECK(distance(space.expand(y), space.origin) == doctest::Approx(1000 * space.radius));  // as far as places go
  }
  const double bad[3]{NAN, 0, 0}, infinite[3]{0, HUGE_VAL, 0};
  Cell cell;
  CHECK_FALSE(space.cell_of(bad, 0.01, cell));
  CHECK_FALSE(space.cell_of(infinite, 0.01, cell));
}

TEST_CASE(
    "anchor/contracted_space: its Jacobian is 1 / r^2 along and (2 - 1 / r) / r across, without a step at the ball") {
  const Random random(4, 0, random_stage("test contraction"));
  for (const double radii : {0.3, 0.999, 1.001, 1.5, 4.0, 30.0, 1000.0}) {
    const Point towards = direction(random, static_cast<std::uint64_t>(radii * 1000));
    const Point p = at(space, towards, radii);
    Point across{towards[1], -towards[0], 0};
    const double norm = std::hypot(across[0], across[1]);
    for (double& x : across) x /= norm;
    const auto derivative = [&](const Point& along) {
      const double h = 1e-5 * std::max(1.0, radii) * 1e-1;
      Point low = p, high = p;
      for (std::size_t c = 0; c < 3; ++c) low[c] -= h * along[c], high[c] += h * along[c];
      return distance(space.contract(high.data()), space.contract(low.data())) / (2 * h);
    };
    const bool outside = radii > 1;
    const double radial = derivative(towards), tangential = derivative(across);
    CHECK(radial == doctest::Approx(outside ? 1 / (radii * radii) : 1).epsilon(1e-4));
    CHECK(tangential == doctest::Approx(outside ? (2 - 1 / radii) / radii : 1).epsilon(1e-6));
    CHECK(space.stretch(p.data()) == doctest::Approx(1 / tangential).epsilon(1e-6));
    CHECK(radial >= 0.999e-6);  // docs/spec/effects.md, 4: at the farthest place that is given
  }
}

TEST_CASE("anchor/contracted_space: inside the ball cells are those of the world, to the bit (S2)") {
  const Random random(5, 0, random_stage("test contraction"));
  std::size_t differ = 0;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const double radii = 1.5 * random.uniform(10000 + i);
    const Point p = at(space, direction(random, i), radii);
    Cell contracted, world;
    REQUIRE(space.cell_of(p.data(), 0.03, contracted));
    REQUIRE(cell_of(p.data(), 0.03, world));
    if (radii < 1) {
      CHECK(contracted == world);
      CHECK(space.stretch(p.data()) == 1);
      if (radii < 0.98) CHECK(space.center(contracted, 0.03) == EuclideanSpace::center(world, 0.03));
    } else {
      differ += contracted != world;
    }
  }
  CHECK(differ > 700);  // of about 1,000 outside
}

TEST_CASE("anchor/contracted_space: the centre of a cell lies in the cell (S1)") {
  for (const double size : {0.9, 0.05, 0.0125}) {
    const Random random(6, 0, random_stage("test contraction"));
    std::size_t in_range = 0;
    for (std::uint64_t i = 0; i < 4000; ++i) {
      const Point p = at(space, direction(random, i), std::pow(10.0, -1 + 5 * random.uniform(10000 + i)));
      Cell cell, again;
      REQUIRE(space.cell_of(p.data(), size, cell));
      const Point center = space.center(cell, size);
      CHECK(distance(center, space.origin) <= 1000.001 * space.radius);
      if (!space.in_range(cell, size)) continue;
      ++in_range;
      REQUIRE(space.cell_of(center.data(), size, again));
      CHECK(again == cell);
    }
    CHECK(in_range > 1500);
  }
}

TEST_CASE("anchor/contracted_space: turns, moves and scales with the scene") {
  // A turn about an oblique axis, a scale and a move: the contraction follows to rounding.
  const double c = std::cos(0.7), s = std::sin(0.7), scale = 37.5;
  const auto similar = [&](const Point& p) {
    const Point q{c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]};
    return Point{scale * (c * q[0] + s * q[2]) + 5, scale * q[1] - 70, scale * (c * q[2] - s * q[0]) + 900};
  };
  const ContractedSpace moved{similar(space.origin), scale * space.radius};
  const Random random(7, 0, random_stage("test contraction"));
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Point p = at(space, direction(random, i), std::pow(10.0, -1 + 3 * random.uniform(10000 + i)));
    const Point q = similar(p);
    CHECK(distance(moved.contract(q.data()), similar(space.contract(p.data()))) < 1e-11 * scale);
    CHECK(moved.stretch(q.data()) == doctest::Approx(space.stretch(p.data())).epsilon(1e-10));
  }
  // Cells have axes: they follow what maps the grid onto itself. Axes exchanged, one reflected, scale 4, a move by 96
  // cells.
  const auto grid = [](const Point& p) { return Point{4 * p[1], -4 * p[2], 4 * p[0] + 24}; };
  const ContractedSpace origin{{0.5, -0.25, 0.125}, 2}, on_grid{grid(origin.origin), 8};
  for (std::uint64_t i = 0; i < 500; ++i) {
    const Point p = at(origin, direction(random, i), std::pow(10.0, -1 + 3 * random.uniform(10000 + i)));
    Cell cell, other;
    REQUIRE(origin.cell_of(p.data(), 0.0625, cell));
    REQUIRE(on_grid.cell_of(grid(p).data(), 0.25, other));
    CHECK(other == Cell{cell.y, -cell.z, cell.x + 96});
  }
}

TEST_CASE("anchor/contracted_space: a far field in few cells of the size that it is seen at, and none is lost") {
  // A near cloud, a wall 50 radii away as densely triangulated as its photographs (40,000 points over 0.2 radians: one
  // each 1/1000), and points up to 1e9 radii away.
  const double voxel = 0.004 * space.radius;
  std::vector<std::array<float, 3>> near, wall, remote;
  const Random random(8, 0, random_stage("test contraction"));
  for (std::uint64_t i = 0; i < 500; ++i)
    near.push_back(rounded(at(space, direction(random, i), 0.9 * random.uniform(90000 + i))));
  for (int i = 0; i < 200; ++i) {
    for (int j = 0; j < 200; ++j) {
      const Point towards{1, 0.001 * (i - 100) + 3e-5 * (j % 7), 0.001 * (j - 100)};
      wall.push_back(rounded(at(space, towards, 50)));
    }
  }
  for (std::uint64_t i = 0; i < 300; ++i)
    remote.push_back(
        rounded(at(space, direction(random, 5000 + i), std::pow(10.0, 7 + 2 * random.uniform(70000 + i)))));

  const auto contracted = initial_anchors<float>(wall, {voxel}, space), world = initial_anchors<float>(wall, {voxel});
  REQUIRE(contracted.ok());
  REQUIRE(world.ok());
  MESSAGE("anchors of the wall: ", contracted->count(), " contracted, ", world->count(), " in the world");
  CHECK(world->count() == 40000);      // the control: an anchor for each point
  CHECK(contracted->count() < 14000);  // 0.2 radians in cells of 1/500: 10,000

  const auto far_contracted = initial_anchors<float>(remote, {voxel}, space),
             far_world = initial_anchors<float>(remote, {voxel});
  REQUIRE(far_contracted.ok());
  REQUIRE(far_contracted->skipped_points == 0);
  CHECK(far_contracted->count() == 300);
  CHECK((!far_world.ok() || far_world->skipped_points > 100));  // the control: 2^31 voxels are 8.6e6 radii
  for (const float x : far_contracted->position) CHECK(std::isfinite(x));

  // As large as seen from the cameras, wherever they are: a new anchor is 1/2 to 1 voxel / radius wide, in radians. In the
  // world it vanishes.
  for (const double radii : {1.0, 2.0, 10.0, 100.0, 1000.0}) {
    const Point p = at(space, {0, 0, 1}, radii);
    const double angle = voxel * space.stretch(p.data()) / (radii * space.radius);
    CHECK(angle <= 0.004 * (1 + 1e-12));
    CHECK(angle >= 0.002);
    if (radii > 10) CHECK(voxel / (radii * space.radius) < 0.0002);
  }

  const auto same = initial_anchors<float>(near, {voxel}, space), plain = initial_anchors<float>(near, {voxel});
  REQUIRE(same.ok());
  CHECK(same->position == plain->position);
  CHECK(same->scaling == plain->scaling);
  const auto same_auto = initial_anchors<float>(near, {0}, space), plain_auto = initial_anchors<float>(near, {0});
  CHECK(same_auto->voxel_size == plain_auto->voxel_size);
}

namespace {

/// Anchors at the given places, one Gaussian each on its anchor, all of them judged, visible and of high gradient.
struct Growing {
  ParameterArena<float> arena;
  AnchorHandles handles;
  GradientGrowth<float>::Settings settings;
  GradientGrowth<float>::State state;

  explicit Growing(const std::vector<std::array<float, 3>>& places) {
    handles.position = arena.add("anchor.position", places.size(), 3, RowKind::anchor, BlockRole::rendering,
                                 LearningSchedule::fixed());
    handles.offset =
        arena.add("anchor.offset", places.size(), 3, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    handles.scaling =
        arena.add("anchor.scaling", places.size(), 6, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    handles.feature =
        arena.add("anchor.feature", places.size(), 2, RowKind::anchor, BlockRole::rendering, LearningSchedule::fixed());
    settings.offsets = 1;
    settings.update_depth = 1;
    settings.init_factor = 1;
    GradientGrowth<float>(settings).prepare(places.size(), state);
    const AnchorColumns<float> columns = anchor_values(arena, handles);
    for (std::size_t a = 0; a < places.size(); ++a) {
      std::copy(places[a].begin(), places[a].end(), columns.position.row(a));
      std::fill_n(columns.scaling.row(a), 6, 3.0f);
      columns.offset(a, 1) = 0.9f;  // the Gaussian stands 18 beside its anchor
      state.statistics.gradient_count[a] = 100;
      state.statistics.gradient_sum[a] = 1;
      state.statistics.visits[a] = 100;
      state.statistics.opacity_sum[a] = 100;
    }
  }
  template <class Context>
  GrowthReport adapt(const Context& context) {
    return GradientGrowth<float>(settings).adapt(arena, handles, state, context,
                                                 [](const RowEdit&, const ArenaLayout&) {});
  }
  [[nodiscard]] std::vector<std::uint32_t> bits() const {
    std::vector<std::uint32_t> result;
    for (const float x : arena.all_values()) result.push_back(std::bit_cast<std::uint32_t>(x));
    return result;
  }
};

}  // namespace

TEST_CASE("anchor/growth: in contracted space the far field grows as coarsely as it is seen, the near one as before") {
  const double voxel = 0.02 * space.radius;
  std::vector<std::array<float, 3>> wall;
  for (int i = 0; i < 60; ++i) {
    for (int j = 0; j < 60; ++j) wall.push_back(rounded(at(space, {1, 0.002 * (i - 30), 0.002 * (j - 30)}, 40)));
  }
  Growing contracted(wall), world(wall);
  const SpaceAdjustmentInputs<ContractedSpace> context{{1, 100, voxel, {}}, space};
  const GrowthReport few = contracted.adapt(context), many = world.adapt(AdjustmentInputs{1, 100, voxel, {}});
  MESSAGE("born at a wall of 60 x 60 Gaussians 40 radii away: ", few.grown, " contracted, ", many.grown,
          " in the world");
  CHECK(many.grown > 1600);  // half of 3,600 win the draw, and each has a cell of its own
  CHECK(few.grown > 20);
  CHECK(few.grown < 300);  // 0.12 radians in cells of 0.02 / (2 - 1/40): 12 x 12
  const AnchorColumns<float> born = anchor_values(contracted.arena, contracted.handles);
  for (std::size_t a = wall.size(); a < born.rows(); ++a) {
    const Point p{static_cast<double>(born.position(a, 0)), static_cast<double>(born.position(a, 1)),
                  static_cast<double>(born.position(a, 2))};
    const double across = voxel * space.stretch(p.data());
    CHECK(static_cast<double>(born.scaling(a, 0)) == doctest::Approx(std::log(across)).epsilon(1e-5));
    CHECK(across / distance(p, space.origin) == doctest::Approx(0.01).epsilon(0.02));
  }
  // The published limit of the base scale is 1.05 units of the world: here it is that of the cells.
  CHECK(anchor_values(world.arena, world.handles).scaling(0, 3) == doctest::Approx(0.05));
  CHECK(born.scaling(0, 3) == 3.0f);
  CHECK(born.scaling(0, 3) < 0.05 + std::log(space.stretch(born.position.row(0))));

  std::vector<std::array<float, 3>> near;
  const Random random(9, 0, random_stage("test contraction"));
  for (std::uint64_t i = 0; i < 400; ++i)
    near.push_back(rounded(at(space, direction(random, i), 0.3 * random.uniform(90000 + i))));
  const ContractedSpace wide{space.origin, 20};  // all Gaussians are inside
  Growing a(near), b(near);
  CHECK(a.adapt(SpaceAdjustmentInputs<ContractedSpace>{{1, 100, voxel, {}}, wide}).grown > 100);
  b.adapt(AdjustmentInputs{1, 100, voxel, {}});
  CHECK(a.bits() == b.bits());
}
