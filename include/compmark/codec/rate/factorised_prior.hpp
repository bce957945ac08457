// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The factorised prior of the hyperprior z (Balle et al., ICLR 2018, appendix 6.1; docs/spec/compression.md, 2.2):
// every channel has a cumulative of its own, sigmoid(c(z)), where c is five affine layers 1-3-3-3-3-1 with positive
// matrices softplus(H), each but the last followed by x + tanh(a) tanh(x). A symbol k costs
//   bits = -log2((1 - 4 e) P + e / (1 + d)^2),  P = sigmoid(c(k + 1/2)) - sigmoid(c(k - 1/2)),  e = 2^-16,
// d = t^2 / (1 + t), t = |k| - 15 > 0: no symbol is rarer than e, and beyond +-15 the coder escapes (the published
// tails are never trained: docs/spec/compression.md, 5.10). With a, b the two logits P = sigmoid(a) sigmoid(-b) (1 -
// exp(b - a)), a product without cancellation at any distance. A channel's 58 scalars, as the arena and a file hold
// them: layer by layer matrix [out, in], bias [out], factor [out]; the last has no factor. Medians are 0. Lanes are
// anchors. Cost of a scalar with its derivatives: 24 tanh, 5 exp and some 250 multiply-adds.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "compmark/codec/rate/gaussian_rate.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

/// Symbols of z that a table holds lie in +- this; the others escape.
inline constexpr int hyperprior_window = 15;

template <class T, int channel_count>
struct FactorisedPrior {
  static constexpr int channels = channel_count;
  static constexpr int parameters = 58;  ///< of a channel
  static constexpr double start_width = 0.5;
  static constexpr std::size_t count = static_cast<std::size_t>(channels * parameters);
  static constexpr int W = native_width<T>;
  using P = Pack<T, W>;

  /// The kind of a channel's scalar, by its index 0 ... 57.
  enum class Kind : std::uint8_t { matrix, bias, factor };
  [[nodiscard]] static constexpr Kind kind(int index) {
    if (index >= last) return index < last + 3 ? Kind::matrix : Kind::bias;
    const int in = index < 9 ? 1 : 3, place = index < 9 ? index : (index - 9) % 15;
    return place < 3 * in ? Kind::matrix : (place < 3 * in + 3 ? Kind::bias : Kind::factor);
  }

