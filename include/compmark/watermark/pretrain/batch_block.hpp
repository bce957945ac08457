// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One block of a network in training, on a batch of images of any sizes: convolution, batch normalisation with the
// statistics of the batch (Ioffe and Szegedy, arXiv 1502.03167), exact GELU. With x over all positions of all images of
// the batch, per channel,
//   y = gain (x - mean) / sqrt(variance + epsilon) + shift,
//   running += momentum (statistic - running),  the variance as n / (n - 1) times it
//   dx = gain / sqrt(variance + epsilon) (dy - mean(dy) - xhat mean(dy xhat))
// A frozen decoder uses the running statistics; after few steps of momentum 0.01 they still remember their start
// (docs/spec/watermark.md, 1.6). Cost: three convolutions of the forward's size in all, and ~100 operations a value.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/math/conv_backward.hpp"
#include "compmark/math/gelu.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

/// Views of one block's weights or gradients.
template <class T>
struct BlockWeights {
  std::span<T> weight;  ///< [out, in, kernel, kernel]
  std::span<T> bias;    ///< [out], and so are the others
  std::span<T> gain;
  std::span<T> shift;
};

template <class T>
class BatchBlock {
 public:
  struct Context {
    std::vector<ConvInput<T>> input;
    std::vector<FeatureMaps<T>> normal;  ///< xhat
    std::vector<FeatureMaps<T>> slope;   ///< of GELU at y
    std::vector<T> inverse;              ///< 1 / sqrt(variance + epsilon)
    Convolution<T> convolution;
    ConvInputGradient<T> input_gradient;
    ConvScratch<T> scratch;
    ConvWeightScratch<T> weight_scratch;
    typename ConvInputGradient<T>::Scratch gradient_scratch;
  };

  explicit BatchBlock(ConvShape shape = {}, double epsilon = 1e-3, double momentum = 0.01)
      : shape_(shape),
        epsilon_(epsilon),
        momentum_(momentum) {}
  [[nodiscard]] const ConvShape& shape() const { return shape_; }

  /// Fills `output`; updates the running statistics.
  template <Executor E>
  void forward(std::span<const FeatureView<const T>> input, BlockWeights<const T> weights, std::span<T> running_mean,
               std::span<T> running_variance, std::vector<FeatureMaps<T>>& output, Context& context,
               E& executor) const {
    const std::size_t batch = input.size();
    context.input.resize(batch);
    context.normal.resize(batch);
    context.slope.resize(batch);
    output.resize(batch);
    context.inverse.resize(static_cast<std::size_t>(shape_.out));
    context.convolution.assign(shape_, weights.weight, weights.bias);
    for (std::size_t i = 0; i < batch; ++i) {
      context.input[i].pack(input[i], shape_.stride, shape_.padding, executor);
      context.convolution.resize_output(context.input[i], context.normal[i]);
      context.convolution.forward(context.input[i], context.normal[i].view(), context.scratch, executor,
                                  IdentityFinish{});
      const FeatureView<T> map = context.normal[i].view();
      context.slope[i].resize(map.channels, map.height, map.width);
      output[i].resize(map.channels, map.height, map.width);
    }
    executor.for_chunks(static_cast<std::size_t>(shape_.out), 1, [&](std::size_t c, std::size_t, std::size_t) {
      normalise(c, running_mean[c], running_variance[c], context);
      activate(c, weights.gain[c], weights.shift[c], output, context);
    });
  }

  /// Adds to the gradients of the weights; fills d_input. `d_output` is used up.
  template <Executor E>
  void backward(std::span<const FeatureView<T>> d_output, BlockWeights<const T> weights, BlockWeights<T> gradients,
                std::vector<FeatureMaps<T>>& d_input, Context& context, E& executor) const {
    executor.for_chunks(static_cast<std::size_t>(shape_.out), 1, [&](std::size_t c, std::size_t, std::size_t) {
      normalise_backward(c, weights.gain[c], gradients.gain[c], gradients.shift[c], d_output, context);
    });
    context.input_gradient.assign(shape_, weights.weight);
    d_input.resize(d_output.size());
    for (std::size_t i = 0; i < d_output.size(); ++i) {
      const ConvInput<T>& in = context.input[i];
      convolution_weight_gradient(shape_, in, FeatureView<const T>(d_output[i]), gradients.weight, gradients.bias,
                                  context.weight_scratch, executor);
      context.input_gradient.resize_input_gradient(d_output[i], in.height, in.width, d_input[i]);
      context.input_gradient.backward(d_output[i], d_input[i].view(), context.gradient_scratch, executor);
    }
  }

