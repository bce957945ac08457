// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/integer/near_anchors.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <tuple>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

TEST_CASE("integer/near_anchors: the mean of the three nearest of the 64 before, as a search of all of them finds it") {
  constexpr std::size_t channels = 3, anchors = 300;
  const Random random(6, 1, random_stage("near anchors"));
  NearAnchors near(channels);
  std::vector<Voxel> voxels;
  std::vector<std::vector<int>> deviations;
  for (std::size_t i = 0; i < anchors; ++i) {
    Voxel voxel{};
    for (std::size_t axis = 0; axis < 3; ++axis)
      voxel[axis] = static_cast<std::int32_t>(random.bits(8 * i + axis) % 9) - 4;  // many distances are equal
    near.begin(voxel);
    std::vector<std::tuple<std::int64_t, std::size_t, std::size_t>> order;  // distance, how long ago, which
    for (std::size_t back = 1; back <= std::min<std::size_t>(i, 64); ++back) {
      const Voxel& other = voxels[i - back];
      std::int64_t far = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) far += std::abs(std::int64_t{voxel[axis]} - other[axis]);
      order.emplace_back(far, back, i - back);
    }
    std::sort(order.begin(), order.end());
    const std::size_t found = std::min<std::size_t>(3, order.size());
    REQUIRE(near.near().size() == (i == 0 ? 0 : channels));
    for (std::size_t c = 0; found != 0 && c < channels; ++c) {
      double sum = 0;
      for (std::size_t k = 0; k < found; ++k) sum += deviations[std::get<2>(order[k])][c];
      REQUIRE(std::abs(near.near()[c] - sum / static_cast<double>(found)) <
              0.6);  // rounded, and 21,845 is not 2^16 / 3
    }
    voxels.push_back(voxel);
    deviations.emplace_back(channels, 0);
    for (std::size_t c = 0; c < channels; ++c) {
      if (random.uniform(8 * i + 3 + c) < 0.3) continue;  // not coded
      deviations.back()[c] = static_cast<int>(random.bits((1 << 20) + 8 * i + c) % 4097) - 2048;
      near.keep(c, deviations.back()[c]);
    }
  }
}

TEST_CASE("integer/near_anchors: voxels at both ends of their range are far apart, not near") {
  constexpr std::int32_t least = std::numeric_limits<std::int32_t>::min(),
                         most = std::numeric_limits<std::int32_t>::max();
  NearAnchors near(1);
  for (int i = 0; i < 3; ++i) {
    near.begin({most, most, most});
    near.keep(0, 300);
  }
  for (int i = 0; i < 3; ++i) {
    near.begin({least, least, least});
    near.keep(0, -300);
  }
  near.begin({most, most, most});
  CHECK(near.near()[0] == 300);
}

}  // namespace
