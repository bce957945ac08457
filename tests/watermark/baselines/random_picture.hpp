// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Pictures of independent numbers in [0, 1), the same for a seed.
#pragma once

#include <compmark/core/random.hpp>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace compmark::testing {

/// [3, height, width]
inline std::vector<double> random_picture(int height, int width, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("test picture"));
  std::vector<double> picture(3 * static_cast<std::size_t>(height) * static_cast<std::size_t>(width));
  for (std::size_t i = 0; i < picture.size(); ++i) picture[i] = random.uniform(i);
  return picture;
}

}  // namespace compmark::testing
