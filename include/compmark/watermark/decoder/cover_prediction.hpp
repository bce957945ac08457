// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Predicts the cover interference from the view: the logits that renders of the unmarked model give. A few directions
// of a decoder's features p change much with the view and hardly with a mark; they span the nuisance subspace. The
// logits of the unmarked model are a smooth function of the coordinates in it, which is fitted once
// (watermark/fit/decoder_fit.hpp) and subtracted from every reading:
//   x = direction p - offset,   logits -= sum_i exp(-|x - centre_i|^2 / 2) coefficient_i.
// Far from every centre nothing is subtracted: an image that is no render of the scene is read as if there were no
// prediction. Empty by default, and then free. Cost: centres (coordinates + bits) multiply-adds an image, and as many
// exponentials as centres.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace compmark {

template <class T>
struct CoverPrediction {
  std::vector<T> direction;    ///< [coordinates, features], scaled so that the kernel's width is 1
  std::vector<T> offset;       ///< [coordinates]
  std::vector<T> centre;       ///< [centres, coordinates]
  std::vector<T> coefficient;  ///< [centres, bits]

  struct Context {
    std::vector<T> x, d_x;
    std::vector<T> weight;     ///< of the centres
    std::vector<double> said;  ///< [bits] prediction, in double: large coefficients cancel
  };

  [[nodiscard]] bool empty() const { return offset.empty(); }
  [[nodiscard]] std::size_t coordinates() const { return offset.size(); }
  [[nodiscard]] std::size_t centres() const { return empty() ? 0 : centre.size() / offset.size(); }

  /// Subtracts from logits [bits] the unmarked model's prediction at the view that `features` [features] determine.
  void subtract(std::span<const T> features, std::span<T> logits, Context& context) const {
    const std::size_t n = coordinates();
    context.x.resize(n);
    for (std::size_t d = 0; d < n; ++d) {
      T sum = -offset[d];
      for (std::size_t k = 0; k < features.size(); ++k) sum += direction[d * features.size() + k] * features[k];
      context.x[d] = sum;
    }
    context.weight.resize(centres());
    context.said.assign(logits.size(), 0.0);
    for (std::size_t i = 0; i < context.weight.size(); ++i) {
      T square(0);
      for (std::size_t d = 0; d < n; ++d) {
        const T difference = context.x[d] - centre[i * n + d];
        square += difference * difference;
      }
      context.weight[i] = std::exp(-square / 2);
      for (std::size_t b = 0; b < logits.size(); ++b)
        context.said[b] +=
            static_cast<double>(context.weight[i]) * static_cast<double>(coefficient[i * logits.size() + b]);
    }
    for (std::size_t b = 0; b < logits.size(); ++b) logits[b] -= static_cast<T>(context.said[b]);
  }

  /// Adds the gradient through the prediction to d_features, after subtract() with the same context. The gradient
  /// through the head is not part of it.
  void backward(std::span<const T> d_logits, std::span<T> d_features, Context& context) const {
    const std::size_t n = coordinates();
    context.d_x.assign(n, T(0));
    for (std::size_t i = 0; i < context.weight.size(); ++i) {
      double slope = 0;
      for (std::size_t b = 0; b < d_logits.size(); ++b)
        slope += static_cast<double>(coefficient[i * d_logits.size() + b]) * static_cast<double>(d_logits[b]);
      const T scale = static_cast<T>(slope) * context.weight[i];
      for (std::size_t d = 0; d < n; ++d) context.d_x[d] += scale * (context.x[d] - centre[i * n + d]);
    }
    for (std::size_t d = 0; d < n; ++d) {
      for (std::size_t k = 0; k < d_features.size(); ++k)
        d_features[k] += context.d_x[d] * direction[d * d_features.size() + k];
    }
  }
};

}  // namespace compmark
