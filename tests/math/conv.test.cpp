// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/conv.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "support/features.hpp"

namespace {

using namespace compmark;
using testing::dense;
using testing::noise;

/// The definition, in long double.
template <class T>
long double reference(const ConvShape& s, const std::vector<T>& input, int height, int width,
                      const std::vector<T>& weight, const std::vector<T>& bias, int o, int y, int x) {
  long double sum = static_cast<long double>(bias[static_cast<std::size_t>(o)]);
  for (int c = 0; c < s.in; ++c) {
    for (int i = 0; i < s.kernel; ++i) {
      for (int j = 0; j < s.kernel; ++j) {
        const int row = y * s.stride + i - s.padding;
        const int column = x * s.stride + j - s.padding;
        if (row < 0 || row >= height || column < 0 || column >= width) continue;
        sum +=
            static_cast<long double>(weight[static_cast<std::size_t>(((o * s.in + c) * s.kernel + i) * s.kernel + j)]) *
            static_cast<long double>(input[static_cast<std::size_t>((c * height + row) * width + column)]);
      }
    }
  }
  return sum;
}

template <class T>
double worst_error(const ConvShape& shape, int height, int width) {
  const auto input = noise<T>(static_cast<std::size_t>(shape.in * height * width), 1);
  const auto weight = noise<T>(static_cast<std::size_t>(shape.out) * shape.taps(), 2);
  const auto bias = noise<T>(static_cast<std::size_t>(shape.out), 3);
  const Convolution<T> convolution(shape, weight, bias);
  ConvInput<T> packed;
  FeatureMaps<T> maps;
  ConvScratch<T> scratch;
  SerialExecutor executor;
  packed.pack(dense(input, shape.in, height, width), shape.stride, shape.padding, executor);
  convolution.resize_output(packed, maps);
  convolution.forward(packed, maps.view(), scratch, executor, IdentityFinish{});
  const auto output = std::as_const(maps).view();
  REQUIRE(output.channels == shape.out);
  REQUIRE(output.height == shape.output_size(height));
  REQUIRE(output.width == shape.output_size(width));
  long double worst = 0;
  for (int o = 0; o < output.channels; ++o) {
    for (int y = 0; y < output.height; ++y) {
      for (int x = 0; x < output.width; ++x) {
        worst = std::max(worst, std::abs(static_cast<long double>(output.row(o, y)[x]) -
                                         reference(shape, input, height, width, weight, bias, o, y, x)));
      }
    }
  }
  return static_cast<double>(worst);
}

TEST_CASE("math/conv: equals the definition for kernels, strides, paddings and counts around the blocks") {
  for (const ConvShape& shape : {ConvShape{1, 1, 1, 1, 0},
                                 {3, 5, 3, 1, 1},
                                 {4, 16, 5, 1, 2},
                                 {3, 9, 11, 4, 2},
                                 {3, 8, 3, 2, 0},
                                 {7, 12, 1, 1, 0},
                                 {2, 3, 3, 3, 1},
                                 {5, 17, 3, 1, 0},
                                 {2, 4, 4, 2, 1}}) {
    for (const std::pair<int, int>& size : {std::pair{11, 11}, {13, 29}, {31, 12}}) {
      const int height = size.first, width = size.second;
      CAPTURE(shape.kernel);
      CAPTURE(shape.stride);
      CAPTURE(width);
      CHECK(worst_error<double>(shape, height, width) < 1e-13);
      CHECK(worst_error<float>(shape, height, width) <
            4e-5);  // up to 363 products below 1/4: 363 * 6e-8 / 4 a rounding each, halved
    }
  }
}

TEST_CASE("math/conv: several kernels share one padded copy and write side by side") {
  const int height = 9, width = 14;
  const auto input = noise<double>(2 * 9 * 14, 1);
  const ConvShape narrow{2, 3, 1, 1, 0}, wide{2, 4, 3, 1, 1};
  const auto narrow_weight = noise<double>(3 * 2, 2), wide_weight = noise<double>(4 * 2 * 9, 3),
             bias = noise<double>(4, 4);
  const std::vector<double> narrow_bias(bias.begin(), bias.begin() + 3);
  ConvInput<double> packed;
  FeatureMaps<double> maps;
  ConvScratch<double> scratch;
  SerialExecutor executor;
  packed.pack(dense(input, 2, height, width), 1, 1, executor);
  const Convolution<double> first(narrow, narrow_weight, narrow_bias), second(wide, wide_weight, bias);
  second.resize_output(packed, maps, 7);
  first.forward(packed, maps.view().channel_range(0, 3), scratch, executor, ReluFinish{});
  second.forward(packed, maps.view().channel_range(3, 4), scratch, executor, IdentityFinish{});
  const auto output = std::as_const(maps).view();
  long double worst = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int o = 0; o < 3; ++o) {
        const long double expected =
            std::max(0.0L, reference(narrow, input, height, width, narrow_weight, narrow_bias, o, y, x));
        worst = std::max(worst, std::abs(static_cast<long double>(output.row(o, y)[x]) - expected));
      }
      for (int o = 0; o < 4; ++o) {
        worst = std::max(worst, std::abs(static_cast<long double>(output.row(3 + o, y)[x]) -
                                         reference(wide, input, height, width, wide_weight, bias, o, y, x)));
      }
    }
  }
  CHECK(worst < 1e-13L);
}

