// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/math/conv_backward.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/testing/gradient.hpp"
#include "support/features.hpp"

namespace {

using namespace compmark;
using testing::dense;
using testing::noise;
using testing::values_of;

std::size_t count_of(int channels, int height, int width) {
  return static_cast<std::size_t>(channels * height * width);
}

/// One convolution with its data and gradients.
template <class T, class E = SerialExecutor>
struct Layer {
  ConvShape shape;
  int height, width;
  std::vector<T> input, weight, bias;
  E* executor;
  ConvInput<T> packed{};
  FeatureMaps<T> maps{}, gradient{};
  ConvScratch<T> scratch{};
  typename ConvInputGradient<T>::Scratch backward_scratch{};
  ConvWeightScratch<T> weight_scratch{};

  Layer(const ConvShape& s, int h, int w, E& e)
      : shape(s),
        height(h),
        width(w),
        input(noise<T>(count_of(s.in, h, w), 1)),
        weight(noise<T>(static_cast<std::size_t>(s.out) * s.taps(), 2)),
        bias(noise<T>(static_cast<std::size_t>(s.out), 3)),
        executor(&e) {}

  std::vector<T> forward() {
    const Convolution<T> convolution(shape, weight, bias);
    packed.pack(dense(input, shape.in, height, width), shape.stride, shape.padding, *executor);
    convolution.resize_output(packed, maps);
    convolution.forward(packed, maps.view(), scratch, *executor, IdentityFinish{});
    return values_of(std::as_const(maps).view());
  }
  FeatureView<const T> output_view(const std::vector<T>& y) const {
    return dense(y, shape.out, shape.output_size(height), shape.output_size(width));
  }
  std::vector<T> input_gradient(const std::vector<T>& y) {
    const ConvInputGradient<T> adjoint(shape, weight);
    adjoint.resize_input_gradient(output_view(y), height, width, gradient);
    adjoint.backward(output_view(y), gradient.view(), backward_scratch, *executor);
    return values_of(std::as_const(gradient).view());
  }
  std::pair<std::vector<T>, std::vector<T>> weight_gradient(const std::vector<T>& y) {
    std::vector<T> dw(weight.size(), T(0)), db(bias.size(), T(0));
    convolution_weight_gradient<T>(shape, packed, output_view(y), dw, db, weight_scratch, *executor);
    return {dw, db};
  }
};

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

/// |<conv x - bias, y> - <x, conv^T y>| and |<conv x, y> - <w, dw> - <b, db>|, relative to the sum of the products'
/// sizes.
std::pair<double, double> adjoint_errors(const ConvShape& shape, int height, int width) {
  SerialExecutor executor;
  Layer<double> layer(shape, height, width, executor);
  const auto output = layer.forward();
  const auto y = noise<double>(output.size(), 4);
  const auto dx = layer.input_gradient(y);
  const auto parts = layer.weight_gradient(y);
  REQUIRE(dx.size() == layer.input.size());
  const double of_bias = dot(layer.bias, parts.second), forward = dot(output, y);
  double size = 0;
  for (std::size_t i = 0; i < y.size(); ++i) size += std::abs(output[i] * y[i]);
  return {std::abs(forward - of_bias - dot(layer.input, dx)) / size,
          std::abs(forward - of_bias - dot(layer.weight, parts.first)) / size};
}

TEST_CASE(
    "math/conv_backward: <conv x, y> = <x, conv^T y> = <w, dw> + <b, db> for kernels, strides, paddings and small "
    "sizes") {
  // sums of at most 5 * 363 * 81 products in double: a few hundred roundings of 1.1e-16; a wrong tap is an error of
  // order 0.1
  double worst_input = 0, worst_weight = 0;
  int cases = 0;
  for (const int kernel : {1, 2, 3, 4, 5, 11}) {
    for (const int stride : {1, 2, 3, 4}) {
      for (const int padding : {0, 1, 2, 5}) {
        for (int size = 1; size <= 9; ++size) {
          const int height = size, width = 10 - size % 4;
          if (height + 2 * padding < kernel || width + 2 * padding < kernel) continue;
          const auto errors = adjoint_errors({3, 5, kernel, stride, padding}, height, width);
          worst_input = std::max(worst_input, errors.first);
          worst_weight = std::max(worst_weight, errors.second);
          ++cases;
        }
      }
    }
  }
  CHECK(cases > 500);
  CHECK(worst_input < 1e-13);
  CHECK(worst_weight < 1e-13);
}

TEST_CASE("math/conv_backward: adjoint at channel counts around the blocks and sizes beyond one block of positions") {
  for (const std::pair<int, int>& channels : {std::pair{1, 1}, {2, 9}, {9, 8}, {7, 13}}) {
    const auto errors = adjoint_errors({channels.first, channels.second, 3, 1, 1}, 41, 37);
    CHECK(errors.first < 1e-13);
    CHECK(errors.second < 1e-13);
  }
}

TEST_CASE("math/conv_backward: input, weight and bias gradients are those of central differences") {
  for (const ConvShape& shape : {ConvShape{2, 3, 3, 1, 1}, {3, 2, 3, 2, 1}, {2, 2, 11, 4, 2}, {2, 3, 1, 1, 0}}) {
    SerialExecutor executor;
    Layer<double> layer(shape, 9, 11, executor);
    const auto target = noise<double>(layer.forward().size(), 5);
    const auto loss = [&] {
      const auto output = layer.forward();
      double sum = 0;
      for (std::size_t i = 0; i < output.size(); ++i) sum += 0.5 * (output[i] - target[i]) * (output[i] - target[i]);
      return sum;
    };
    std::vector<double> y = layer.forward();
    for (std::size_t i = 0; i < y.size(); ++i) y[i] -= target[i];
    const auto dx = layer.input_gradient(y);
    const auto parts = layer.weight_gradient(y);
    CHECK(testing::gradient_law(loss, layer.input, std::span<const double>(dx)) == "");
    CHECK(testing::gradient_law(loss, layer.weight, std::span<const double>(parts.first)) == "");
    CHECK(testing::gradient_law(loss, layer.bias, std::span<const double>(parts.second)) == "");
    std::vector<double> unflipped = dx;  // control: the law sees a gradient that is off by one pixel
    std::rotate(unflipped.begin(), unflipped.begin() + 1, unflipped.end());
    CHECK(testing::gradient_law(loss, layer.input, std::span<const double>(unflipped)) != "");
  }
}

TEST_CASE("math/conv_backward: dense and strided gradient layouts hold the same values, and a finish sees the place") {
  SerialExecutor executor;
  for (const ConvShape& shape : {ConvShape{3, 4, 3, 1, 1}, {3, 4, 3, 2, 1}}) {
    const int height = 10, width = 21;
    Layer<double> layer(shape, height, width, executor);
    const auto y = noise<double>(layer.forward().size(), 6);
    const auto dx = layer.input_gradient(y);
    const auto mask = noise<double>(dx.size() + 8, 7);
    std::vector<double> dense_gradient(dx.size());
    const ConvInputGradient<double> adjoint(shape, layer.weight);
    const FeatureView<const double> as = dense(dense_gradient, 3, height, width);
    const FeatureView<double> target{dense_gradient.data(), 3, height, width, as.row_stride, as.plane_stride};
    const auto relu = [&](auto value, const ConvPlace<double>& place) {
      return select(place.load(mask.data()) > decltype(value)(0.0), value, decltype(value)(0.0));
    };
    adjoint.backward(layer.output_view(y), target, layer.backward_scratch, executor, relu);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < dx.size(); ++i) wrong += dense_gradient[i] == (mask[i] > 0 ? dx[i] : 0.0) ? 0 : 1;
    CHECK(wrong == 0);
  }
}

