// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Feature bank (docs/spec/method.md, 1.3; off in every published script): the heads see a mixture of the feature at
// three resolutions whose weights depend on the view. With (w0, w1, w2) = softmax of a network of (direction,
// distance), 4 -> D ReLU -> 3, and q = D / 4, h = D / 2:
//   mixed[c] = w0 f[4 (c mod q)] + w1 f[2 (c mod h)] + w2 f[c]
// One anchor at a time, in plain loops of known length; about 25 D operations an anchor forward and twice that
// backward.
#pragma once

#include <cmath>
#include <cstddef>

#include "compmark/core/absent.hpp"
#include "compmark/core/config.hpp"

namespace compmark {

/// The heads see the feature itself.
struct NoFeatureBank : Absent<NoFeatureBank> {};

/// Forward and backward of one anchor; D is the feature's width and the hidden width. The gradients of the network are
/// one plain record, so that a chunk of anchors accumulates into its own.
template <class T, int D>
struct FeatureBank {
  static_assert(D % 4 == 0, "FeatureBank needs a feature width divisible by 4");
  static constexpr int inputs = 4;
  static constexpr int outputs = 3;

  /// Values or gradients: weight1 [D, 4], bias1 [D], weight2 [3, D], bias2 [3], in this order without padding.
  static constexpr int weight1 = 0;
  static constexpr int bias1 = weight1 + D * inputs;
  static constexpr int weight2 = bias1 + D;
  static constexpr int bias2 = weight2 + outputs * D;
  static constexpr int parameter_count = bias2 + outputs;

  /// What forward leaves for backward.
  struct Record {
    T hidden[D];
    T weight[outputs];
  };

  /// view: direction and distance. mixed[D] is what the heads see.
  static void forward(const T* parameters, const T (&view)[inputs], const T* feature, T* mixed, Record& record) {
    T logit[outputs] = {parameters[bias2], parameters[bias2 + 1], parameters[bias2 + 2]};
    for (int h = 0; h < D; ++h) {
      T sum = parameters[bias1 + h];
      for (int i = 0; i < inputs; ++i) sum += parameters[weight1 + h * inputs + i] * view[i];
      record.hidden[h] = sum < T(0) ? T(0) : sum;
    }
    for (int o = 0; o < outputs; ++o) {
      for (int h = 0; h < D; ++h) logit[o] += parameters[weight2 + o * D + h] * record.hidden[h];
    }
    const T most =
        logit[0] > logit[1] ? (logit[0] > logit[2] ? logit[0] : logit[2]) : (logit[1] > logit[2] ? logit[1] : logit[2]);
    T total = 0;
    for (int o = 0; o < outputs; ++o) {
      record.weight[o] = std::exp(logit[o] - most);  // at most 1: no overflow
      total += record.weight[o];
    }
    for (int o = 0; o < outputs; ++o) record.weight[o] /= total;
    for (int c = 0; c < D; ++c) {
      mixed[c] = record.weight[0] * feature[4 * (c % (D / 4))] + record.weight[1] * feature[2 * (c % (D / 2))] +
                 record.weight[2] * feature[c];
    }
  }

  /// Adds into d_parameters, d_view and d_feature.
  static void backward(const T* parameters, const T (&view)[inputs], const T* feature, const Record& record,
                       const T* d_mixed, T* d_parameters, T (&d_view)[inputs], T* d_feature) {
    T d_weight[outputs] = {};
    for (int c = 0; c < D; ++c) {
      d_weight[0] += d_mixed[c] * feature[4 * (c % (D / 4))];
      d_weight[1] += d_mixed[c] * feature[2 * (c % (D / 2))];
      d_weight[2] += d_mixed[c] * feature[c];
      d_feature[c] += record.weight[2] * d_mixed[c];
    }
    for (int c = 0; c < D; ++c) {
      d_feature[4 * (c % (D / 4))] += record.weight[0] * d_mixed[c];
      d_feature[2 * (c % (D / 2))] += record.weight[1] * d_mixed[c];
    }
    const T mean = record.weight[0] * d_weight[0] + record.weight[1] * d_weight[1] + record.weight[2] * d_weight[2];
    T d_logit[outputs];
    for (int o = 0; o < outputs; ++o) {
      d_logit[o] = record.weight[o] * (d_weight[o] - mean);
      d_parameters[bias2 + o] += d_logit[o];
    }
    for (int h = 0; h < D; ++h) {
      T d_hidden = 0;
      for (int o = 0; o < outputs; ++o) {
        d_hidden += d_logit[o] * parameters[weight2 + o * D + h];
        d_parameters[weight2 + o * D + h] += d_logit[o] * record.hidden[h];
      }
      if (!(record.hidden[h] > T(0))) continue;
      d_parameters[bias1 + h] += d_hidden;
      for (int i = 0; i < inputs; ++i) {
        d_parameters[weight1 + h * inputs + i] += d_hidden * view[i];
        d_view[i] += d_hidden * parameters[weight1 + h * inputs + i];
      }
    }
  }
};

}  // namespace compmark