TEST_CASE("math/conv: same bits at any thread count") {
  const ConvShape shape{6, 20, 3, 1, 1};
  const int height = 40, width = 50;
  const auto input = noise<float>(6 * 40 * 50, 1), weight = noise<float>(20 * shape.taps(), 2),
             bias = noise<float>(20, 3);
  const Convolution<float> convolution(shape, weight, bias);
  std::vector<std::vector<float>> results;
  for (const std::size_t threads : {1u, 2u, 4u}) {
    ThreadExecutor executor(threads);
    ConvInput<float> packed;
    FeatureMaps<float> maps;
    ConvScratch<float> scratch;
    packed.pack(dense(input, 6, height, width), 1, 1, executor);
    convolution.resize_output(packed, maps);
    convolution.forward(packed, maps.view(), scratch, executor, ReluFinish{});
    results.emplace_back();
    for (int o = 0; o < 20; ++o) {
      for (int y = 0; y < height; ++y)
        results.back().insert(results.back().end(), maps.view().row(o, y), maps.view().row(o, y) + width);
    }
  }
  CHECK(results[0] == results[1]);
  CHECK(results[0] == results[2]);
}

TEST_CASE("math/conv: pooling takes the maximum of what lies in each window, floor and ceil") {
  SerialExecutor executor;
  for (const std::pair<int, int>& size : {std::pair{7, 7}, {8, 10}, {3, 4}, {31, 12}}) {
    const int height = size.first, width = size.second;
    const auto input = noise<float>(static_cast<std::size_t>(2 * height * width), 5);
    for (const bool ceil : {false, true}) {
      FeatureMaps<float> maps;
      max_pool_3x3_stride_2(dense(input, 2, height, width), ceil, maps, executor);
      const auto output = std::as_const(maps).view();
      CHECK(output.height == (ceil ? (height - 2) / 2 : (height - 3) / 2) + 1);
      CHECK(output.width == (ceil ? (width - 2) / 2 : (width - 3) / 2) + 1);
      std::size_t wrong = 0;
      for (int c = 0; c < 2; ++c) {
        for (int y = 0; y < output.height; ++y) {
          for (int x = 0; x < output.width; ++x) {
            float expected = -std::numeric_limits<float>::infinity();
            for (int i = 2 * y; i < std::min(2 * y + 3, height); ++i) {
              for (int j = 2 * x; j < std::min(2 * x + 3, width); ++j) {
                expected = std::max(expected, input[static_cast<std::size_t>((c * height + i) * width + j)]);
              }
            }
            wrong += output.row(c, y)[x] == expected ? 0 : 1;
          }
        }
      }
      CHECK(wrong == 0);
    }
  }
}

}  // namespace
