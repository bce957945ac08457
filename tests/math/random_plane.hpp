// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A plane of centred noise, for the tests of filters and resizing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"

namespace compmark::testing {

template <class T>
[[nodiscard]] std::vector<T> random_plane(int height, int width, std::uint64_t seed = 1) {
  std::vector<T> plane;
  const Random random(seed, 0, random_stage("test"));
  for (std::size_t i = 0; i < static_cast<std::size_t>(height * width); ++i)
    plane.push_back(static_cast<T>(random.centered(i)));
  return plane;
}

}  // namespace compmark::testing
