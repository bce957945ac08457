// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Space to depth: each block of s x s pixels becomes one place of 3 s^2 channels, channel (c, dy, dx) -> (c s + dy) s +
// dx, the order of the usual "pixel unshuffle". The network behind it works at 1 / s of the resolution. Sizes that s
// does not divide repeat their last row or column, as the Haar band does. Cost: a copy.
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/conv.hpp"

namespace compmark {

[[nodiscard]] constexpr int stem_size(int n, int stem) { return (n + stem - 1) / stem; }

/// Shapes and fills `maps` [channels s^2, ceil(height / s), ceil(width / s)].
template <class T, Executor E>
void space_to_depth(ImageView<const T> image, int stem, FeatureMaps<T>& maps, E& executor) {
  maps.resize(image.channels * stem * stem, stem_size(image.height, stem), stem_size(image.width, stem));
  const FeatureView<T> target = maps.view();
  executor.for_chunks(static_cast<std::size_t>(target.channels), 1, [&](std::size_t channel, std::size_t, std::size_t) {
    const int k = static_cast<int>(channel), dx = k % stem, dy = k / stem % stem, c = k / (stem * stem);
    for (int y = 0; y < target.height; ++y) {
      const T* const source = image.row(c, std::min(y * stem + dy, image.height - 1));
      T* const row = target.row(k, y);
      const int whole = std::min(target.width, (image.width - dx + stem - 1) / stem);
      for (int x = 0; x < whole; ++x) row[x] = source[x * stem + dx];
      for (int x = whole; x < target.width; ++x) row[x] = source[image.width - 1];
    }
  });
}

/// Fills `d_image` with the adjoint: a repeated pixel sums the gradients of its copies.
template <class T, Executor E>
void depth_to_space(FeatureView<const T> d_maps, int stem, ImageView<T> d_image, E& executor) {
  executor.for_chunks(static_cast<std::size_t>(d_image.channels), 1,
                      [&](std::size_t channel, std::size_t, std::size_t) {
                        const int c = static_cast<int>(channel);
                        std::fill_n(d_image.plane(c), d_image.plane_size(), T(0));
                        for (int dy = 0; dy < stem; ++dy) {
                          for (int dx = 0; dx < stem; ++dx) {
                            for (int y = 0; y < d_maps.height; ++y) {
                              const T* const source = d_maps.row((c * stem + dy) * stem + dx, y);
                              T* const row = d_image.row(c, std::min(y * stem + dy, d_image.height - 1));
                              const int whole = std::min(d_maps.width, (d_image.width - dx + stem - 1) / stem);
                              for (int x = 0; x < whole; ++x) row[x * stem + dx] += source[x];
                              for (int x = whole; x < d_maps.width; ++x) row[d_image.width - 1] += source[x];
                            }
                          }
                        }
                      });
}

}  // namespace compmark
