// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Rows of numbers for searches among them.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"

namespace compmark::testing {

/// Rows that differ much in few directions, not along the columns.
inline std::vector<float> spread_rows(std::size_t rows, std::size_t columns, std::uint64_t seed) {
  const Random random(seed, 0, random_stage("test/row groups"));
  std::vector<float> made(rows * columns);
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t k = 0; k < columns; ++k) {
      const std::size_t at = row * columns + k;
      made[at] =
          static_cast<float>(3 * random.normal(row) * std::sin(static_cast<double>(k)) + random.normal(9'000 + at));
    }
  }
  return made;
}

}  // namespace compmark::testing
