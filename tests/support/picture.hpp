// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"

namespace compmark::testing {

/// Smooth colours with texture, [3, side, side] in (0, 1); no two seeds alike.
inline std::vector<float> textured_picture(std::size_t side, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("test/calibrate picture"));
  std::vector<float> pixels(3 * side * side);
  for (std::size_t c = 0; c < 3; ++c) {
    const double u = 0.05 + 0.1 * random.uniform(2 * c), v = 0.05 + 0.1 * random.uniform(2 * c + 1);
    for (std::size_t i = 0; i < side * side; ++i) {
      const double wave = std::sin(u * static_cast<double>(i % side)) * std::cos(v * static_cast<double>(i / side));
      pixels[c * side * side + i] = static_cast<float>(0.5 + 0.25 * wave + 0.15 * (random.uniform(100 + i) - 0.5));
    }
  }
  return pixels;
}

}  // namespace compmark::testing