 private:
  using P = Pack<T, native_width<T>>;

  /// visit(row pointers..., count) of channel c in every image.
  template <class Maps, class Visit>
  static void rows(const Maps& maps, std::size_t c, const Visit& visit) {
    for (std::size_t i = 0; i < maps.size(); ++i) {
      for (int y = 0; y < maps[i].height; ++y) visit(i, y, maps[i].row(static_cast<int>(c), y), maps[i].width);
    }
  }
  static std::vector<FeatureView<T>> views(std::vector<FeatureMaps<T>>& maps) {
    std::vector<FeatureView<T>> result;
    for (FeatureMaps<T>& map : maps) result.push_back(map.view());
    return result;
  }

  /// In double: a mean of 1e5 values in float loses what the variance is made of.
  void normalise(std::size_t c, T& running_mean, T& running_variance, Context& context) const {
    const auto maps = views(context.normal);
    double count = 0, sum = 0, square = 0;
    rows(maps, c, [&](std::size_t, int, const T* row, int width) {
      for (int x = 0; x < width; ++x) sum += static_cast<double>(row[x]);
      count += width;
    });
    const double mean = sum / count;
    rows(maps, c, [&](std::size_t, int, const T* row, int width) {
      for (int x = 0; x < width; ++x) {
        const double d = static_cast<double>(row[x]) - mean;
        square += d * d;
      }
    });
    const double inverse = 1 / std::sqrt(square / count + epsilon_);
    rows(maps, c, [&](std::size_t, int, T* row, int width) {
      for (int x = 0; x < width; ++x) row[x] = (row[x] - static_cast<T>(mean)) * static_cast<T>(inverse);
    });
    context.inverse[c] = static_cast<T>(inverse);
    running_mean += static_cast<T>(momentum_ * (mean - static_cast<double>(running_mean)));
    running_variance +=
        static_cast<T>(momentum_ * (square / (count > 1 ? count - 1 : 1) - static_cast<double>(running_variance)));
  }

  void activate(std::size_t c, T gain, T shift, std::vector<FeatureMaps<T>>& output, Context& context) const {
    rows(views(context.normal), c, [&](std::size_t i, int y, const T* row, int width) {
      T* value = output[i].view().row(static_cast<int>(c), y);
      T* slope = context.slope[i].view().row(static_cast<int>(c), y);
      for (int x = 0; x < width; x += P::width) {
        const auto mask = Mask<T, P::width>::first(width - x);
        const auto at = gelu_with_slope(fma(P(gain), P::load(row + x, mask), P(shift)));
        at.value.store(value + x, mask);
        at.slope.store(slope + x, mask);
      }
    });
  }

  void normalise_backward(std::size_t c, T gain, T& d_gain, T& d_shift, std::span<const FeatureView<T>> d_output,
                          Context& context) const {
    double count = 0, sum = 0, product = 0;
    rows(d_output, c, [&](std::size_t i, int y, T* row, int width) {
      const T* slope = context.slope[i].view().row(static_cast<int>(c), y);
      const T* normal = context.normal[i].view().row(static_cast<int>(c), y);
      for (int x = 0; x < width; ++x) {
        row[x] *= slope[x];
        sum += static_cast<double>(row[x]);
        product += static_cast<double>(row[x] * normal[x]);
      }
      count += width;
    });
    d_gain += static_cast<T>(product);
    d_shift += static_cast<T>(sum);
    const T scale = gain * context.inverse[c];
    const T mean = static_cast<T>(sum / count), mean_product = static_cast<T>(product / count);
    rows(d_output, c, [&](std::size_t i, int y, T* row, int width) {
      const T* normal = context.normal[i].view().row(static_cast<int>(c), y);
      for (int x = 0; x < width; ++x) row[x] = scale * (row[x] - mean - normal[x] * mean_product);
    });
  }

  ConvShape shape_;
  double epsilon_;
  double momentum_;
};

}  // namespace compmark
