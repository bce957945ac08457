// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Bits that a coder spends on the interval [x - q/2, x + q/2] under a Gaussian, with their derivatives (HAC eq. 7;
// docs/spec/compression.md, 1.4),
//   bits = -log2((1 - 4 e) P + e / (1 + d)^2),  P = Phi(u) - Phi(l),  u, l = (+-q/2 - |x - m|) / s,  e = 2^-16,  s >=
//     0.11 q.
// The second term is what the coder does: no symbol is rarer than e, and beyond 5 s it escapes, at two bits more for
// every doubling of the distance d = t^2 / (1 + t), t = (|x - m| - 5 s) / q > 0 (docs/spec/numerics.md, EN4). P is
// never a difference of two numbers near 1: with Mills' ratio M(x) = (1 - Phi(x)) / phi(x) and E = phi(l) / phi(u) =
// exp(-|x - m| q / s^2), P = phi(u) (M(-u) - E M(-l)) outside the central bin, whatever the distance, and every
// derivative is a quotient without phi (case EN1). Where s is held at 0.11 q, a gradient that pulls s up passes (case
// EN2). Cost in packs: 2 exp, 2 Mills, 1 log, about 90 operations.
#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#include "compmark/math/functions.hpp"
#include "compmark/math/pack.hpp"

namespace compmark {

inline constexpr double coder_floor = 0x1p-16;  ///< probability of the rarest symbol
inline constexpr double coder_window = 5;       ///< standard deviations a table reaches
inline constexpr double least_relative_sigma =
    0.11;  ///< in steps; below, an integer table cannot follow (docs/spec/compression.md, 3.2)

/// Bits and their derivatives; that by the mean is -d_value.
template <class P>
struct GaussianBits {
  P bits, d_value, d_sigma, d_step;
};

namespace detail {

/// log2(x) of positive normal x; a NaN stays one. Relative error of x 1e-7 in float (atanh series on [sqrt(1/2),
/// sqrt(2)]).
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> log2_positive(Pack<T, W> x) {
  using P = Pack<T, W>;
  if constexpr (!std::is_same_v<T, float> || W == 1) {
    P result;
    for (int i = 0; i < W; ++i) result.set(i, std::log2(x.lane(i)));
    return result;
  } else {
    using Integers = typename LaneStorage<std::int32_t, W>::type;
    const Integers bits = (Integers)x.native - 0x3F3504F3;  // sqrt(1/2)
    const Integers exponent = bits >> 23;
    const P m = P::from_native((typename P::Native)((bits & 0x007FFFFF) + 0x3F3504F3));
    const P s = (m - P(1.0f)) / (m + P(1.0f)), s2 = s * s;
    P r = fma(s2, P(0.222222222f), P(0.285714286f));
    r = fma(r, s2, P(0.4f));
    r = fma(r, s2, P(0.666666667f));
    r = fma(r, s2, P(2.0f));
    const P n = P::from_native(__builtin_convertvector(exponent, typename P::Native));
    return select(x == x, fma(s * r, P(1.44269504f), n), x);
  }
}

/// Mills' ratio for x >= 0: the upper tail in units of the density. Relative error 2e-7 in float (fitted in 1 / (1 + x
/// / 4)); other scalars by erfc and, from 5 on, by Laplace's continued fraction.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> mills_ratio(Pack<T, W> x) {
  using P = Pack<T, W>;
  if constexpr (std::is_same_v<T, float>) {
    const P t = P(1.0f) / fma(x, P(0.25f), P(1.0f));
    P r = fma(t, P(0.0521751878f), P(-0.2140390582f));
    r = fma(r, t, P(0.2601851514f));
    r = fma(r, t, P(-0.0996306118f));
    r = fma(r, t, P(0.1711375283f));
    r = fma(r, t, P(0.1439964151f));
    r = fma(r, t, P(0.2052668664f));
    r = fma(r, t, P(0.2342181295f));
    r = fma(r, t, P(0.2500045788f));
    r = fma(r, t, P(0.2499999773f));
    return t * r;
  } else {
    P result;
    for (int i = 0; i < W; ++i) {
      const T v = x.lane(i);
      T ratio = v;
      if (v < T(5)) {
        ratio = std::sqrt(std::atan(T(1)) * 2) * std::exp(v * v / 2) * std::erfc(v / std::sqrt(T(2)));
      } else if (v < T(1e8)) {
        for (int k = 120; k > 0; --k) ratio = v + static_cast<T>(k) / ratio;
        ratio = 1 / ratio;
      } else {
        ratio = 1 / v;
      }
      result.set(i, ratio);
    }
    return result;
  }
}

/// 1 - exp(-x) for x >= 0, all digits for small x too.
template <class T, int W>
[[nodiscard]] COMPMARK_INLINE Pack<T, W> one_minus_exp(Pack<T, W> x, Pack<T, W> exp_of_minus_x) {
  using P = Pack<T, W>;
  if constexpr (std::is_same_v<T, float>) {
    P r = fma(x, P(-1.0f / 120), P(1.0f / 24));
    r = fma(r, x, P(-1.0f / 6));
    r = fma(r, x, P(0.5f));
    r = fma(-r, x, P(1.0f));
    // r = 1 - x/2 + x^2/6 - x^3/24 + x^4/120
    return select(x < P(0.125f), x * r, P(1.0f) - exp_of_minus_x);
  } else {
    P result;
    for (int i = 0; i < W; ++i) result.set(i, -std::expm1(-x.lane(i)));
    return result;
  }
}

}  // namespace detail

