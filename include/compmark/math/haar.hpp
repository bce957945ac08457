// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The low-low band of the orthonormal Haar transform: LL(i, j) = (x(2i, 2j) + x(2i, 2j+1) + x(2i+1, 2j) + x(2i+1,
// 2j+1)) / 2, so a constant c becomes 2 c a level and the range [0, 1] becomes [0, 2]. An odd size repeats its last row
// or column once (symmetric extension), so a band has ceil(n / 2) values; a mean instead of this sum, or a dropped last
// row, is another input for a decoder trained on this one (docs/spec/numerics.md, FR7; docs/spec/method.md, 5.3). Cost:
// one addition a pixel.
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Values of a band over n pixels.
[[nodiscard]] constexpr int haar_size(int n) { return (n + 1) / 2; }

/// Fills `low` [channels, ceil(height / 2), ceil(width / 2)].
template <class T, Executor E>
void haar_low(ImageView<const T> image, ImageView<T> low, E& executor) {
  COMPMARK_ASSERT(
      low.channels == image.channels && low.height == haar_size(image.height) && low.width == haar_size(image.width),
      "haar_low: shape of the band");
  const std::size_t rows = static_cast<std::size_t>(low.channels) * static_cast<std::size_t>(low.height);
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t r = begin; r < end; ++r) {
      const int c = static_cast<int>(r) / low.height, y = static_cast<int>(r) % low.height;
      const T* const a = image.row(c, 2 * y);
      const T* const b = image.row(c, std::min(2 * y + 1, image.height - 1));
      T* const target = low.row(c, y);
      const int pairs = image.width / 2;
      for (int x = 0; x < pairs; ++x) target[x] = T(0.5) * ((a[2 * x] + a[2 * x + 1]) + (b[2 * x] + b[2 * x + 1]));
      if (pairs < low.width) target[pairs] = a[2 * pairs] + b[2 * pairs];
    }
  });
}

/// ADDS the adjoint: half of each band value to its four pixels, a repeated pixel receives the share of each of its
/// copies.
template <class T, Executor E>
void haar_low_adjoint(ImageView<const T> d_low, ImageView<T> d_image, E& executor) {
  COMPMARK_ASSERT(d_low.channels == d_image.channels && d_low.height == haar_size(d_image.height) &&
                      d_low.width == haar_size(d_image.width),
                  "haar_low_adjoint: shape of the band");
  const std::size_t rows = static_cast<std::size_t>(d_low.channels) * static_cast<std::size_t>(d_low.height);
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end, std::size_t) {
    for (std::size_t r = begin; r < end; ++r) {
      const int c = static_cast<int>(r) / d_low.height, y = static_cast<int>(r) % d_low.height;
      const bool last = 2 * y + 1 == d_image.height;  // this row of pixels stands for two
      const T share = last ? T(1) : T(0.5);
      const T* const source = d_low.row(c, y);
      const int pairs = d_image.width / 2;
      for (int part = 0; part < (last ? 1 : 2); ++part) {
        T* const target = d_image.row(c, 2 * y + part);
        for (int x = 0; x < pairs; ++x) {
          target[2 * x] += share * source[x];
          target[2 * x + 1] += share * source[x];
        }
        if (pairs < d_low.width) target[2 * pairs] += 2 * share * source[pairs];
      }
    }
  });
}

}  // namespace compmark
