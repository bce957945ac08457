// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// FisheyeLens::plane for packs of floats without a loop over lanes: the same equations with A(q) = atan(sqrt q) / sqrt
// q and its derivatives in ~90 flop, two divisions and a root, where the library's arctangent three times a lane was 80
// ns a Gaussian. Other lenses and scalars go to the policy itself.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/math/pack.hpp"
#include "compmark/scene/lens_policy.hpp"

namespace compmark {

namespace detail {

/// A(q), A'(q), A''(q) for q >= 0: below 1/4 the series sum of (-q)^n / (2n + 1), above it Cephes' arctangent (2e-7)
/// and the derivatives by differences, which lose eps / q^2 there.
template <int W>
[[nodiscard]] COMPMARK_INLINE RadialFactor<Pack<float, W>> arctangent_ratio(Pack<float, W> q) {
  using P = Pack<float, W>;
  const P one(1.0f), quarter(0.25f);
  const P near = min(q, quarter);
  P a(1.0f / 27), a1(0.0f), half_a2(0.0f);  // Horner's scheme, with the derivatives of what is there so far
  for (int n = 12; n >= 0; --n) {
    half_a2 = fma(half_a2, near, a1);
    a1 = fma(a1, near, a);
    a = fma(a, near, P((n % 2 == 0 ? 1.0f : -1.0f) / static_cast<float>(2 * n + 1)));
  }
  const auto far = q > quarter;
  const P far_q = max(q, quarter), r = sqrt(far_q);
  const auto steep = r > P(2.41421356f);
  const P x = select(steep, P(-1.0f), r - one) / select(steep, r, r + one), z = x * x;
  P t = fma(P(8.05374449538e-2f), z, P(-1.38776856032e-1f));
  t = fma(t, z, P(1.99777106478e-1f));
  t = fma(t, z, P(-3.33329491539e-1f));
  const P angle = fma(t * z, x, x) + select(steep, P(1.57079633f), P(0.785398163f));
  const P inverse = one / far_q, slope = one / (one + far_q), half = P(0.5f) * inverse;
  const P b = angle * r * inverse, b1 = (slope - b) * half, b2 = -fma(slope, slope, P(3.0f) * b1) * half;
  return {select(far, b, a), select(far, b1, a1), select(far, b2, half_a2 + half_a2)};
}

/// lens.plane(a, b), by the way that is fast for packs.
template <class Lens, class P>
[[nodiscard]] COMPMARK_INLINE LensPlane<P> plane_of(const Lens& lens, P a, P b) {
  return lens.plane(a, b);
}
template <int W>
[[nodiscard]] COMPMARK_INLINE LensPlane<Pack<float, W>> plane_of(const FisheyeLens<float>& lens, Pack<float, W> a,
                                                                 Pack<float, W> b) {
  using P = Pack<float, W>;
  const P q = fma(a, a, b * b), two(2.0f);
  const RadialFactor<P> ratio = arctangent_ratio(q);
  const P &A = ratio.s, &A1 = ratio.s1, &A2 = ratio.s2;
  const P w = q * A * A, w1 = A * fma(two * q, A1, A);  // w = theta^2 and its derivatives by q
  const P w2 = two * fma(two * A, A1, q * fma(A1, A1, A * A2));
  const P k1(lens.k1), k2(lens.k2), k3(lens.k3), k4(lens.k4);
  const P p = fma(w, fma(w, fma(w, fma(w, k4, k3), k2), k1), P(1.0f));
  const P dp = fma(w, fma(w, fma(w, P(4.0f) * k4, P(3.0f) * k3), two * k2), k1);
  const P ddp = fma(w, fma(w, P(12.0f) * k4, P(6.0f) * k3), two * k2);
  const RadialFactor<P> f{A * p, fma(A1, p, A * dp * w1),
                          fma(A2, p, two * A1 * dp * w1 + A * fma(ddp * w1, w1, dp * w2))};
  return lens_plane(a, b, f, P(0.0f), P(0.0f));
}

}  // namespace detail
}  // namespace compmark