/// Lane by lane. With `floored` false the coder's floor and escape are left out: bits of the Gaussian alone, exact at
/// any distance.
template <bool floored = true, class T, int W>
[[nodiscard]] COMPMARK_INLINE GaussianBits<Pack<T, W>> gaussian_bits(const Pack<T, W>& value, const Pack<T, W>& mean,
                                                                     const Pack<T, W>& raw_sigma,
                                                                     const Pack<T, W>& step) {
  using P = Pack<T, W>;
  constexpr T log2_e = T(1.442695040888963407359924681001892137L);
  constexpr T inverse_root = T(0.398942280401432677939946059934381868L);  // 1 / sqrt(2 pi)
  const auto held = raw_sigma < P(T(least_relative_sigma)) * step;
  const P sigma = select(held, P(T(least_relative_sigma)) * step, raw_sigma);
  const P difference = value - mean, v = abs(difference);
  const P inverse = P(T(1)) / sigma;
  const P z = min(P(T(1e9)), v * inverse), h = step * inverse, half = P(T(0.5)) * h;
  const P u = half - z, x = z * h;
  const P e = exp(-x), e1 = detail::one_minus_exp(x, e);
  // R = P / phi(u). Narrow intervals of a smooth density: h (1 - E) / (z h) (1 + h^2 / 12).
  constexpr T narrow = std::is_same_v<T, float> ? T(1) / 16 : T(1) / 4096;
  const P near = detail::mills_ratio(abs(u)), far = detail::mills_ratio(z + half);
  const P exponent = P(T(-0.5)) * u * u;
  const P density = P(inverse_root) * exp(exponent);
  const P wide_ratio = select(u > P(T(0)), P(T(1)) / density - near, near) - e * far;
  const P mean_slope = select(x < P(T(1e-20)), P(T(1)), e1 / max(x, P(T(1e-20))));
  const P ratio = select(h < P(narrow), h * mean_slope * fma(h, h * P(T(1) / 12), P(T(1))), wide_ratio);

  const P scale = inverse / ratio;
  const P e2 = P(T(1)) + e;
  P d_value = -e1 * scale, d_sigma = (z * e1 - half * e2) * scale, d_step = P(T(0.5)) * e2 * scale;  // of ln P
  GaussianBits<P> result;
  if constexpr (floored) {
    const P t = min(max((v - P(T(coder_window)) * sigma) / step, P(T(0))), P(T(1e6)));
    const P t1 = P(T(1)) + t, shrink = t1 / fma(t, t, t1);
    const P interval = P(T(1 - 4 * coder_floor)) * density * ratio, floor = P(T(coder_floor)) * shrink * shrink;
    const P p = interval + floor;
    const P w = interval / p, f = floor / p;
    const P d_t = P(T(-2)) * t * (t + P(T(2))) / (t1 * t1) * shrink * f / step;  // d ln F / dt, over q
    d_value = w * d_value + d_t;
    d_sigma = w * d_sigma - P(T(coder_window)) * d_t;
    d_step = w * d_step - t * d_t;
    result.bits = -detail::log2_positive(p);
  } else {
    result.bits = -(P(log2_e) * exponent + detail::log2_positive(P(inverse_root) * ratio));
  }
  result.d_value = P(-log2_e) * select(difference < P(T(0)), -d_value, d_value);
  d_sigma = P(-log2_e) * d_sigma;
  result.d_step = P(-log2_e) * d_step + select(held, P(T(least_relative_sigma)) * d_sigma, P(T(0)));
  result.d_sigma = select(held, min(d_sigma, P(T(0))), d_sigma);
  return result;
}

/// One value.
template <bool floored = true, class T>
[[nodiscard]] inline GaussianBits<T> gaussian_bits(T value, T mean, T sigma, T step) {
  const auto r = gaussian_bits<floored>(Pack<T, 1>(value), Pack<T, 1>(mean), Pack<T, 1>(sigma), Pack<T, 1>(step));
  return {r.bits.lane(0), r.d_value.lane(0), r.d_sigma.lane(0), r.d_step.lane(0)};
}

}  // namespace compmark
