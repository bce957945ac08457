// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/winograd.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/math/conv_backward.hpp"
#include "support/features.hpp"

namespace {

using namespace compmark;
using testing::dense;
using testing::noise;
using testing::values_of;

template <class T>
struct Case {
  ConvShape shape;
  int height, width;
  std::vector<T> input, weight, bias;

  Case(const ConvShape& s, int h, int w)
      : shape(s),
        height(h),
        width(w),
        input(noise<T>(static_cast<std::size_t>(s.in * h * w), 1)),
        weight(noise<T>(static_cast<std::size_t>(s.out) * s.taps(), 2)),
        bias(noise<T>(static_cast<std::size_t>(s.out), 3)) {}

  template <class Policy, class E = SerialExecutor>
  std::vector<T> run(E executor = {}) const {
    return run<Policy>(executor, IdentityFinish{});
  }
  template <class Policy, class E, class Finish>
  std::vector<T> run(E& executor, const Finish& finish) const {
    const Policy policy(shape, weight, bias);
    FeatureMaps<T> maps;
    typename Policy::Scratch scratch;
    policy.resize_output(dense(input, shape.in, height, width), maps);
    policy.forward(dense(input, shape.in, height, width), maps.view(), scratch, executor, finish);
    return values_of(std::as_const(maps).view());
  }
  template <class Policy>
  std::vector<T> gradient(const std::vector<T>& y) const {
    SerialExecutor executor;
    const Policy policy(shape, weight);
    FeatureMaps<T> maps;
    typename Policy::Scratch scratch;
    const auto view = dense(y, shape.out, shape.output_size(height), shape.output_size(width));
    policy.resize_input_gradient(view, height, width, maps);
    policy.backward(view, maps.view(), scratch, executor);
    return values_of(std::as_const(maps).view());
  }
};

template <class A, class B>
double worst(const std::vector<A>& a, const std::vector<B>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double error = std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
    largest = error <= largest ? largest : error;  // a NaN stays
  }
  return largest;
}

template <int Tile>
void equals_direct() {
  double forward = 0, backward = 0;
  for (const std::pair<int, int>& channels : {std::pair{1, 1}, {3, 5}, {9, 8}, {8, 17}}) {
    for (const int padding : {0, 1, 2}) {
      for (const std::pair<int, int>& size : {std::pair{1, 1}, {3, 3}, {2, 9}, {4, 4}, {5, 8}, {9, 13}, {17, 47}}) {
        const ConvShape shape{channels.first, channels.second, 3, 1, padding};
        if (shape.output_size(size.first) < 1 || shape.output_size(size.second) < 1) continue;
        const Case<double> c(shape, size.first, size.second);
        const auto direct = c.run<Convolution<double>>();
        forward = std::max(forward, worst(c.run<WinogradConvolution<double, Tile>>(), direct));
        const auto y = noise<double>(direct.size(), 4);
        backward = std::max(backward, worst(c.gradient<WinogradInputGradient<double, Tile>>(y),
                                            c.gradient<ConvInputGradient<double>>(y)));
      }
    }
  }
  CAPTURE(Tile);
  CHECK(forward < 1e-13);  // sums of at most 81 and 153 products below 1/4 in double; measured 2e-15 (F2) to 4e-14 (F6)
  CHECK(backward < 1e-13);
}

TEST_CASE(
    "math/winograd: equals the direct convolution and its input gradient for every tile, padding and size in double") {
  equals_direct<2>();
  equals_direct<4>();
  equals_direct<6>();
}

/// Largest error of a policy in float over the sum of |w| |x| of the same output, both from double.
template <class Policy>
double relative_error(const Case<float>& c) {
  Case<double> exact(c.shape, c.height, c.width), sizes(c.shape, c.height, c.width);
  const auto copy = [](const std::vector<float>& from, std::vector<double>& to, std::vector<double>& size) {
    to.assign(from.begin(), from.end());
    size = to;
    for (double& value : size) value = std::abs(value);
  };
  copy(c.input, exact.input, sizes.input);
  copy(c.weight, exact.weight, sizes.weight);
  copy(c.bias, exact.bias, sizes.bias);
  const auto result = c.run<Policy>();
  const auto expected = exact.run<Convolution<double>>();
  const auto scale = sizes.run<Convolution<double>>();
  double largest = 0;
  for (std::size_t i = 0; i < result.size(); ++i)
    largest = std::max(largest, std::abs(static_cast<double>(result[i]) - expected[i]) / scale[i]);
  return largest;
}

/// The usual points 1, 2, and points far apart, whose powers cancel.
struct UsualPoints {
  static constexpr std::array<double, 2> value{1, 2};
};
struct IllChosenPoints {
  static constexpr std::array<double, 2> value{1, 8};
};

