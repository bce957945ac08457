// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What WateRF reads and adds: the low band against its formula, and the reading's gradient.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <compmark/core/random.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/testing/gradient.hpp>
#include <compmark/testing/mark_laws.hpp>
#include <compmark/watermark/baselines/wavelet_decoder.hpp>
#include <compmark/watermark/baselines/wavelet_low.hpp>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "watermark/baselines/random_picture.hpp"

namespace {

using namespace compmark;

/// The published formula, pixel by pixel: the filter of ten taps as it is printed, with its leading zero, and the
/// periodic convolution y(k) = sum_i f_i x((2 k + 5 - i) mod N).
std::vector<double> published_level(const std::vector<double>& picture, int height, int width) {
  constexpr std::array<double, 10> f{0,           0.037828456, -0.023849465, -0.110624404, 0.377402856,
                                     0.852698679, 0.377402856, -0.110624404, -0.023849465, 0.037828456};
  const int low_height = (height + 1) / 2, low_width = (width + 1) / 2;
  const auto wrapped = [](int i, int n) {
    const int even = 2 * ((n + 1) / 2);
    const int at = ((i % even) + even) % even;
    return std::min(at, n - 1);
  };
  std::vector<double> low;
  for (int c = 0; c < 3; ++c) {
    for (int ky = 0; ky < low_height; ++ky) {
      for (int kx = 0; kx < low_width; ++kx) {
        double sum = 0;
        for (int i = 0; i < 10; ++i) {
          for (int j = 0; j < 10; ++j) {
            const int y = wrapped(2 * ky + 5 - i, height), x = wrapped(2 * kx + 5 - j, width);
            sum += f[static_cast<std::size_t>(i)] * f[static_cast<std::size_t>(j)] *
                   picture[static_cast<std::size_t>((c * height + y) * width + x)];
          }
        }
        low.push_back(sum);
      }
    }
  }
  return low;
}

/// Bit b is what a wave of its own finds in a picture of any size; it takes pictures of two pixels a side.
struct TwoWaves {
  using Scalar = double;
  static constexpr bool is_absent = false;
  struct Context {
    std::array<double, 2> mean{};
  };
  static constexpr int bits() { return 2; }
  static constexpr int minimum_size() { return 2; }
  static double wave(std::size_t bit, std::size_t i) { return std::sin(0.7 * static_cast<double>(i * (bit + 1)) + 1); }
  template <Executor E>
  void forward(ImageView<const double> image, std::span<double> logits, Context& context, E& /*executor*/) const {
    for (std::size_t bit = 0; bit < 2; ++bit) {
      double sum = 0;
      for (std::size_t i = 0; i < image.size(); ++i) sum += wave(bit, i) * image.data[i];
      context.mean[bit] = sum;
      logits[bit] = sum + sum * sum;
    }
  }
  template <Executor E>
  void backward(std::span<const double> d_logits, ImageView<double> d_image, Context& context, E& /*executor*/) const {
    for (std::size_t bit = 0; bit < 2; ++bit) {
      for (std::size_t i = 0; i < d_image.size(); ++i)
        d_image.data[i] += d_logits[bit] * (1 + 2 * context.mean[bit]) * wave(bit, i);
    }
  }
};
using Reading = WaveletDecoder<TwoWaves>;
static_assert(MessageDecoder<Reading>);

}  // namespace

TEST_CASE("baselines/wavelet: the low band of two levels is the published formula's, at even and odd sizes") {
  for (const auto& [high, wide] : {std::pair(16, 24), std::pair(13, 11), std::pair(5, 4), std::pair(1, 2)}) {
    const int height = high, width = wide;
    CAPTURE(height);
    CAPTURE(width);
    const std::vector<double> picture = testing::random_picture(height, width, 1);
    SerialExecutor serial;
    WaveletLow<double> first, second;
    const int h1 = WaveletLow<double>::size(height), w1 = WaveletLow<double>::size(width);
    const int h2 = WaveletLow<double>::size(h1), w2 = WaveletLow<double>::size(w1);
    std::vector<double> one(static_cast<std::size_t>(3 * h1 * w1)), two(static_cast<std::size_t>(3 * h2 * w2));
    first.forward({picture.data(), 3, height, width}, {one.data(), 3, h1, w1}, serial);
    second.forward({one.data(), 3, h1, w1}, {two.data(), 3, h2, w2}, serial);
    const std::vector<double> published = published_level(published_level(picture, height, width), h1, w1);
    REQUIRE(published.size() == two.size());
    double worst = 0, naive = 0;
    for (std::size_t i = 0; i < two.size(); ++i) {
      worst = std::max(worst, std::abs(4 * two[i] - published[i]));
      naive = std::max(naive, std::abs(two[i] - published[i]));
    }
    CHECK(worst < 1e-6);  // the printed taps have nine digits
    CHECK(naive > 0.1);   // the control: without the factor of two levels
  }
}

TEST_CASE("baselines/wavelet: a flat picture stays what it is, and the adjoint is the transposed band") {
  SerialExecutor serial;
  const int height = 14, width = 9, h = 7, w = 5;
  const std::vector<double> flat(static_cast<std::size_t>(3 * height * width), 0.75);
  std::vector<double> low(static_cast<std::size_t>(3 * h * w));
  WaveletLow<double> band;
  band.forward({flat.data(), 3, height, width}, {low.data(), 3, h, w}, serial);
  for (const double value : low) CHECK(value == doctest::Approx(0.75).epsilon(1e-12));

  const std::vector<double> x = testing::random_picture(height, width, 2), y = testing::random_picture(h, w, 3);
  std::vector<double> back(x.size(), 0.0);
  band.forward({x.data(), 3, height, width}, {low.data(), 3, h, w}, serial);
  band.adjoint({y.data(), 3, h, w}, {back.data(), 3, height, width}, serial);
  double there = 0, and_back = 0;
  for (std::size_t i = 0; i < low.size(); ++i) there += low[i] * y[i];
  for (std::size_t i = 0; i < x.size(); ++i) and_back += x[i] * back[i];
  CHECK(there == doctest::Approx(and_back).epsilon(1e-12));
}

TEST_CASE("baselines/wavelet: the reading obeys the laws of a message decoder, its gradient among them") {
  const Reading reading{TwoWaves{}};
  CHECK(reading.minimum_size() == 8);
  CHECK(testing::message_decoder_laws(reading, 16, 20) == "");
  CHECK(testing::message_decoder_laws(reading, 13, 9) == "");
  // The control: the gradient of the band of one level is not that of two.
  const std::vector<double> kept = testing::random_picture(16, 16, 4);
  std::vector<double> picture = kept, gradient(kept.size(), 0.0), logits(2);
  const ImageView<const double> view{picture.data(), 3, 16, 16};
  SerialExecutor serial;
  Reading::Context context;
  WaveletDecoder<TwoWaves, 1>::Context other;
  const std::vector<double> ones(2, 1.0);
  const WaveletDecoder<TwoWaves, 1> shallow{TwoWaves{}};
  shallow.forward(view, logits, other, serial);
  shallow.backward(ones, {gradient.data(), 3, 16, 16}, other, serial);
  const auto loss = [&] {
    reading.forward(view, logits, context, serial);
    return logits[0] + logits[1];
  };
  CHECK(testing::gradient_law(loss, picture, gradient) != "");
}
