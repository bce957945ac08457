// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/threedgsw.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

using namespace compmark;

TEST_CASE(
    "baselines/threedgsw: what carries least is removed, and of the rest what carries little, amid detail, is split") {
  using Rows = std::vector<std::uint32_t>;
  const std::vector<double> largest{5e-8, 1e-8, 3e-7, 0, 8e-8, 2e-8};
  const std::vector<std::uint8_t> detailed{1, 1, 1, 1, 1, 0};
  const ThreeDGswRows rows = threedgsw_rows(largest, detailed, {1e-8, 8e-8, 0.1});
  CHECK(rows.kept == Rows{0, 2, 4, 5});
  CHECK(rows.split == Rows{0, 2});  // anchors 0 and 4, at their places among those that are kept
  const ThreeDGswRows none = threedgsw_rows(largest, detailed, {-1, -1, 0.1});
  CHECK(none.kept.size() == 6);
  CHECK(none.split.empty());
  // A model is never empty.
  CHECK(threedgsw_rows(largest, detailed, {1, 1, 0.1}).kept == Rows{2});
}
