// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The transforms of 2, 3, 4 and 5 values (and of any small odd number known at compile time) that the passes of Fft are
// made of. Cost in additions and multiply-adds on packs: 4, 16, 16, 40.
#pragma once

#include "compmark/core/config.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/unroll.hpp"

namespace compmark::detail {

template <class P>
struct FftParts {
  P re, im;
};

/// y_k = sum_j a_j exp(-2 pi i j k / Radix). An odd radix pairs a_j with a_(Radix - j), which share cosine and sine;
/// `roots` holds the cosines and sines of 2 pi j / Radix in turn (not read for radix 2 and 4).
template <int Radix, class P>
COMPMARK_INLINE void fft_butterfly(const typename P::Scalar* roots, const FftParts<P> (&a)[Radix],
                                   FftParts<P> (&y)[Radix]) {
  using T = typename P::Scalar;
  using Parts = FftParts<P>;
  if constexpr (Radix == 2) {
    y[0] = {a[0].re + a[1].re, a[0].im + a[1].im};
    y[1] = {a[0].re - a[1].re, a[0].im - a[1].im};
  } else if constexpr (Radix == 4) {
    const Parts s02{a[0].re + a[2].re, a[0].im + a[2].im}, d02{a[0].re - a[2].re, a[0].im - a[2].im};
    const Parts s13{a[1].re + a[3].re, a[1].im + a[3].im}, d13{a[1].re - a[3].re, a[1].im - a[3].im};
    y[0] = {s02.re + s13.re, s02.im + s13.im};
    y[1] = {d02.re + d13.im, d02.im - d13.re};
    y[2] = {s02.re - s13.re, s02.im - s13.im};
    y[3] = {d02.re - d13.im, d02.im + d13.re};
  } else {
    constexpr int half = (Radix - 1) / 2;
    Parts sum[half], difference[half];
    y[0] = a[0];
    unroll<half>([&](auto j) __attribute__((always_inline)) {
      constexpr int low = decltype(j)::value + 1, high = Radix - low;
      sum[j()] = {a[low].re + a[high].re, a[low].im + a[high].im};
      difference[j()] = {a[low].re - a[high].re, a[low].im - a[high].im};
      y[0] = {y[0].re + sum[j()].re, y[0].im + sum[j()].im};
    });
    unroll<half>([&](auto k) __attribute__((always_inline)) {
      constexpr int row = decltype(k)::value + 1;
      Parts even = a[0], odd{P(T(0)), P(T(0))};
      unroll<half>([&](auto j) __attribute__((always_inline)) {
        constexpr int index = (decltype(j)::value + 1) * (decltype(k)::value + 1) % Radix;
        const P c(roots[2 * index]), s(roots[2 * index + 1]);
        even = {fma(c, sum[j()].re, even.re), fma(c, sum[j()].im, even.im)};
        odd = {fma(s, difference[j()].re, odd.re), fma(s, difference[j()].im, odd.im)};
      });
      y[row] = {even.re + odd.im, even.im - odd.re};
      y[Radix - row] = {even.re - odd.im, even.im + odd.re};
    });
  }
}

}  // namespace compmark::detail