  /// A logistic density half a symbol wide in every channel, 1.1 bits for z = 0, which is what an explicit z begins
  /// with. `values` [channels, 58]. (CompressAI's, ten wide, 5.3 bits, waits for an analysis network; 1,300 iterations
  /// later it still cost 3.2.)
  static void initialise(MatrixView<T> values, std::uint64_t seed) {
    const Random random(seed, 0, random_stage("factorised prior"));
    const double scale = std::pow(start_width, 0.2);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const int index = static_cast<int>(i % static_cast<std::size_t>(parameters));
      double value = 0;
      if (kind(index) == Kind::matrix) value = std::log(std::expm1(1 / scale / (index >= last ? 1 : 3)));
      if (kind(index) == Kind::bias) value = random.uniform(i) - 0.5;
      values.data[i] = static_cast<T>(value);
    }
  }

  /// The values that bits() reads: softplus of matrices, tanh of factors. `ready` [channels * 58].
  static void prepare(MatrixView<const T> values, T* ready) {
    for (std::size_t i = 0; i < count; ++i) {
      const T x = values.data[i];
      const Kind of = kind(static_cast<int>(i % static_cast<std::size_t>(parameters)));
      ready[i] = of == Kind::bias     ? x
                 : of == Kind::factor ? std::tanh(x)
                                      : std::max(x, T(0)) + std::log1p(std::exp(-std::abs(x)));
    }
  }
  /// Adds the sums by what prepare() wrote into the gradients by the values.
  static void add_gradients(MatrixView<const T> values, const T* ready, const T* sums, MatrixView<T> gradients) {
    for (std::size_t i = 0; i < count; ++i) {
      const Kind of = kind(static_cast<int>(i % static_cast<std::size_t>(parameters)));
      const T slope = of == Kind::bias     ? T(1)
                      : of == Kind::factor ? 1 - ready[i] * ready[i]
                                           : 1 / (1 + std::exp(-values.data[i]));
      gradients.data[i] += sums[i] * slope;
    }
  }

  /// P of one symbol in a channel whose 58 `ready` scalars begin at `r`, without floor and escape. A file need not hold
  /// the prior: 31 frequencies a channel and that of the escape say all that a decoder wants to know, in fewer bytes
  /// and in whole numbers.
  [[nodiscard]] static T probability(const T* r, T symbol) {
    Trace trace;
    const P a = logit(r, P(symbol + T(0.5)), trace), b = logit(r, P(symbol - T(0.5)), trace);
    return (sigmoid(a) * sigmoid(-b) * detail::one_minus_exp(a - b, exp(b - a))).lane(0);
  }

  /// Of `anchors` (a multiple of W) anchors, with z and d_z channel after channel [channels, anchors]: adds each one's
  /// bits to bits [anchors], writes the derivatives of sum weight * bits by z, and adds those by `ready` to sums
  /// [channels * 58].
  static void bits(const T* ready, const T* z, std::size_t anchors, const T* weight, T* bits, T* d_z, T* sums) {
    for (int channel = 0; channel < channels; ++channel) {
      const T* const r = ready + channel * parameters;
      const std::size_t first = static_cast<std::size_t>(channel) * anchors;
      P sum[parameters];
      for (P& s : sum) s = P(T(0));
      for (std::size_t i = 0; i < anchors; i += static_cast<std::size_t>(W)) {
        const P x = P::load(z + first + i), w = P::load(weight + i);
        Trace upper, lower;
        const P a = logit(r, x + P(T(0.5)), upper), b = logit(r, x - P(T(0.5)), lower);
        const P above = sigmoid(a), above1 = sigmoid(-a), below = sigmoid(b), below1 = sigmoid(-b);
        const P between = a - b;
        constexpr T share = T(1 - 4 * coder_floor);
        const P interval = P(share) * above * below1 * detail::one_minus_exp(between, exp(-between));
        const P t = max(abs(x) - P(T(hyperprior_window)), P(T(0))), t1 = P(T(1)) + t;
        const P shrink = t1 / fma(t, t, t1), floor = P(T(coder_floor)) * shrink * shrink;
        const P p = interval + floor;
        (P::load(bits + i) - detail::log2_positive(p)).store(bits + i);
        // d bits = -log2(e) dp / p
        const P scale = P(T(-1.442695040888963407359924681001892137L)) * w / p;
        const P d_floor = P(T(-2)) * t * (t + P(T(2))) / (t1 * fma(t, t, t1)) * floor;
        P d = select(x < P(T(0)), -d_floor, d_floor) * scale;
        d = d + back(r, upper, P(share) * above * above1 * scale, sum);
        d = d + back(r, lower, P(-share) * below * below1 * scale, sum);
        d.store(d_z + first + i);
      }
      for (int k = 0; k < parameters; ++k) sums[channel * parameters + k] += reduce_add(sum[k]);
    }
  }

 private:
  static constexpr int last = 54;  // where the last layer begins
  struct Trace {
    P input, value[4][3], tanh[4][3];
  };
  [[nodiscard]] static constexpr int layer_begin(int layer) { return layer == 0 ? 0 : 9 + 15 * (layer - 1); }

  static P logit(const T* r, P x, Trace& trace) {
    trace.input = x;
    for (int layer = 0; layer < 4; ++layer) {
      const int in = layer == 0 ? 1 : 3, at = layer_begin(layer);
      for (int j = 0; j < 3; ++j) {
        P sum(r[at + 3 * in + j]);
        for (int k = 0; k < in; ++k) {
          sum = fma(P(r[at + in * j + k]), layer == 0 ? x : trace.value[layer - 1][k], sum);
        }
        trace.tanh[layer][j] = compmark::tanh(sum);
        trace.value[layer][j] = fma(P(r[at + 3 * in + 3 + j]), trace.tanh[layer][j], sum);
      }
    }
    P sum(r[last + 3]);
    for (int k = 0; k < 3; ++k) sum = fma(P(r[last + k]), trace.value[3][k], sum);
    return sum;
  }
  /// From the derivative by the logit: that by its argument; adds those by r.
  static P back(const T* r, const Trace& trace, P d_logit, P* sum) {
    P d[3];
    for (int k = 0; k < 3; ++k) {
      sum[last + k] = fma(d_logit, trace.value[3][k], sum[last + k]);
      d[k] = d_logit * P(r[last + k]);
    }
    sum[last + 3] = sum[last + 3] + d_logit;
    for (int layer = 4; layer-- > 0;) {
      const int in = layer == 0 ? 1 : 3, at = layer_begin(layer);
      P next[3] = {P(T(0)), P(T(0)), P(T(0))};
      for (int j = 0; j < 3; ++j) {
        const P t = trace.tanh[layer][j];
        const int factor = at + 3 * in + 3 + j;
        sum[factor] = fma(d[j], t, sum[factor]);
        const P before = d[j] * fma(P(r[factor]), fma(-t, t, P(T(1))), P(T(1)));
        sum[at + 3 * in + j] = sum[at + 3 * in + j] + before;
        for (int k = 0; k < in; ++k) {
          const int matrix = at + in * j + k;
          sum[matrix] = fma(before, layer == 0 ? trace.input : trace.value[layer - 1][k], sum[matrix]);
          next[k] = fma(before, P(r[matrix]), next[k]);
        }
      }
      for (int k = 0; k < 3; ++k) d[k] = next[k];
    }
    return d[0];
  }
};

}  // namespace compmark
