// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One band of one level of the biorthogonal wavelet "bior4.4" (Cohen, Daubechies, Feauveau 1992: 9/7) with periodic
// borders, and its adjoint. Along each axis it is
//   low(k) = sum_j h_j x((2 k + j) mod N), j = -4 .. 4, or high(k) = sum_j g_j x((2 k + 1 + j) mod N), j = -3 .. 3,
// N the even length; an odd line is lengthened by its last sample. Differs from the published bands by the scale: h sums
// up to 1 here and to sqrt 2 there, and g has the same factor, so that the published band of level J is 2^J times ours
// and a low band of a picture in [0, 1] is one in about [0, 1]. Sharp edges overshoot. Cost: 18 multiplications a pixel,
// twice for both ways.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// What passes along an axis.
enum class WaveletPass : std::uint8_t { low, high };

/// Scratch of forward and adjoint: half of the image.
template <class T>
class WaveletBand {
 public:
  static constexpr int radius = 4;
  /// h_j sqrt 2 for j = 0 .. 4, and g_j sqrt 2; both are even.
  static constexpr std::array<double, radius + 1> published_taps{
      0.85269867900889385, 0.37740285561283066, -0.11062440441843718, -0.023849465019556843, 0.03782845550726404};
  static constexpr std::array<double, radius + 1> published_high_taps{-0.78848561640558331, 0.41809227322161724,
                                                                      0.040689417609558675, -0.064538882628938562, 0};

  WaveletBand(WaveletPass along_x, WaveletPass along_y) : along_x_(along_x), along_y_(along_y) {}

  /// Samples of the band of `length` samples.
  [[nodiscard]] static constexpr int size(int length) { return (length + 1) / 2; }

  /// Fills `band` [channels, size(height), size(width)].
  template <Executor E>
  void forward(ImageView<const T> image, ImageView<T> band, E& executor) {
    check(image, band);
    const Taps h = taps(along_x_), v = taps(along_y_);
    const std::size_t narrow = static_cast<std::size_t>(band.width);
    half_.resize(static_cast<std::size_t>(image.channels) * static_cast<std::size_t>(image.height) * narrow);
    executor.for_chunks(static_cast<std::size_t>(image.channels), 1, [&](std::size_t c, std::size_t, std::size_t) {
      const int channel = static_cast<int>(c);
      T* const half = half_.data() + c * static_cast<std::size_t>(image.height) * narrow;
      for (int y = 0; y < image.height; ++y) {
        for (int k = 0; k < band.width; ++k) {
          T sum(0);
          for (int j = -radius; j <= radius; ++j)
            sum += h[index(j)] * image(channel, y, sample(center(k, along_x_) + j, image.width));
          half[static_cast<std::size_t>(y) * narrow + static_cast<std::size_t>(k)] = sum;
        }
      }
      for (int k = 0; k < band.height; ++k) {
        T* const out = band.row(channel, k);
        for (std::size_t x = 0; x < narrow; ++x) out[x] = T(0);
        for (int j = -radius; j <= radius; ++j) {
          const T* const from = half + static_cast<std::size_t>(sample(center(k, along_y_) + j, image.height)) * narrow;
          for (std::size_t x = 0; x < narrow; ++x) out[x] += v[index(j)] * from[x];
        }
      }
    });
  }

  /// ADDS the adjoint of the band's gradient to `d_image` [channels, height, width].
  template <Executor E>
  void adjoint(ImageView<const T> d_band, ImageView<T> d_image, E& executor) {
    check(d_image, d_band);
    const Taps h = taps(along_x_), v = taps(along_y_);
    const std::size_t narrow = static_cast<std::size_t>(d_band.width);
    const std::size_t plane = static_cast<std::size_t>(d_image.height) * narrow;
    half_.resize(static_cast<std::size_t>(d_image.channels) * plane);
    executor.for_chunks(static_cast<std::size_t>(d_image.channels), 1, [&](std::size_t c, std::size_t, std::size_t) {
      const int channel = static_cast<int>(c);
      T* const half = half_.data() + c * plane;
      for (std::size_t i = 0; i < plane; ++i) half[i] = T(0);
      for (int k = 0; k < d_band.height; ++k) {
        const T* const from = d_band.row(channel, k);
        for (int j = -radius; j <= radius; ++j) {
          T* const to = half + static_cast<std::size_t>(sample(center(k, along_y_) + j, d_image.height)) * narrow;
          for (std::size_t x = 0; x < narrow; ++x) to[x] += v[index(j)] * from[x];
        }
      }
      for (int y = 0; y < d_image.height; ++y) {
        T* const out = d_image.row(channel, y);
        for (int k = 0; k < d_band.width; ++k) {
          const T value = half[static_cast<std::size_t>(y) * narrow + static_cast<std::size_t>(k)];
          for (int j = -radius; j <= radius; ++j)
            out[sample(center(k, along_x_) + j, d_image.width)] += h[index(j)] * value;
        }
      }
    });
  }

 private:
  using Taps = std::array<T, 2 * radius + 1>;
  [[nodiscard]] static constexpr std::size_t index(int j) { return static_cast<std::size_t>(j + radius); }
  [[nodiscard]] static constexpr int center(int k, WaveletPass pass) {
    return 2 * k + (pass == WaveletPass::high ? 1 : 0);
  }
  [[nodiscard]] static Taps taps(WaveletPass pass) {
    constexpr double root = 1.4142135623730951;
    const auto& published = pass == WaveletPass::high ? published_high_taps : published_taps;
    Taps h{};
    for (int j = -radius; j <= radius; ++j)
      h[index(j)] = static_cast<T>(published[static_cast<std::size_t>(j < 0 ? -j : j)] / root);
    return h;
  }
  /// Where a sample of the periodic line lies in the stored one.
  [[nodiscard]] static int sample(int i, int length) {
    const int even = length + length % 2;
    i %= even;
    if (i < 0) i += even;
    return i < length ? i : length - 1;
  }
  template <class Image, class Band>
  static void check([[maybe_unused]] const Image& image, [[maybe_unused]] const Band& band) {
    COMPMARK_ASSERT(
        image.channels == band.channels && band.height == size(image.height) && band.width == size(image.width),
        "WaveletBand: the band has half of the image's height and width");
  }

  WaveletPass along_x_, along_y_;
  Buffer<T> half_;
};

}  // namespace compmark
