// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The convolution policy of a decoder with Winograd's F(4 x 4, 3 x 3) where it pays: 3 x 3 kernels at stride 1 from 16
// to 16 channels on; the first layer, whose 3 channels the transforms would not repay, and every other shape are
// direct. Logits differ from the direct sum by rounding only (tests/watermark/decoder/decoder_winograd.test.cpp has the
// figure), far below what moves a bit.
#pragma once

#include <algorithm>
#include <span>

#include "compmark/core/executor.hpp"
#include "compmark/math/winograd.hpp"
#include "compmark/watermark/decoder/decoder_convolution.hpp"

namespace compmark {

template <class T>
class WinogradOrDirect {
 public:
  struct Scratch {
    typename DirectConvolution<T>::Scratch direct;
    WinogradScratch<T> winograd;
    FeatureView<const T> input;  ///< of prepare(), until forward()
  };

  WinogradOrDirect() = default;
  WinogradOrDirect(const ConvShape& shape, std::span<const T> weight, std::span<const T> bias)
      : shape_(shape),
        fast_(shape.kernel == 3 && shape.stride == 1 && shape.padding == 1 && std::min(shape.in, shape.out) >= 16) {
    if (fast_) {
      forward_.assign(shape, weight, bias);
      backward_.assign(shape, weight);
    } else {
      direct_ = DirectConvolution<T>(shape, weight, bias);
    }
  }

  [[nodiscard]] const ConvShape& shape() const { return shape_; }

  template <Executor E>
  void prepare(FeatureView<const T> input, FeatureMaps<T>& output, Scratch& scratch, E& executor) const {
    if (!fast_) return direct_.prepare(input, output, scratch.direct, executor);
    scratch.input = input;
    forward_.resize_output(input, output);
  }
  template <Executor E, class Finish>
  void forward(FeatureView<T> output, Scratch& scratch, E& executor, const Finish& finish) const {
    if (!fast_) return direct_.forward(output, scratch.direct, executor, finish);
    forward_.forward(scratch.input, output, scratch.winograd, executor, finish);
  }
  template <Executor E, class Finish>
  void backward(FeatureView<const T> d_output, FeatureView<T> d_input, Scratch& scratch, E& executor,
                const Finish& finish) const {
    if (!fast_) return direct_.backward(d_output, d_input, scratch.direct, executor, finish);
    backward_.backward(d_output, d_input, scratch.winograd, executor, finish);
  }

 private:
  ConvShape shape_;
  bool fast_ = false;
  DirectConvolution<T> direct_;
  WinogradConvolution<T> forward_;
  WinogradInputGradient<T> backward_;
};

}  // namespace compmark
