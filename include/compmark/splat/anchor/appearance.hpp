// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Appearance embedding: one trained vector e a training view, which the colour head sees after its other inputs
// (docs/spec/method.md, 1.3). It is the same for all anchors of a view, so that its part of the first layer is a bias:
// b' = b + W_e e. Nothing happens per anchor:
//   forward   b' = b + W_e e        backward   dW_e += db' e^T,  de += W_e^T db',  db += db'
// Cost: 2 D A operations a view. A view that was not trained looks like the mean of those that were (the published code
// takes the last one).
#pragma once

#include <cstddef>

#include "compmark/core/absent.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// No embedding: no table, no input, no work.
struct NoAppearance : Absent<NoAppearance> {};

/// The embedding as a bias. `weight` is the first layer of the colour head [D, inputs + A]; its last A columns belong
/// to the embedding. A view that was not trained on (index beyond the table) looks like the mean of those that were.
struct AppearanceEmbedding {
  template <class T>
  static void fold(MatrixView<const T> weight, MatrixView<const T> bias, MatrixView<const T> table, std::size_t view,
                   T* folded_bias) {
    const std::size_t first = weight.columns - table.columns;
    for (std::size_t h = 0; h < weight.rows; ++h) folded_bias[h] = bias(0, h);
    for (std::size_t a = 0; a < table.columns; ++a) {
      const T embedding = entry(table, view, a);
      for (std::size_t h = 0; h < weight.rows; ++h) folded_bias[h] += weight(h, first + a) * embedding;
    }
  }

  /// Adds the gradients of W_e and e; the gradient of the bias itself is d_bias and is added by the caller.
  template <class T>
  static void backward(MatrixView<const T> weight, MatrixView<const T> table, std::size_t view, const T* d_bias,
                       MatrixView<T> d_weight, MatrixView<T> d_table) {
    const std::size_t first = weight.columns - table.columns;
    const bool seen = view < table.rows;
    for (std::size_t a = 0; a < table.columns; ++a) {
      const T embedding = entry(table, view, a);
      T d_embedding(0);
      for (std::size_t h = 0; h < weight.rows; ++h) {
        d_weight(h, first + a) += d_bias[h] * embedding;
        d_embedding += d_bias[h] * weight(h, first + a);
      }
      if (seen) {
        d_table(view, a) += d_embedding;
      } else {
        for (std::size_t row = 0; row < table.rows; ++row) d_table(row, a) += d_embedding / static_cast<T>(table.rows);
      }
    }
  }

 private:
  template <class T>
  [[nodiscard]] static T entry(MatrixView<const T> table, std::size_t view, std::size_t a) {
    if (view < table.rows) return table(view, a);
    T sum(0);
    for (std::size_t row = 0; row < table.rows; ++row) sum += table(row, a);
    return table.rows == 0 ? sum : sum / static_cast<T>(table.rows);
  }
};

}  // namespace compmark
