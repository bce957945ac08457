// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Photographs at a fraction of their size, for the coarse levels of a run (coarse_to_fine.hpp): means over boxes of
// pixels, made in the memory of the whole photograph. Cost: one pass over it, about 1 ns a value; no memory.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/training_views.hpp"

namespace compmark {

namespace detail {

/// plane [height, width] becomes [height / factor, width / factor] at `to`, which is `from` or lies before it. With
/// `weight`, [height, width], a mean is weighted; where no pixel of a box counts, it is the plain one.
template <class T>
void average_boxes(const T* from, int height, int width, int factor, const T* weight, T* to) {
  const auto f = static_cast<std::size_t>(factor), row = static_cast<std::size_t>(width);
  const std::size_t rows = static_cast<std::size_t>(height) / f, columns = row / f;
  const T share = T(1) / static_cast<T>(f * f);
  for (std::size_t y = 0; y < rows; ++y) {
    for (std::size_t x = 0; x < columns; ++x) {
      const std::size_t corner = (y * row + x) * f;
      T sum = 0, weighted = 0, total = 0;
      for (std::size_t j = 0; j < f; ++j) {
        for (std::size_t i = corner + j * row; i < corner + j * row + f; ++i) {
          sum += from[i];
          if (weight == nullptr) continue;
          weighted += weight[i] * from[i];
          total += weight[i];
        }
      }
      // Nothing that is read later lies before what is written: y * columns + x <= corner.
      to[y * columns + x] = total > T(0) ? weighted / total : sum * share;
    }
  }
}

}  // namespace detail

/// Replaces the planes of a photograph by the means over boxes of factor x factor pixels, at the beginning of the same
/// memory. Colours and coverage are means over the pixels that count, weights are plain means. Returns the coarse
/// image, [3, height / factor, width / factor]; pixels left over at the right and the lower edge are dropped.
template <class T>
ImageView<T> make_coarse(const TargetPlanes<T>& planes, int factor) {
  const ImageView<T> image = planes.image;
  COMPMARK_ASSERT(factor >= 1 && image.width >= factor && image.height >= factor, "make_coarse: the factor");
  const ImageView<T> coarse{image.data, image.channels, image.height / factor, image.width / factor};
  const auto average = [&](const T* from, const T* weight, T* to) {
    detail::average_boxes(from, image.height, image.width, factor, weight, to);
  };
  for (int c = 0; c < image.channels; ++c) {
    const auto channel = static_cast<std::size_t>(c);
    average(image.data + channel * image.plane_size(), planes.weight, coarse.data + channel * coarse.plane_size());
  }
  if (planes.alpha != nullptr) average(planes.alpha, planes.weight, planes.alpha);
  if (planes.weight != nullptr) average(planes.weight, nullptr, planes.weight);
  return coarse;
}

}  // namespace compmark
