// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The network that turns the context of an anchor into its distributions and steps (HAC, section 4.3): Linear -> ReLU
// -> Linear, 96 -> 100 -> 175 as published, of which the last `tail` outputs are the steps. Only anchors whose rate is
// counted need all outputs; the others need the tail, 3 of 175. Panels of 64 anchors, row-major; lanes are the columns
// of a layer, so that nothing is transposed but the weights, once an iteration. Sums over anchors run in panel order.
// Cost an anchor: forward 9.6 k multiply-adds and backward 19 k for the hidden layer, 17.5 k and 35 k more for all
// outputs.
#pragma once

#include <algorithm>
#include <cstddef>

#include "compmark/core/buffer.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/dense.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

template <class T, int input_count, int hidden_count, int output_count, int tail_count>
struct ContextNetwork {
  static constexpr int W = native_width<T>;
  static constexpr int round_up(int n) { return (n + W - 1) / W * W; }
  static constexpr int panel = 64;
  static constexpr int inputs = input_count, hidden = hidden_count, outputs = output_count, tail = tail_count;
  static constexpr int input_row = round_up(inputs), hidden_row = round_up(hidden), output_row = round_up(outputs),
                       tail_row = round_up(tail);

  /// Weights [out, in] and biases, or their gradients, as the arena holds them.
  template <class U>
  struct Views {
    MatrixView<U> weight1, bias1, weight2, bias2;
  };

  // Weights as the products read them.
  static constexpr int forward1 = 0;                                   // [inputs, hidden_row]
  static constexpr int start1 = forward1 + inputs * hidden_row;        // [hidden_row]
  static constexpr int forward2 = start1 + hidden_row;                 // [hidden, output_row]
  static constexpr int start2 = forward2 + hidden * output_row;        // [output_row]
  static constexpr int forward_tail = start2 + output_row;             // [hidden, tail_row]
  static constexpr int start_tail = forward_tail + hidden * tail_row;  // [tail_row]
  static constexpr int packed_gradients = start_tail + tail_row;       // sums of a chunk have the layout so far
  static constexpr int back1 = packed_gradients;                       // [hidden, input_row]
  static constexpr int back2 = back1 + hidden * input_row;             // [outputs, hidden_row]
  static constexpr int packed_count = back2 + outputs * hidden_row;
  static constexpr std::size_t gradient_count = static_cast<std::size_t>(packed_gradients);

  static void pack(const Views<const T>& from, Buffer<T>& packed) {
    packed.resize(static_cast<std::size_t>(packed_count), T(0));
    T* const to = packed.data();
    for (int h = 0; h < hidden; ++h) {
      for (int i = 0; i < inputs; ++i) {
        const T weight = from.weight1.data[h * inputs + i];
        to[forward1 + i * hidden_row + h] = weight;
        to[back1 + h * input_row + i] = weight;
      }
      to[start1 + h] = from.bias1.data[h];
    }
    for (int o = 0; o < outputs; ++o) {
      const int t = o - (outputs - tail);
      for (int h = 0; h < hidden; ++h) {
        const T weight = from.weight2.data[o * hidden + h];
        to[forward2 + h * output_row + o] = weight;
        to[back2 + o * hidden_row + h] = weight;
        if (t >= 0) to[forward_tail + h * tail_row + t] = weight;
      }
      to[start2 + o] = from.bias2.data[o];
      if (t >= 0) to[start_tail + t] = from.bias2.data[o];
    }
  }
  /// Adds the sums of one chunk into the gradients.
  static void add_gradients(const T* sums, const Views<T>& to) {
    for (int h = 0; h < hidden; ++h) {
      for (int i = 0; i < inputs; ++i) to.weight1.data[h * inputs + i] += sums[forward1 + i * hidden_row + h];
      to.bias1.data[h] += sums[start1 + h];
    }
    for (int o = 0; o < outputs; ++o) {
      const int t = o - (outputs - tail);
      for (int h = 0; h < hidden; ++h) {
        T& weight = to.weight2.data[o * hidden + h];
        weight += sums[forward2 + h * output_row + o];
        if (t >= 0) weight += sums[forward_tail + h * tail_row + t];
      }
      to.bias2.data[o] += sums[start2 + o];
      if (t >= 0) to.bias2.data[o] += sums[start_tail + t];
    }
  }

