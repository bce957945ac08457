// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/watermark/baselines/wavelet_band.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/core/executor.hpp>
#include <cstddef>
#include <vector>

#include "watermark/baselines/random_picture.hpp"

using namespace compmark;

namespace {

constexpr WaveletPass passes[2] = {WaveletPass::low, WaveletPass::high};

}  // namespace

TEST_CASE("baselines/wavelet_band: the adjoint is the transposed band, of all four and at odd sizes") {
  SerialExecutor serial;
  const int height = 13, width = 10, h = 7, w = 5;
  const std::vector<double> x = testing::random_picture(height, width, 2), y = testing::random_picture(h, w, 3);
  for (const WaveletPass along_x : passes) {
    for (const WaveletPass along_y : passes) {
      WaveletBand<double> band(along_x, along_y);
      std::vector<double> out(y.size()), back(x.size(), 0.0);
      band.forward({x.data(), 3, height, width}, {out.data(), 3, h, w}, serial);
      band.adjoint({y.data(), 3, h, w}, {back.data(), 3, height, width}, serial);
      double there = 0, and_back = 0;
      for (std::size_t i = 0; i < out.size(); ++i) there += out[i] * y[i];
      for (std::size_t i = 0; i < x.size(); ++i) and_back += x[i] * back[i];
      CHECK(there == doctest::Approx(and_back).epsilon(1e-12));
    }
  }
}

TEST_CASE("baselines/wavelet_band: a high pass has its published taps and does not see what is even or falls evenly") {
  SerialExecutor serial;
  const int height = 8, width = 32, h = 4, w = 16;
  const auto high_of = [&](auto value) {
    std::vector<double> picture(static_cast<std::size_t>(3 * height * width)), out(static_cast<std::size_t>(3 * h * w));
    for (std::size_t i = 0; i < picture.size(); ++i) picture[i] = value(static_cast<int>(i) % width);
    WaveletBand<double> band(WaveletPass::high, WaveletPass::low);
    band.forward({picture.data(), 3, height, width}, {out.data(), 3, h, w}, serial);
    return std::vector<double>(out.begin(), out.begin() + w);  // every row is the same
  };
  for (const double value : high_of([](int) { return 0.75; })) CHECK(std::abs(value) < 1e-11);
  const std::vector<double> slope = high_of([](int x) { return 0.1 * x; });
  for (std::size_t k = 1; k < 14; ++k) CHECK(std::abs(slope[k]) < 1e-10);  // away from where the line ends
  // One sample: high(k) = g(9 - (2 k + 1)), and the published one is sqrt 2 times it along one axis.
  const std::vector<double> impulse = high_of([](int x) { return x == 9 ? 1.0 : 0.0; });
  const auto& g = WaveletBand<double>::published_high_taps;
  CHECK(impulse[4] * std::sqrt(2.0) == doctest::Approx(g[0]));
  CHECK(impulse[3] * std::sqrt(2.0) == doctest::Approx(g[2]));
  CHECK(impulse[5] * std::sqrt(2.0) == doctest::Approx(g[2]));
  CHECK(impulse[6] == 0);
  // A high pass is a low pass with alternating signs, whose sum is sqrt 2.
  double alternating = -g[0];
  for (int j = 1; j <= 3; ++j) alternating += 2 * (j % 2 == 1 ? 1 : -1) * g[static_cast<std::size_t>(j)];
  CHECK(alternating == doctest::Approx(std::sqrt(2.0)).epsilon(1e-9));
}