TEST_CASE("math/conv_backward: weight gradients are added to what is there, and the bias may be left out") {
  SerialExecutor executor;
  Layer<double> layer({2, 3, 3, 1, 1}, 7, 5, executor);
  const auto y = noise<double>(layer.forward().size(), 6);
  const auto once = layer.weight_gradient(y).first;
  std::vector<double> twice = once;
  convolution_weight_gradient<double>(layer.shape, layer.packed, layer.output_view(y), twice, {}, layer.weight_scratch,
                                      executor);
  for (std::size_t i = 0; i < once.size(); ++i) CHECK(twice[i] == 2 * once[i]);
}

TEST_CASE("math/conv_backward: same bits at any thread count") {
  std::vector<std::vector<float>> results;
  for (const std::size_t threads : {1u, 2u, 4u}) {
    ThreadExecutor executor(threads);
    for (const int stride : {1, 2}) {
      Layer<float, ThreadExecutor> layer({6, 20, 3, stride, 1}, 61, 70, executor);
      const auto y = noise<float>(layer.forward().size(), 6);
      const auto dx = layer.input_gradient(y);
      const auto parts = layer.weight_gradient(y);
      if (stride == 1) results.emplace_back();
      results.back().insert(results.back().end(), dx.begin(), dx.end());
      results.back().insert(results.back().end(), parts.first.begin(), parts.first.end());
      results.back().insert(results.back().end(), parts.second.begin(), parts.second.end());
    }
  }
  CHECK(results[0] == results[1]);
  CHECK(results[0] == results[2]);
}

}  // namespace
