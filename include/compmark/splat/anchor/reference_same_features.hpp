// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// same_features by its words: the distances of all pairs. For tests and for the benchmark. Cost: N M C products, 12 s
// of a thread for 80,000 rows of 32 numbers against half of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "compmark/core/views.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/splat/anchor/same_features.hpp"

namespace compmark {

/// As same_features has it. Memory: 12 bytes a row, and 1,024 rows of `among`.
[[nodiscard]] inline std::vector<std::optional<std::uint32_t>> reference_same_features(MatrixView<const float> one,
                                                                                       MatrixView<const float> among) {
  using Lane = Pack<float, 1>;
  constexpr float far = std::numeric_limits<float>::infinity();
  constexpr std::size_t tile = 1024;
  struct Nearest {
    float first = far, second = far;  ///< squared distances
    std::uint32_t row = 0;
    void look(float distance, std::size_t other) {
      if (distance < first) {
        second = std::exchange(first, distance);
        row = static_cast<std::uint32_t>(other);
      } else if (distance < second) {
        second = distance;
      }
    }
  };
  std::vector<Nearest> there(one.rows), back(among.rows);
  std::vector<float> columns(tile * one.columns), distance(tile);
  for (std::size_t begin = 0; begin < among.rows; begin += tile) {
    const std::size_t count = std::min(tile, among.rows - begin);
    for (std::size_t k = 0; k < one.columns; ++k) {
      for (std::size_t j = 0; j < count; ++j) columns[k * tile + j] = among(begin + j, k);
    }
    for (std::size_t row = 0; row < one.rows; ++row) {
      std::fill_n(distance.begin(), count, 0.0f);
      for (std::size_t k = 0; k < one.columns; ++k) {
        const float mine = one(row, k);
        const float* const theirs = columns.data() + k * tile;
        for (std::size_t j = 0; j < count; ++j) {  // squared_row_distance, of many rows at once
          const Lane d(mine - theirs[j]);
          distance[j] = fma(d, d, Lane(distance[j])).native;
        }
      }
      for (std::size_t j = 0; j < count; ++j) {  // one that is no number is nearest to nothing
        there[row].look(distance[j], begin + j);
        back[begin + j].look(distance[j], row);
      }
    }
  }
  std::vector<std::optional<std::uint32_t>> same(one.rows);
  for (std::size_t row = 0; row < one.rows; ++row) {
    const Nearest& nearest = there[row];
    if (nearest.first < same_feature_ratio * nearest.second && back[nearest.row].row == row) same[row] = nearest.row;
  }
  return same;
}

}  // namespace compmark
