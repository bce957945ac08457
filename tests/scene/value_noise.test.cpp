// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <compmark/scene/value_noise.hpp>

#include <cmath>
#include <cstdint>

using namespace compmark;

TEST_CASE("scene/value_noise: any memory gives the same noise; it joins without a step between cells") {
  const Random random(5, 0, random_stage("value noise test"));
  const ValueNoise noise(random);
  ValueNoise::Cell kept;
  double least = 1, most = 0;
  for (std::uint64_t i = 0; i < 5000; ++i) {
    // a walk: most steps stay within a cell, some leave it along one axis alone
    const double s = 0.01 * static_cast<double>(i);
    const Vector3 p{s - 25, 0.37 * s - 9, 3 * random.uniform(i) - 1};
    ValueNoise::Cell fresh;
    const double value = noise.at(p, fresh);
    CAPTURE(i);
    CHECK(noise.at(p, kept) == value);
    least = std::fmin(least, value);
    most = std::fmax(most, value);
    // Across the wall x = round(x): continuous, within the slope 1.5 of the weights.
    const double wall = std::round(p.x);
    ValueNoise::Cell left, right;
    CHECK(std::abs(noise.at({wall - 1e-9, p.y, p.z}, left) - noise.at({wall + 1e-9, p.y, p.z}, right)) < 1e-8);
  }
  CHECK(least >= 0);
  CHECK(most <= 1);
  CHECK(most - least > 0.6);
  // Negative control: a cell that says it is another one is believed, so the comparison above can fail.
  ValueNoise::Cell wrong;
  static_cast<void>(noise.at({0.5, 0.5, 0.5}, wrong));
  wrong.cell = {7, 7, 7};
  ValueNoise::Cell fresh;
  CHECK(noise.at({7.5, 7.5, 7.5}, wrong) != noise.at({7.5, 7.5, 7.5}, fresh));
}
