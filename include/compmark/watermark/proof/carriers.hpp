// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Secret carriers: `bits` orthonormal directions in a space of `dimension` features, uniform over all such frames
// (normal numbers, orthogonalised twice; docs/spec/watermark.md, 2). They are made from random bytes, 16 a number,
// which the key derives from its secret under a label of its own. Someone with the decoder but without the key does not
// know the directions. Cost: bits^2 dimension multiply-adds, once.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {

/// Bytes that make_carriers() takes.
[[nodiscard]] constexpr std::size_t carrier_bytes(int bits, int dimension) {
  return 16 * static_cast<std::size_t>(bits) * static_cast<std::size_t>(dimension);
}

/// [bits, dimension] with orthonormal rows; bits <= dimension. The same bytes give the same carriers.
[[nodiscard]] inline std::vector<double> make_carriers(std::span<const std::byte> random_bytes, int bits,
                                                       int dimension) {
  COMPMARK_ASSERT(bits >= 1 && bits <= dimension && random_bytes.size() == carrier_bytes(bits, dimension),
                  "make_carriers: sizes");
  const std::size_t rows = static_cast<std::size_t>(bits), columns = static_cast<std::size_t>(dimension);
  std::vector<double> carriers(rows * columns);
  const auto uniform = [&](std::size_t at) {  // in (0, 1), from 52 bits, little-endian
    std::uint64_t word = 0;
    for (std::size_t k = 8; k-- > 0;) word = word << 8 | std::to_integer<std::uint64_t>(random_bytes[at + k]);
    return (static_cast<double>(word >> 12) + 0.5) * 0x1p-52;
  };
  for (std::size_t i = 0; i < carriers.size(); ++i)  // Box and Muller
    carriers[i] = std::sqrt(-2 * std::log(uniform(16 * i))) * std::cos(2 * std::numbers::pi * uniform(16 * i + 8));
  for (std::size_t r = 0; r < rows; ++r) {
    double* const row = carriers.data() + r * columns;
    for (int pass = 0; pass < 2; ++pass) {  // twice is enough (Giraud, Langou 2005)
      for (std::size_t other = 0; other < r; ++other) {
        const double* const carrier = carriers.data() + other * columns;
        double along = 0;
        for (std::size_t c = 0; c < columns; ++c) along += row[c] * carrier[c];
        for (std::size_t c = 0; c < columns; ++c) row[c] -= along * carrier[c];
      }
    }
    double square = 0;
    for (std::size_t c = 0; c < columns; ++c) square += row[c] * row[c];
    const double scale = 1 / std::sqrt(square);
    for (std::size_t c = 0; c < columns; ++c) row[c] *= scale;
  }
  return carriers;
}

}  // namespace compmark