  /// One panel: input [64, input_row] -> hidden [64, hidden_row] -> all outputs [64, output_row] or the tail [64,
  /// tail_row].
  static void hidden_layer(const T* packed, const T* input, T* to) {
    constexpr ProductShape s{panel, hidden_row, inputs, input_row, 1, hidden_row, hidden_row};
    product<T, W, s>(input, packed + forward1, to, StartColumns{packed + start1}, FinishRelu<T, W>{});
  }
  static void all_outputs(const T* packed, const T* from, T* to) {
    constexpr ProductShape s{panel, output_row, hidden, hidden_row, 1, output_row, output_row};
    product<T, W, s>(from, packed + forward2, to, StartColumns{packed + start2}, FinishLinear<T, W>{});
  }
  static void tail_outputs(const T* packed, const T* from, T* to) {
    constexpr ProductShape s{panel, tail_row, hidden, hidden_row, 1, tail_row, tail_row};
    product<T, W, s>(from, packed + forward_tail, to, StartColumns{packed + start_tail}, FinishLinear<T, W>{});
  }

  /// From the gradients of the outputs of one panel: adds to the chunk's sums, writes d_hidden (scratch) and d_input.
  /// Rows that are no anchors hold zeros in d_output.
  static void backward_all(const T* packed, const T* input, const T* from, const T* d_output, T* d_hidden, T* d_input,
                           T* sums) {
    constexpr ProductShape down{panel, hidden_row, outputs, output_row, 1, hidden_row, hidden_row};
    product<T, W, down>(d_output, packed + back2, d_hidden, StartZero<T, W>{}, FinishSlope{from});
    constexpr ProductShape weights{hidden, output_row, panel, 1, hidden_row, output_row, output_row};
    product<T, W, weights>(from, d_output, sums + forward2, StartAccumulate<T, W>{}, FinishLinear<T, W>{});
    add_rows<output_row>(d_output, sums + start2);
    backward_hidden(packed, input, d_hidden, d_input, sums);
  }
  static void backward_tail(const T* packed, const T* input, const T* from, const T* d_tail, T* d_hidden, T* d_input,
                            T* sums) {
    constexpr ProductShape down{panel, hidden_row, tail, tail_row, 1, hidden_row, hidden_row};
    product<T, W, down>(d_tail, packed + back2 + (outputs - tail) * hidden_row, d_hidden, StartZero<T, W>{},
                        FinishSlope{from});
    constexpr ProductShape weights{hidden, tail_row, panel, 1, hidden_row, tail_row, tail_row};
    product<T, W, weights>(from, d_tail, sums + forward_tail, StartAccumulate<T, W>{}, FinishLinear<T, W>{});
    add_rows<tail_row>(d_tail, sums + start_tail);
    backward_hidden(packed, input, d_hidden, d_input, sums);
  }

 private:
  static void backward_hidden(const T* packed, const T* input, const T* d_hidden, T* d_input, T* sums) {
    constexpr ProductShape weights{inputs, hidden_row, panel, 1, input_row, hidden_row, hidden_row};
    product<T, W, weights>(input, d_hidden, sums + forward1, StartAccumulate<T, W>{}, FinishLinear<T, W>{});
    add_rows<hidden_row>(d_hidden, sums + start1);
    constexpr ProductShape down{panel, input_row, hidden, hidden_row, 1, input_row, input_row};
    product<T, W, down>(d_hidden, packed + back1, d_input, StartZero<T, W>{}, FinishLinear<T, W>{});
  }
  template <int row>
  static void add_rows(const T* from, T* sums) {
    for (int column = 0; column < row; column += W) {
      Pack<T, W> sum = Pack<T, W>::load(sums + column);
      for (int i = 0; i < panel; ++i) sum = sum + Pack<T, W>::load(from + i * row + column);
      sum.store(sums + column);
    }
  }
  /// One start a column.
  struct StartColumns {
    const T* bias;
    COMPMARK_INLINE Pack<T, W> operator()(int /*row*/, int column, const T* /*c*/) const {
      return Pack<T, W>::load(bias + column);
    }
  };
  /// A hidden unit that was 0 passes no gradient.
  struct FinishSlope {
    const T* on;
    COMPMARK_INLINE Pack<T, W> operator()(int row, int column, Pack<T, W> sum) const {
      return keep(Pack<T, W>::load(on + row * hidden_row + column) > Pack<T, W>(T(0)), sum);
    }
  };
};

}  // namespace compmark
