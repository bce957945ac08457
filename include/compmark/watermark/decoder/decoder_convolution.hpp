// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How a decoder's network convolves: a policy with forward and backward to the input. DirectConvolution takes every
// shape. A policy keeps no state of a pass: prepare() copies the input into scratch and shapes the output, forward()
// fills it; activations and their slopes are applied by the finish functor while a value is still in a register.
#pragma once

#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/math/conv.hpp"
#include "compmark/math/conv_backward.hpp"

namespace compmark {

template <class T>
class DirectConvolution {
 public:
  struct Scratch {
    ConvInput<T> packed;
    ConvScratch<T> convolution;
    typename ConvInputGradient<T>::Scratch gradient;
  };

  DirectConvolution() = default;
  DirectConvolution(const ConvShape& shape, std::span<const T> weight, std::span<const T> bias)
      : convolution_(shape, weight, bias),
        gradient_(shape, weight) {}

  [[nodiscard]] const ConvShape& shape() const { return convolution_.shape(); }

  template <Executor E>
  void prepare(FeatureView<const T> input, FeatureMaps<T>& output, Scratch& scratch, E& executor) const {
    scratch.packed.pack(input, shape().stride, shape().padding, executor);
    convolution_.resize_output(scratch.packed, output);
  }
  /// Fills `output` with finish(value, place); both finish and place as in Convolution::forward.
  template <Executor E, class Finish>
  void forward(FeatureView<T> output, Scratch& scratch, E& executor, const Finish& finish) const {
    convolution_.forward(scratch.packed, output, scratch.convolution, executor, finish);
  }
  /// Fills `d_input`, of the input's size and any layout, with finish(gradient, place).
  template <Executor E, class Finish>
  void backward(FeatureView<const T> d_output, FeatureView<T> d_input, Scratch& scratch, E& executor,
                const Finish& finish) const {
    gradient_.backward(d_output, d_input, scratch.gradient, executor, finish);
  }

 private:
  Convolution<T> convolution_;
  ConvInputGradient<T> gradient_;
};

}  // namespace compmark
