// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The statistics as data: their rows follow every edit. What they gather is tested with the policy (growth.test.cpp).
#include "compmark/splat/anchor/growth_statistics.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

using namespace compmark;

namespace {

/// Every entry tells which row and offset it belongs to.
GrowthStatistics<float> numbered(std::size_t anchors, std::size_t offsets) {
  GrowthStatistics<float> s;
  s.prepare(anchors, offsets);
  for (std::size_t a = 0; a < anchors; ++a) {
    s.opacity_sum[a] = static_cast<float>(1 + a);
    s.visits[a] = static_cast<float>(100 + a);
    for (std::size_t k = 0; k < offsets; ++k) {
      s.gradient_sum[a * offsets + k] = static_cast<float>(1000 + 10 * a + k);
      s.gradient_count[a * offsets + k] = static_cast<float>(2000 + 10 * a + k);
    }
  }
  return s;
}

}  // namespace

TEST_CASE("anchor/growth_statistics: kept rows move whole, all offsets of them, and new rows start at zero (D2)") {
  constexpr std::size_t offsets = 3;
  GrowthStatistics<float> s = numbered(6, offsets);
  const std::vector<std::uint32_t> kept{0, 2, 5};
  s.edit_rows({kept, 2});
  REQUIRE(s.anchors() == 5);
  REQUIRE(s.slots() == 5 * offsets);
  const GrowthStatistics<float> old = numbered(6, offsets);
  for (std::size_t row = 0; row < 5; ++row) {
    const bool fresh = row >= kept.size();
    CHECK(s.opacity_sum[row] == (fresh ? 0.0f : old.opacity_sum[kept[row]]));
    CHECK(s.visits[row] == (fresh ? 0.0f : old.visits[kept[row]]));
    for (std::size_t k = 0; k < offsets; ++k) {
      CHECK(s.gradient_sum[row * offsets + k] == (fresh ? 0.0f : old.gradient_sum[kept[row] * offsets + k]));
      CHECK(s.gradient_count[row * offsets + k] == (fresh ? 0.0f : old.gradient_count[kept[row] * offsets + k]));
    }
  }
}

TEST_CASE("anchor/growth_statistics: a second view adds, an unseen Gaussian's norm is not even looked at") {
  GrowthStatistics<float> s;
  s.prepare(3, 2);
  SerialExecutor executor;
  const std::array<std::uint32_t, 2> visible{2, 0};
  const std::array<float, 2> opacity{0.5f, 0.25f};
  const std::array<std::uint32_t, 3> slot{5, 0, 1};
  const std::array<std::uint8_t, 3> on_screen{1, 0, 1};
  const std::array<float, 3> norm{0.75f, std::numeric_limits<float>::quiet_NaN(), 2.0f};
  for (int view = 0; view < 2; ++view) s.add_view({visible, opacity, slot}, on_screen, norm, executor);
  CHECK(std::vector<float>(s.visits.begin(), s.visits.end()) == std::vector<float>{2, 0, 2});
  CHECK(std::vector<float>(s.opacity_sum.begin(), s.opacity_sum.end()) == std::vector<float>{0.5f, 0, 1});
  CHECK(std::vector<float>(s.gradient_sum.begin(), s.gradient_sum.end()) == std::vector<float>{0, 4, 0, 0, 0, 1.5f});
  CHECK(std::vector<float>(s.gradient_count.begin(), s.gradient_count.end()) == std::vector<float>{0, 2, 0, 0, 0, 2});
}

TEST_CASE("anchor/growth_statistics: of no anchors nothing is kept, and prepare forgets") {
  GrowthStatistics<float> s;
  s.edit_rows({{}, 0});
  CHECK(s.anchors() == 0);
  s = numbered(4, 2);
  s.edit_rows({{}, 0});  // everything pruned
  CHECK(s.anchors() == 0);
  CHECK(s.slots() == 0);
  s = numbered(4, 2);
  s.prepare(4, 2);
  for (const float value : s.gradient_sum) CHECK(value == 0);
  for (const float value : s.visits) CHECK(value == 0);
}
