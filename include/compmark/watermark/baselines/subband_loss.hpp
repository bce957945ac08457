// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The wavelet-subband loss of 3D-GSW (Jang et al., CVPR 2025): the details of a picture are held to those of its target,
//   sum over levels 1 and 2 and the bands LH, HL, HH of mean |band(x) - band(y)|,
// bands of "bior4.4" in their published scale (wavelet_band.hpp). It leaves the low band alone, which the message is
// read from. A transform is linear, so the difference x - y is transformed once. Cost: six bands and a low one of the
// difference, there and back.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/splat/training/stage.hpp"
#include "compmark/watermark/baselines/wavelet_band.hpp"
#include "compmark/watermark/baselines/wavelet_low.hpp"

namespace compmark {

/// Of planar images of one shape.
template <class T>
class SubbandLoss {
 public:
  using Scalar = T;
  static constexpr int levels = 2;
  struct Context {
    std::array<WaveletBand<T>, 3> details{WaveletBand<T>{WaveletPass::high, WaveletPass::low},
                                          WaveletBand<T>{WaveletPass::low, WaveletPass::high},
                                          WaveletBand<T>{WaveletPass::high, WaveletPass::high}};
    std::array<WaveletLow<T>, levels> low;
    std::array<Buffer<T>, levels> difference, d_difference;  ///< of the picture and of its low band
    Buffer<T> band;
  };

  /// The loss; ADDS `weight` times its gradient to d_rendered.
  template <Executor E>
  double forward_backward(ImageView<const T> rendered, ImageView<const T> target, T weight, ImageView<T> d_rendered,
                          Context& context, E& executor) const {
    COMPMARK_ASSERT(rendered.size() == target.size() && rendered.size() == d_rendered.size(),
                    "SubbandLoss: three images of one shape");
    std::array<ImageView<T>, levels> at, d_at;
    int height = rendered.height, width = rendered.width;
    for (std::size_t level = 0; level < at.size(); ++level) {
      const std::size_t size = static_cast<std::size_t>(rendered.channels) * static_cast<std::size_t>(height) *
                               static_cast<std::size_t>(width);
      context.difference[level].resize(size);
      context.d_difference[level].resize(size);
      at[level] = {context.difference[level].data(), rendered.channels, height, width};
      d_at[level] = {context.d_difference[level].data(), rendered.channels, height, width};
      for (std::size_t i = 0; i < size; ++i) d_at[level].data[i] = T(0);
      height = WaveletBand<T>::size(height);
      width = WaveletBand<T>::size(width);
    }
    for (std::size_t i = 0; i < rendered.size(); ++i) at[0].data[i] = rendered.data[i] - target.data[i];
    double loss = 0, scale = 1;
    for (std::size_t level = 0; level < at.size(); ++level) {
      scale *= 2;
      for (WaveletBand<T>& detail : context.details)
        loss += of_band(detail, at[level], scale, weight, d_at[level], context.band, executor);
      if (level + 1 < at.size()) context.low[level].forward(ImageView<const T>(at[level]), at[level + 1], executor);
    }
    for (std::size_t level = at.size() - 1; level > 0; --level)
      context.low[level - 1].adjoint(ImageView<const T>(d_at[level]), d_at[level - 1], executor);
    for (std::size_t i = 0; i < rendered.size(); ++i) d_rendered.data[i] += d_at[0].data[i];
    return loss;
  }

 private:
  template <class E>
  static double of_band(WaveletBand<T>& detail, ImageView<const T> difference, double scale, T weight,
                        ImageView<T> d_difference, Buffer<T>& storage, E& executor) {
    const int height = WaveletBand<T>::size(difference.height), width = WaveletBand<T>::size(difference.width);
    storage.resize(static_cast<std::size_t>(difference.channels) * static_cast<std::size_t>(height) *
                   static_cast<std::size_t>(width));
    const ImageView<T> band{storage.data(), difference.channels, height, width};
    detail.forward(difference, band, executor);
    const double each = scale / static_cast<double>(band.size());
    const T slope = static_cast<T>(each) * weight;
    double sum = 0;
    for (std::size_t i = 0; i < band.size(); ++i) {
      const T value = band.data[i];
      sum += std::abs(static_cast<double>(value));
      band.data[i] = value > T(0) ? slope : value < T(0) ? -slope : T(0);
    }
    detail.adjoint(ImageView<const T>(band), d_difference, executor);
    return each * sum;
  }
};

/// The stage of it: its loss, times a weight, is added to every photographed view's.
template <class T>
class SubbandLossStage : public Stage<SubbandLossStage<T>> {
 public:
  struct Context {
    double loss = 0;  ///< the last one, without the weight
    typename SubbandLoss<T>::Context scratch;
  };

  double weight = 0.3;

  template <class Pass, class Own, class Report>
  void loss(const Pass& pass, const Own& own, Report& report) const {
    own.context.loss = SubbandLoss<T>().forward_backward(pass.context.image, pass.target.image, static_cast<T>(weight),
                                                         pass.context.d_image, own.context.scratch, pass.executor);
    report.total += weight * own.context.loss;
  }
  template <class Own, class Image>
  static void no_loss(const Own& own, const Image& /*image*/) {
    own.context.loss = 0;
  }
};

}  // namespace compmark
