// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The exact GELU (Hendrycks and Gimpel 2016), gelu(x) = x Phi(x) with the normal distribution Phi(x) = erfc(-x /
// sqrt(2)) / 2, and its slope Phi(x) + x phi(x). The tanh formula is another function (4.7e-4 away) and fails the
// decoder parity test. In float the tail q(a) = Phi(-a) is exp(-a^2 / 2) times a polynomial of degree 5 in 1 / (1 + p
// a) (Abramowitz and Stegun 7.1.26), so that one exponential serves value and slope. Cost: ~35 operations and a
// division. Other scalars use std::erfc and std::exp. tests/math/gelu.test.cpp asserts the errors.
#pragma once

#include <cmath>
#include <numbers>
#include <type_traits>

#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

/// Value and slope of an activation.
template <class P>
struct Activated {
  P value;
  P slope;
};

/// The definition, in any scalar with std::erfc.
template <class T>
[[nodiscard]] T gelu(T x) requires(std::is_floating_point_v<T>) {
  return x * (T(0.5) * std::erfc(-x / std::numbers::sqrt2_v<T>));
}
template <class T>
[[nodiscard]] T gelu_slope(T x) requires(std::is_floating_point_v<T>) {
  const T density = std::exp(T(-0.5) * x * x) * (std::numbers::inv_sqrtpi_v<T> / std::numbers::sqrt2_v<T>);
  return T(0.5) * std::erfc(-x / std::numbers::sqrt2_v<T>) + x * density;
}

/// gelu and its slope. Largest error in float, over all x: value 1e-7 (1 + |x|), slope 3e-7 (measured 8.2e-8 and
/// 2.4e-7). A NaN stays one; infinities have their limits: value 0 and slope 0 at the left, infinity and 1 at the
/// right.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Activated<Pack<T, W>> gelu_with_slope(Pack<T, W> x) {
  using P = Pack<T, W>;
  if constexpr (!std::is_same_v<T, float>) {
    Activated<P> result;
    for (int i = 0; i < W; ++i) {
      result.value.set(i, gelu(x.lane(i)));
      result.slope.set(i, gelu_slope(x.lane(i)));
    }
    return result;
  } else {
    const P a = min(P(13.0f), abs(x));  // a NaN is the second operand, which min returns; the tail is 0 from there on
    const P e = exp(P(-0.5f) * a * a);
    const P t = P(1.0f) / fma(P(0.23164189f), a, P(1.0f));  // p / sqrt(2)
    P q = fma(P(0.530702715f), t, P(-0.726576014f));        // half of a5, a4, ... a1
    q = fma(q, t, P(0.710706871f));
    q = fma(q, t, P(-0.142248368f));
    q = fma(q, t, P(0.127414796f));
    q = q * t * e;
    const P aq = a * q;
    const P tail_slope = fma(P(-0.398942280f) * a, e, q);  // slope at -a
    return {max(P(0.0f), x) - aq, select(x < P(0.0f), tail_slope, P(1.0f) - tail_slope)};
  }
}

template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> gelu(Pack<T, W> x) {
  return gelu_with_slope(x).value;
}

}  // namespace compmark
