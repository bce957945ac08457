// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/core/views.hpp>
#include <compmark/splat/anchor/reference_same_features.hpp>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

TEST_CASE("anchor/reference_same_features: each other's nearest, if the second is farther by more than ten sevenths") {
  // Rows of one number, by hand: 0 and 0.1 are each other's; 5 stands between 4.8 and 5.21, 1.05 of it apart; the
  // nearest of 9 is 8, whose nearest is 7.9.
  const std::vector<float> one{0, 5, 9, 7.9f}, among{8, 0.1f, 4.8f, 5.21f};
  const auto found = compmark::reference_same_features({one.data(), 4, 1}, {among.data(), 4, 1});
  REQUIRE(found.size() == 4);
  CHECK(found[0] == std::optional<std::uint32_t>(1));
  CHECK_FALSE(found[1].has_value());
  CHECK_FALSE(found[2].has_value());
  CHECK(found[3] == std::optional<std::uint32_t>(0));
  CHECK(compmark::reference_same_features({one.data(), 0, 1}, {among.data(), 4, 1}).empty());
}
