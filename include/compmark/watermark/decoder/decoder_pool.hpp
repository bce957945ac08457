// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Pooling, forward and backward: the mean of a map over all positions, and the maximum over 3 x 3 windows at stride 2
// that remembers which of the nine it was. Sums over rows are added in order in double; a channel is one chunk, so the
// bits do not depend on the number of threads. A NaN stays one: std::max would drop it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/conv.hpp"

namespace compmark {

/// means[c] of every channel.
template <class T, Executor E>
void mean_over_positions(FeatureView<const T> maps, std::span<double> means, E& executor) {
  const double scale = 1 / (static_cast<double>(maps.height) * static_cast<double>(maps.width));
  executor.for_chunks(static_cast<std::size_t>(maps.channels), 1, [&](std::size_t c, std::size_t, std::size_t) {
    double sum = 0;
    for (int y = 0; y < maps.height; ++y) {
      const T* const row = maps.row(static_cast<int>(c), y);
      T lanes[16] = {};  // sixteen sums side by side: the compiler may not reorder one
      int x = 0;
      for (; x + 16 <= maps.width; x += 16) {
        for (int k = 0; k < 16; ++k) lanes[k] += row[x + k];
      }
      for (; x < maps.width; ++x) lanes[0] += row[x];
      for (const T lane : lanes) sum += static_cast<double>(lane);
    }
    means[c] = sum * scale;
  });
}

[[nodiscard]] constexpr int max_pool_size(int n) { return (n - 3) / 2 + 1; }

/// Shapes and fills `output` and `choice` (which of the nine, row by row).
template <class T, Executor E>
void max_pool(FeatureView<const T> input, FeatureMaps<T>& output, Buffer<std::uint8_t>& choice, E& executor) {
  output.resize(input.channels, max_pool_size(input.height), max_pool_size(input.width));
  const FeatureView<T> target = output.view();
  choice.resize(static_cast<std::size_t>(target.channels) * target.plane_stride);
  executor.for_chunks(static_cast<std::size_t>(target.channels), 1, [&](std::size_t channel, std::size_t, std::size_t) {
    const int c = static_cast<int>(channel);
    std::uint8_t* chosen = choice.data() + channel * target.plane_stride;
    for (int y = 0; y < target.height; ++y) {
      T* const row = target.row(c, y);
      for (int x = 0; x < target.width; ++x) {
        T best = input.row(c, 2 * y)[2 * x];
        std::uint8_t place = 0;
        for (int k = 1; k < 9; ++k) {
          const T value = input.row(c, 2 * y + k / 3)[2 * x + k % 3];
          if (value > best || std::isnan(value)) {
            best = value;
            place = static_cast<std::uint8_t>(k);
          }
        }
        row[x] = best;
        *chosen++ = place;
      }
    }
  });
}

/// Fills `d_input` with the adjoint.
template <class T, Executor E>
void max_pool_adjoint(FeatureView<const T> d_output, const Buffer<std::uint8_t>& choice, FeatureView<T> d_input,
                      E& executor) {
  const std::size_t places = static_cast<std::size_t>(d_output.height) * static_cast<std::size_t>(d_output.width);
  executor.for_chunks(static_cast<std::size_t>(d_output.channels), 1,
                      [&](std::size_t channel, std::size_t, std::size_t) {
                        const int c = static_cast<int>(channel);
                        const std::uint8_t* chosen = choice.data() + channel * places;
                        for (int y = 0; y < d_input.height; ++y) std::fill_n(d_input.row(c, y), d_input.width, T(0));
                        for (int y = 0; y < d_output.height; ++y) {
                          for (int x = 0; x < d_output.width; ++x) {
                            const int k = *chosen++;
                            d_input.row(c, 2 * y + k / 3)[2 * x + k % 3] += d_output.row(c, y)[x];
                          }
                        }
                      });
}

}  // namespace compmark
