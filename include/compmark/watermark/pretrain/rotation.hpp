// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Rotation of an image about its middle on the same canvas, bilinear, black where the turned image does not reach
// (docs/spec/watermark.md, 3), and its transpose: every output pixel gathers four places with weights that depend on
// the angle alone, so that the gradient scatters with the same four weights. Cost: ~3 ns a pixel and channel each way.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

namespace detail {

/// Calls visit(y, x, place y0, x0, weight) for each of the four neighbours that exist, for every output pixel of rows
/// [begin, end).
template <class T, class Visit>
void visit_rotation(int height, int width, double radians, int begin, int end, const Visit& visit) {
  const double cosine = std::cos(radians), sine = std::sin(radians);
  const double middle_y = 0.5 * (height - 1), middle_x = 0.5 * (width - 1);
  for (int y = begin; y < end; ++y) {
    for (int x = 0; x < width; ++x) {
      const double dy = y - middle_y, dx = x - middle_x;
      const double source_x = middle_x + cosine * dx - sine * dy;
      const double source_y = middle_y + sine * dx + cosine * dy;
      const int x0 = static_cast<int>(std::floor(source_x)), y0 = static_cast<int>(std::floor(source_y));
      const T fx = static_cast<T>(source_x - x0), fy = static_cast<T>(source_y - y0);
      for (int k = 0; k < 4; ++k) {
        const int yy = y0 + k / 2, xx = x0 + k % 2;
        if (yy < 0 || yy >= height || xx < 0 || xx >= width) continue;
        visit(y, x, yy, xx, (k / 2 == 1 ? fy : T(1) - fy) * (k % 2 == 1 ? fx : T(1) - fx));
      }
    }
  }
}

}  // namespace detail

/// Counter-clockwise for positive angles (the y axis points down).
template <class T, Executor E>
void rotate_image(ImageView<const T> input, double radians, ImageView<T> output, E& executor) {
  executor.for_chunks(static_cast<std::size_t>(input.height), 16, [&](std::size_t begin, std::size_t end, std::size_t) {
    const int first = static_cast<int>(begin), last = static_cast<int>(end);
    for (int c = 0; c < output.channels; ++c)
      std::fill(output.row(c, first), output.row(c, last - 1) + output.width, T(0));
    detail::visit_rotation<T>(input.height, input.width, radians, first, last,
                              [&](int y, int x, int yy, int xx, T weight) {
                                for (int c = 0; c < input.channels; ++c) output(c, y, x) += weight * input(c, yy, xx);
                              });
  });
}

/// ADDS. On one thread: neighbouring output pixels share input pixels.
template <class T>
void add_rotation_transposed(ImageView<const T> gradient, double radians, ImageView<T> input_gradient) {
  detail::visit_rotation<T>(gradient.height, gradient.width, radians, 0, gradient.height,
                            [&](int y, int x, int yy, int xx, T weight) {
                              for (int c = 0; c < gradient.channels; ++c)
                                input_gradient(c, yy, xx) += weight * gradient(c, y, x);
                            });
}

}  // namespace compmark
