// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Elementary functions on packs, each with its range and its largest error; tests/math/functions.test.cpp asserts these
// numbers.
#pragma once

#include <cmath>

#include "compmark/math/pack.hpp"

namespace compmark {

namespace detail {

/// 2^f for f in [-1/2, 1/2], minimax in relative error with p(0) = 1 exactly (docs/spec/numerics.md, BF5). Written out,
/// not looped: a loop over a coefficient array stopped g++ 12 from vectorising (case SY3). P is a Pack, or any type
/// with its arithmetic (several packs in step).
template <int Degree, class P>
[[nodiscard]] COMPMARK_INLINE P exp2_fraction(P f) {
  using T = typename P::Scalar;
  static_assert(Degree >= 2 && Degree <= 6, "exp2_fraction: degree 2 to 6");
  const auto c = [](double x) { return P(static_cast<T>(x)); };
  if constexpr (Degree == 2) {
    return fma(fma(c(.239864090), f, c(.702941828)), f, c(1));
  } else if constexpr (Degree == 3) {
    return fma(fma(fma(c(.055008935), f, c(.242210998)), f, c(.693282931)), f, c(1));
  } else if constexpr (Degree == 4) {
    return fma(fma(fma(fma(c(.00958285406), f, c(.0559064303)), f, c(.240240986)), f, c(.693124193)), f, c(1));
  } else if constexpr (Degree == 5) {
    return fma(
        fma(fma(fma(fma(c(.00132647278), f, c(.00967151326)), f, c(.0555073375)), f, c(.240222421)), f, c(.693146978)),
        f, c(1));
  } else {
    P r = fma(c(.000153533645), f, c(.00133988751));
    r = fma(r, f, c(.00961843735));
    r = fma(r, f, c(.0555033247));
    r = fma(r, f, c(.240226479));
    r = fma(r, f, c(.693147203));
    return fma(r, f, c(1));
  }
}

}  // namespace detail

/// exp(x) for x in [-87, 0], the range of a splat's exponent is [-16, 0]. Degree 0 is std::exp (exact to 1 ulp).
/// Largest relative error in float on [-5.55, 0]: degree 2 2.0e-3, 3 1.02e-4, 4 3.0e-6, 5 2.4e-7, 6 1.6e-7 (on [-16, 0]
/// 3.0e-7, on [-87, 0] 1.3e-6: the reduction has one constant); without a fused multiply-add 5 4.0e-7, 6 3.3e-7
/// (9.7e-7, 3.9e-6). exp_negative(0) = 1 exactly, never above 1; not monotone to the last bit.
template <int Degree, class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> exp_negative(Pack<T, W> x) {
  using P = Pack<T, W>;
  if constexpr (Degree == 0) {
    P result;
    for (int i = 0; i < W; ++i) result.set(i, std::exp(x.lane(i)));
    return result;
  } else {
    const P n = round_to_even(x * P(T(1.44269504088896340736L)));
    const P f = fma(x, P(T(1.44269504088896340736L)), -n);
    return scale_by_power_of_two(detail::exp2_fraction<Degree>(f), n);
  }
}

/// exp(x) for x in [-87, 88] (clamped to it): two-constant reduction, degree 6, relative error 1.2e-7 in float. A NaN
/// stays one, and so it does in sigmoid and tanh (docs/spec/numerics.md, ML4): it is the second operand of max and min,
/// and only its share of the exponent is zero. Scalars other than float use std::exp, so that double and long double
/// references are exact to 1 ulp.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> exp(Pack<T, W> x) {
  using P = Pack<T, W>;
  if constexpr (!std::is_same_v<T, float>) {
    P result;
    for (int i = 0; i < W; ++i) result.set(i, std::exp(x.lane(i)));
    return result;
  } else {
    x = min(P(88.0f), max(P(-87.0f), x));
    P n = round_to_even(x * P(1.44269504f));
    if constexpr (!detail::uses_mask_register<T, W>) n = keep(n == n, n);  // there, n is converted to an integer
    P f = fma(n, P(-0.693359375f), x);
    f = fma(n, P(2.12194440e-4f), f);
    return scale_by_power_of_two(detail::exp2_fraction<6>(f * P(1.44269504f)), n);
  }
}

/// 1 / (1 + exp(-x)) without overflow (docs/spec/numerics.md, ML1); relative error 2.4e-7 in float for |x| <= 80.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> sigmoid(Pack<T, W> x) {
  using P = Pack<T, W>;
  const P e = exp(-abs(x));
  const P positive = P(T(1)) / (P(T(1)) + e);
  return select(x < P(T(0)), e * positive, positive);
}

/// tanh(x): odd series below 0.4 (keeps the relative error), (1 - e) / (1 + e) with e = exp(-2 |x|) above; the sign is
/// that of x. Relative error 2.1e-7 in float, odd to the bit, never above 1.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> tanh(Pack<T, W> x) {
  using P = Pack<T, W>;
  if constexpr (!std::is_same_v<T, float>) {
    P result;
    for (int i = 0; i < W; ++i) result.set(i, std::tanh(x.lane(i)));
    return result;
  } else {
    const P a = abs(x);
    const P e = exp(P(-2.0f) * a);
    const P large = (P(1.0f) - e) / (P(1.0f) + e);
    const P s = x * x;
    P r = fma(P(-0.0088632355f), s, P(0.021869488f));  // Taylor coefficients of tanh(x)/x in x^2
    r = fma(r, s, P(-0.053968254f));
    r = fma(r, s, P(0.133333333f));
    r = fma(r, s, P(-0.333333333f));
    const P small = fma(x * s, r, x);
    return select(a < P(0.4f), small, select(x < P(0.0f), -large, large));
  }
}

/// The slope of tanh at x, 1 / cosh^2(x) = 4 e / (1 + e)^2 with e = exp(-2 |x|). From x and not from tanh(x), of which
/// 1 - tanh^2 is 0 from |x| = 9 on in float, so that what lies there never moves again (docs/spec/numerics.md, ML2).
/// Relative error 4e-7 in float for |x| <= 43; above, it stays that of 43.5.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> tanh_slope(Pack<T, W> x) {
  using P = Pack<T, W>;
  const P e = exp(P(T(-2)) * abs(x));
  const P r = P(T(2)) / (P(T(1)) + e);
  return e * r * r;
}

}  // namespace compmark