TEST_CASE("math/winograd: the rounding error in float, relative to the sum of |w| |x|, per tile and choice of points") {
  const Case<float> c({64, 8, 3, 1, 1}, 24, 24);
  const double direct = relative_error<Convolution<float>>(c);
  const double f2 = relative_error<WinogradConvolution<float, 2>>(c);
  const double f4 = relative_error<WinogradConvolution<float, 4>>(c);
  const double usual = relative_error<WinogradConvolution<float, 4, UsualPoints>>(c);
  const double f6 = relative_error<WinogradConvolution<float, 6>>(c);
  const double ill = relative_error<WinogradConvolution<float, 4, IllChosenPoints>>(c);
  CAPTURE(direct);
  CAPTURE(f2);
  CAPTURE(f4);
  CAPTURE(f6);
  CHECK(direct < 3e-7);   // measured 2.0e-7
  CHECK(f2 < direct);     // 6.4e-8: 64 additions in place of 576
  CHECK(f4 < 6e-7);       // 3.5e-7 with the points 3/4 and 3/2
  CHECK(f6 < 4e-6);       // 1.9e-6
  CHECK(usual > 2 * f4);  // 1.3e-6 with 1 and 2
  CHECK(ill > 1e-5);      // 2.0e-4: the control, which the bounds above tell apart
}

TEST_CASE("math/winograd: <conv x, y> = <x, conv^T y>") {
  for (const int padding : {0, 1, 2}) {
    Case<double> c({5, 7, 3, 1, padding}, 19, 22);
    std::fill(c.bias.begin(), c.bias.end(), 0.0);
    const auto output = c.run<WinogradConvolution<double, 4>>();
    const auto y = noise<double>(output.size(), 5);
    const auto dx = c.gradient<WinogradInputGradient<double, 4>>(y);
    double left = 0, right = 0, size = 0;
    for (std::size_t i = 0; i < y.size(); ++i) {
      left += output[i] * y[i];
      size += std::abs(output[i] * y[i]);
    }
    for (std::size_t i = 0; i < dx.size(); ++i) right += dx[i] * c.input[i];
    CHECK(std::abs(left - right) < 1e-13 * size);
  }
}

TEST_CASE("math/winograd: a finish sees the place it writes, and views with gaps keep what lies between their rows") {
  const Case<float> c({3, 5, 3, 1, 1}, 18, 21);
  SerialExecutor executor;
  const WinogradConvolution<float> policy(c.shape, c.weight, c.bias);
  WinogradScratch<float> scratch;
  const std::size_t stride = 25, plane = stride * 18 + 3;
  std::vector<float> wide(plane * 5, -7.0f), kept(plane * 5, -7.0f);
  const auto mask = noise<float>(plane * 5, 8);
  const FeatureView<float> target{wide.data(), 5, 18, 21, stride, plane};
  policy.forward(dense(c.input, 3, 18, 21), target, scratch, executor, [&](auto value, const ConvPlace<float>& place) {
    place.store(value, kept.data());
    return select(place.load(mask.data()) > decltype(value)(0.0f), value, decltype(value)(0.0f));
  });
  const auto expected = c.run<WinogradConvolution<float>>();
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < wide.size(); ++i) {
    const std::size_t o = i / plane, y = i % plane / stride, x = i % plane % stride;
    const bool inside = y < 18 && x < 21;
    const float value = inside ? expected[(o * 18 + y) * 21 + x] : -7.0f;
    wrong += kept[i] == value && wide[i] == (!inside ? -7.0f : (mask[i] > 0 ? value : 0.0f)) ? 0 : 1;
  }
  CHECK(wrong == 0);
}

TEST_CASE("math/winograd: a NaN stays within the tiles that read it") {
  Case<float> c({2, 3, 3, 1, 1}, 40, 43);
  const auto clean = c.run<WinogradConvolution<float>>();
  c.input[20 * 43 + 21] = std::numeric_limits<float>::quiet_NaN();  // row 20, column 21: read by tiles of rows 16 to 23
  const auto spoiled = c.run<WinogradConvolution<float>>();
  std::size_t spread = 0, bad = 0;
  for (std::size_t i = 0; i < clean.size(); ++i) {
    const int y = static_cast<int>(i / 43 % 40), x = static_cast<int>(i % 43);
    const bool near = y >= 16 && y < 24 && x >= 20 && x < 24;
    spread += !near && spoiled[i] != clean[i] ? 1 : 0;
    bad += near && std::isnan(spoiled[i]) ? 1 : 0;
  }
  CHECK(spread == 0);
  CHECK(bad >= 3 * 9);
}

TEST_CASE("math/winograd: same bits at any thread count") {
  const Case<float> c({6, 20, 3, 1, 1}, 61, 70);
  const auto one = c.run<WinogradConvolution<float>>();
  for (const std::size_t threads : {2u, 4u}) {
    ThreadExecutor executor(threads);
    CHECK(c.run<WinogradConvolution<float>>(executor, IdentityFinish{}) == one);
  }
}

}  // namespace
