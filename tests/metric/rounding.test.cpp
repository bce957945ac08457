// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/metric/rounding.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/metric/psnr.hpp"

namespace {

using namespace compmark;

TEST_CASE("metric/rounding: 8 bits round to the nearest level and clamp (SH4)") {
  CHECK(to_8bit(0.0f) == 0);
  CHECK(to_8bit(1.0f) == 255);
  CHECK(to_8bit(-3.0f) == 0);
  CHECK(to_8bit(7.0f) == 255);
  CHECK(to_8bit(std::nanf("")) == 0);
  CHECK(to_8bit(INFINITY) == 255);
  CHECK(to_8bit(-INFINITY) == 0);
  for (int level = 0; level < 256; ++level) {
    CHECK(to_8bit(static_cast<float>(level) / 255.0f) == level);
    if (level < 255) {
      CHECK(to_8bit((static_cast<float>(level) + 0.499f) / 255.0f) == level);
      CHECK(to_8bit((static_cast<float>(level) + 0.501f) / 255.0f) == level + 1);
    }
  }
}

TEST_CASE("metric/rounding: rounding alone is 58.92 dB and at most half a level") {
  const int size = 256;
  std::vector<float> a(3 * static_cast<std::size_t>(size * size));
  const Random random(3, 0, random_stage("test"));
  for (std::size_t i = 0; i < a.size(); ++i) a[i] = static_cast<float>(random.uniform(i));
  std::vector<float> b(a.size());
  round_to_8bit<float>({a.data(), 3, size, size}, {b.data(), 3, size, size});
  float worst = 0;
  for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::abs(a[i] - b[i]));
  float cut = 0;  // negative control: the cast alone, which rounds down
  for (const float value : a)
    cut = std::max(cut, value - static_cast<float>(static_cast<std::uint8_t>(255 * value)) / 255);
  CHECK(cut > 0.99f / 255);
  CHECK(worst <= 0.5f / 255 + 1e-7f);
  CHECK(worst > 0.499f / 255);
  CHECK(psnr({a.data(), 3, size, size}, {b.data(), 3, size, size}) ==
        doctest::Approx(58.92).epsilon(0.02 / 58.92));  // 10 log10(12 * 255^2)
  std::vector<float> c = b;
  round_to_8bit<float>({c.data(), 3, size, size}, {c.data(), 3, size, size});
  CHECK(c == b);  // idempotent, in place
}

}  // namespace
