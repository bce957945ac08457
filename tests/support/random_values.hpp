// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Random numbers as input of a test: of a stage of its own, so that no two tests share a stream.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "compmark/core/random.hpp"

namespace compmark::testing {

/// Standard normal.
template <class T>
[[nodiscard]] std::vector<T> normals(std::size_t n, std::uint64_t seed, std::string_view stage) {
  const Random random(seed, 0, random_stage(stage));
  std::vector<T> values(n);
  for (std::size_t i = 0; i < n; ++i) values[i] = static_cast<T>(random.normal(i));
  return values;
}

}  // namespace compmark::testing
