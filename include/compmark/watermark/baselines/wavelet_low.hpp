// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The low band of the biorthogonal wavelet "bior4.4" (Cohen, Daubechies, Feauveau 1992: the 9-tap low pass of 9/7) with
// periodic borders, and its adjoint: what WateRF (Jang et al., CVPR 2024) reads a message from, at two levels.
//   low(k) = sum_j h_j x((2 k + j) mod N), j = -4 .. 4, along both axes, N the even length;
// an odd line is lengthened by its last sample. Differs from the published band by its scale: h sums up to 1 here and
// to sqrt 2 there, so that a band of a picture in [0, 1] is one in about [0, 1]; the published band of level J is 2^J
// times it. Sharp edges overshoot. Cost: 18 multiplications a pixel and level, twice for both ways.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Scratch of forward and adjoint: half of the image.
template <class T>
class WaveletLow {
 public:
  static constexpr int radius = 4;
  /// h_j sqrt 2 for j = 0 .. 4; h is even.
  static constexpr std::array<double, radius + 1> published_taps{
      0.85269867900889385, 0.37740285561283066, -0.11062440441843718, -0.023849465019556843, 0.03782845550726404};

  /// Samples of the low band of `length` samples.
  [[nodiscard]] static constexpr int size(int length) { return (length + 1) / 2; }

  /// Fills `low` [channels, size(height), size(width)].
  template <Executor E>
  void forward(ImageView<const T> image, ImageView<T> low, E& executor) {
    check(image, low);
    const std::array<T, 2 * radius + 1> h = taps();
    const std::size_t narrow = static_cast<std::size_t>(low.width);
    half_.resize(static_cast<std::size_t>(image.channels) * static_cast<std::size_t>(image.height) * narrow);
    executor.for_chunks(static_cast<std::size_t>(image.channels), 1, [&](std::size_t c, std::size_t, std::size_t) {
      const int channel = static_cast<int>(c);
      T* const half = half_.data() + c * static_cast<std::size_t>(image.height) * narrow;
      for (int y = 0; y < image.height; ++y) {
        for (int k = 0; k < low.width; ++k) {
          T sum(0);
          for (int j = -radius; j <= radius; ++j) {
            sum += h[index(j)] * image(channel, y, sample(2 * k + j, image.width));
          }
          half[static_cast<std::size_t>(y) * narrow + static_cast<std::size_t>(k)] = sum;
        }
      }
      for (int k = 0; k < low.height; ++k) {
        T* const out = low.row(channel, k);
        for (std::size_t x = 0; x < narrow; ++x) out[x] = T(0);
        for (int j = -radius; j <= radius; ++j) {
          const T* const from = half + static_cast<std::size_t>(sample(2 * k + j, image.height)) * narrow;
          for (std::size_t x = 0; x < narrow; ++x) out[x] += h[index(j)] * from[x];
        }
      }
    });
  }

  /// ADDS the adjoint of the band's gradient to `d_image` [channels, height, width].
  template <Executor E>
  void adjoint(ImageView<const T> d_low, ImageView<T> d_image, E& executor) {
    check(d_image, d_low);
    const std::array<T, 2 * radius + 1> h = taps();
    const std::size_t narrow = static_cast<std::size_t>(d_low.width);
    const std::size_t plane = static_cast<std::size_t>(d_image.height) * narrow;
    half_.resize(static_cast<std::size_t>(d_image.channels) * plane);
    executor.for_chunks(static_cast<std::size_t>(d_image.channels), 1, [&](std::size_t c, std::size_t, std::size_t) {
      const int channel = static_cast<int>(c);
      T* const half = half_.data() + c * plane;
      for (std::size_t i = 0; i < plane; ++i) half[i] = T(0);
      for (int k = 0; k < d_low.height; ++k) {
        const T* const from = d_low.row(channel, k);
        for (int j = -radius; j <= radius; ++j) {
          T* const to = half + static_cast<std::size_t>(sample(2 * k + j, d_image.height)) * narrow;
          for (std::size_t x = 0; x < narrow; ++x) to[x] += h[index(j)] * from[x];
        }
      }
      for (int y = 0; y < d_image.height; ++y) {
        T* const out = d_image.row(channel, y);
        for (int k = 0; k < d_low.width; ++k) {
          const T value = half[static_cast<std::size_t>(y) * narrow + static_cast<std::size_t>(k)];
          for (int j = -radius; j <= radius; ++j) out[sample(2 * k + j, d_image.width)] += h[index(j)] * value;
        }
      }
    });
  }

 private:
  [[nodiscard]] static constexpr std::size_t index(int j) { return static_cast<std::size_t>(j + radius); }
  [[nodiscard]] static std::array<T, 2 * radius + 1> taps() {
    constexpr double root = 1.4142135623730951;
    std::array<T, 2 * radius + 1> h{};
    for (int j = -radius; j <= radius; ++j)
      h[index(j)] = static_cast<T>(published_taps[static_cast<std::size_t>(j < 0 ? -j : j)] / root);
    return h;
  }
  /// Where a sample of the periodic line lies in the stored one.
  [[nodiscard]] static int sample(int i, int length) {
    const int even = length + length % 2;
    i %= even;
    if (i < 0) i += even;
    return i < length ? i : length - 1;
  }
  template <class Image, class Low>
  static void check([[maybe_unused]] const Image& image, [[maybe_unused]] const Low& low) {
    COMPMARK_ASSERT(
        image.channels == low.channels && low.height == size(image.height) && low.width == size(image.width),
        "WaveletLow: the band has half of the image's height and width");
  }

  Buffer<T> half_;
};

}  // namespace compmark
