// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Feature maps for the tests of convolutions: made up, laid out without padding, and read back.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/math/conv.hpp"

namespace compmark::testing {

/// Uniform in (-1/2, 1/2).
template <class T>
std::vector<T> noise(std::size_t n, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("tests/features"));
  std::vector<T> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<T>(random.uniform(i) - 0.5);
  return values;
}

template <class T>
FeatureView<const T> dense(const std::vector<T>& values, int channels, int height, int width) {
  const std::size_t w = static_cast<std::size_t>(width);
  return {values.data(), channels, height, width, w, w * static_cast<std::size_t>(height)};
}

/// Without what is between rows and planes.
template <class T>
std::vector<T> values_of(FeatureView<const T> view) {
  std::vector<T> values;
  for (int c = 0; c < view.channels; ++c) {
    for (int y = 0; y < view.height; ++y) values.insert(values.end(), view.row(c, y), view.row(c, y) + view.width);
  }
  return values;
}

}  // namespace compmark::testing
