// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The laws N1 to N4 of splat/anchor/scaffold_anchors.hpp, and what a limit of detail leaves out.
#include "compmark/splat/anchor/level_of_detail.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/splat/anchor/scaffold_anchors.hpp"

namespace {

using namespace compmark;

/// A long row of anchors away from the camera, all of one size.
struct Avenue {
  static constexpr std::size_t anchors = 5000;
  std::vector<float> position, scaling;
  Camera<float> camera;

  Avenue() : position(3 * anchors), scaling(6 * anchors, std::log(0.01f)) {
    const Random random(3, 0, random_stage("avenue"));
    for (std::size_t i = 0; i < anchors; ++i) {
      const float depth = 1 + 0.02f * static_cast<float>(i);  // 1 to 101
      position[3 * i] = 0.2f * depth * static_cast<float>(random.centered(2 * i));
      position[3 * i + 1] = 0.2f * depth * static_cast<float>(random.centered(2 * i + 1));
      position[3 * i + 2] = depth;
    }
    camera.width = camera.height = 400;
    camera.fx = camera.fy = 500;
    camera.cx = camera.cy = 200;
  }
  template <class Anchors, Executor E>
  std::vector<std::uint32_t> visible(E& executor) const {
    AnchorColumns<const float> columns;
    columns.position = {position.data(), anchors, 3};
    columns.scaling = {scaling.data(), anchors, 6};
    Buffer<std::uint32_t> rows;
    VisibilityWorkspace workspace;
    Anchors::find_visible(columns, camera, PinholeLens{}, {}, rows, workspace, executor);
    return {rows.begin(), rows.end()};
  }
};

using All = ScaffoldAnchors<float>;
template <DetailLimit limit>
using Limited = LevelOfDetail<All, limit>;

static_assert(AnchorModel<All> && AnchorModel<Limited<DetailLimit{}>>);

}  // namespace

TEST_CASE("anchor/level_of_detail: what is far enough away to be smaller than the limit is left out, nothing else") {
  const Avenue avenue;
  SerialExecutor serial;
  const std::vector<std::uint32_t> all = avenue.visible<All>(serial);
  CHECK(all.size() == Avenue::anchors);
  CHECK(avenue.visible<Limited<DetailLimit{.least_pixels = 0}>>(serial) == all);
  // 0.01 world units at 500 pixels are 0.1 pixels at a depth of 50.
  const std::vector<std::uint32_t> near = avenue.visible<Limited<DetailLimit{.least_pixels = 0.1f}>>(serial);
  CHECK(std::is_sorted(near.begin(), near.end()));
  REQUIRE(near.size() > 2000);
  CHECK(avenue.position[3 * near.back() + 2] == doctest::Approx(50).epsilon(0.001));
  CHECK(near.back() + 1 == near.size());  // all nearer ones are there
  const std::vector<std::uint32_t> nearer = avenue.visible<Limited<DetailLimit{.least_pixels = 1}>>(serial);
  CHECK(nearer.size() < near.size() / 5);
  CHECK(std::includes(near.begin(), near.end(), nearer.begin(), nearer.end()));
}

TEST_CASE("anchor/level_of_detail: giants and broken numbers are not taken for small; same list at any thread count") {
  Avenue avenue;
  avenue.scaling[6 * 4000 + 4] = 200;  // exp is infinite: the naive size in pixels is, too
  avenue.scaling[6 * 4001 + 5] = std::numeric_limits<float>::infinity();
  avenue.position[3 * 10] = std::numeric_limits<float>::quiet_NaN();
  SerialExecutor serial;
  ThreadExecutor threads(3);
  const std::vector<std::uint32_t> rows = avenue.visible<Limited<DetailLimit{.least_pixels = 1}>>(serial);
  CHECK(std::find(rows.begin(), rows.end(), 4000u) != rows.end());
  CHECK(std::find(rows.begin(), rows.end(), 4001u) != rows.end());
  CHECK(std::find(rows.begin(), rows.end(), 10u) == rows.end());
  CHECK(rows == avenue.visible<Limited<DetailLimit{.least_pixels = 1}>>(threads));
}
