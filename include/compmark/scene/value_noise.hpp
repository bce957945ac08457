// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Value noise on the integer lattice: every lattice place has a number, and between places they are interpolated
// trilinearly with smoothed weights. Cost: eight weights; in another cell than before eight random numbers more.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "compmark/core/random.hpp"
#include "compmark/scene/solid.hpp"

namespace compmark {

/// C1 noise, keyed by lattice place; places repeat after 4096 along y and z.
class ValueNoise {
 public:
  /// The numbers at the corners of the cell that was looked at last: neighbouring points mostly fall into the same
  /// cell. It is a memory and nothing else: the noise is the same with any. For one ValueNoise alone.
  struct Cell {
    std::array<std::int64_t, 3> cell{std::numeric_limits<std::int64_t>::min(), 0, 0};  // no cell has this number
    std::array<double, 8> values{};
  };

  explicit ValueNoise(const Random& random) : random_(random) {}

  /// In [0, 1], at a point whose coordinates are within +-2^31.
  [[nodiscard]] double at(const Vector3& p, Cell& last) const {
    std::array<std::int64_t, 3> cell{};
    std::array<double, 3> t{};
    for (std::size_t c = 0; c < 3; ++c) {
      const double floor = std::floor(p[c]);
      cell[c] = static_cast<std::int64_t>(floor);
      const double u = p[c] - floor;
      t[c] = u * u * (3 - 2 * u);
    }
    if (cell != last.cell) {
      last.cell = cell;
      for (unsigned corner = 0; corner < 8; ++corner) {
        std::uint64_t place = 0;
        for (std::size_t c = 0; c < 3; ++c)
          place = place * 4096 + (static_cast<std::uint64_t>(cell[c] + 2048) + ((corner >> c) & 1u));
        last.values[corner] = random_.uniform(place);
      }
    }
    double sum = 0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      double weight = 1;
      for (std::size_t c = 0; c < 3; ++c) weight *= ((corner >> c) & 1u) != 0 ? t[c] : 1 - t[c];
      sum += weight * last.values[corner];
    }
    return sum;
  }

 private:
  Random random_;
};

}  // namespace compmark
