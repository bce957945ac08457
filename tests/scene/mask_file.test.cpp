// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/mask_file.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "support/png_text.hpp"
#include "support/scene_files.hpp"

using namespace compmark;
using namespace compmark::testing;

namespace {

using Values = std::vector<int>;

MaskFile read(int bits, int type, const std::function<Values(int, int)>& pixel) {
  const TemporaryFolder folder;
  put(folder.path() / "m.png", png_text(5, 3, bits, type, pixel));
  const Result<MaskFile> mask = read_mask_file(folder.path() / "m.png");
  REQUIRE(mask.ok());
  return *mask;
}

}  // namespace

TEST_CASE("scene/mask_file: all bits of a file arrive, whatever its channels") {
  const MaskFile wide = read(16, 0, [](int x, int y) { return Values{1000 * x + y}; });
  CHECK(wide.size() == 15);
  CHECK(wide.white == 65535);
  CHECK(!wide.has_alpha());
  for (std::size_t i = 0; i < 15; ++i) CHECK(wide.value(i) == static_cast<int>(1000 * (i % 5) + i / 5));
  const MaskFile color = read(8, 6, [](int x, int y) { return Values{10 * x, 50, 7, 20 * y}; });
  CHECK(color.white == 255);
  REQUIRE(color.has_alpha());
  for (std::size_t i = 0; i < 15; ++i) {
    const int x = static_cast<int>(i % 5), y = static_cast<int>(i / 5);
    CHECK(color.alpha(i) == 20 * y);
    CHECK(color.value(i) == std::max(50, 10 * x));
    CHECK(color.darkest(i) == std::min(7, 10 * x));
  }
}

TEST_CASE("scene/mask_file: weights are the level, or whether there is any, of the colour or of the alpha channel") {
  const MaskFile mask = read(8, 4, [](int x, int y) { return Values{60 * x, 100 * y}; });
  const auto weights = [&](MaskReading reading) { return mask_weights(mask, reading); };
  const MaskFile wide = read(16, 0, [](int x, int) { return Values{256 * 50 * x + 255}; });
  for (std::size_t i = 0; i < 15; ++i) {
    const int x = static_cast<int>(i % 5), y = static_cast<int>(i / 5);
    CHECK(weights(MaskReading::level)[i] == 60 * x);
    CHECK(weights(MaskReading::any)[i] == (x > 0 ? 255 : 0));
    CHECK(weights(MaskReading::alpha)[i] == 100 * y);
    CHECK(weights(MaskReading::any_alpha)[i] == (y > 0 ? 255 : 0));
    CHECK(mask_weights(wide, MaskReading::level)[i] == 50 * x);  // the upper eight bits
    CHECK(mask_weights(wide, MaskReading::any)[i] == 255);       // 255 of 65535 is not black
    CHECK(mask_weights(wide, MaskReading::alpha)[i] == 50 * x);  // there is none: the colour
  }
}
