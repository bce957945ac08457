// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Kernels of the structural similarity on packs. The published formula S = A1 A2 / (B1 B2) is rewritten in the
// difference d = x - y:
//   e1 = B1 - A1 = mean(d)^2,   e2 = B2 - A2 = var(d) = G*(d^2) - mean(d)^2,   1 - S = (A1 e2 + e1 B2) / (B1 B2),
// which needs four blurs (x, d, x y, d^2) instead of five and has no cancellation near S = 1: identical images give 1 -
// S = 0 and a gradient of exact zeros (docs/spec/numerics.md, LS9). x and y enter x y minus 1/2, so that E[xy] -
// E[x]E[y] keeps its digits on bright images (case LS1). Gradient of S (docs/spec/method.md, 3.1 in the same
// variables), X = x - 1/2, mu unshifted, M shifted means:
//   p = 2 A1 / (B1 B2),  q = p e2 / B2,  u = 2 A2 (mu_y e1 - mu_d A1) / (B1^2 B2) - M_x q + mu_d p,
//   dS/dx = G*u + X G*q - d G*p.
#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "compmark/core/config.hpp"
#include "compmark/math/gaussian_window.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/unroll.hpp"

namespace compmark {
namespace detail {

/// The window as packs, centre first.
template <class P>
struct SsimTaps {
  std::array<P, ssim_radius + 1> tap;
  SsimTaps() {
    const auto weights = ssim_window<typename P::Scalar>();
    for (std::size_t k = 0; k < tap.size(); ++k) tap[k] = P(weights[k]);
  }
  [[nodiscard]] COMPMARK_INLINE P at(int k) const { return tap[static_cast<std::size_t>(k < 0 ? -k : k)]; }
};

/// Maps blurred in the forward pass, and how many.
inline constexpr int blur_x = 0, blur_d = 1, blur_xy = 2, blur_dd = 3, ssim_blurs = 4;
/// Maps blurred in the backward pass, and how many.
inline constexpr int map_u = 0, map_q = 1, map_p = 2, ssim_maps = 3;

/// Vertical blur of the four forward maps at one pack of columns, for Rows output rows at once: every pixel is loaded
/// and multiplied out once and used in Rows windows. x_rows and y_rows hold Rows + 10 row pointers.
template <int Rows, class P, class Load>
COMPMARK_INLINE void ssim_blur_columns(const SsimTaps<P>& taps, const Load& load, P (&sum)[ssim_blurs][Rows]) {
  const P half(typename P::Scalar(0.5));
  unroll<ssim_blurs>([&](auto map) __attribute__((always_inline)) {
    unroll<Rows>([&](auto row) __attribute__((always_inline)) { sum[map()][row()] = P(typename P::Scalar(0)); });
  });
  unroll<Rows + 2 * ssim_radius>([&](auto i) __attribute__((always_inline)) {
    P x, y;
    load(i(), x, y);
    const P d = x - y;
    const P xs = x - half;
    const P xy = xs * (y - half);
    const P dd = d * d;
    unroll<Rows>([&](auto row) __attribute__((always_inline)) {
      constexpr int k = decltype(i)::value - decltype(row)::value - ssim_radius;
      if constexpr (k >= -ssim_radius && k <= ssim_radius) {
        const P w = taps.at(k);
        sum[blur_x][row()] = fma(w, xs, sum[blur_x][row()]);
        sum[blur_d][row()] = fma(w, d, sum[blur_d][row()]);
        sum[blur_xy][row()] = fma(w, xy, sum[blur_xy][row()]);
        sum[blur_dd][row()] = fma(w, dd, sum[blur_dd][row()]);
      }
    });
  });
}

/// Horizontal blur at one pack of columns; `center` points at the pack's first column, 5 readable values lie on either
/// side.
template <class P>
[[nodiscard]] COMPMARK_INLINE P ssim_blur_row(const SsimTaps<P>& taps, const typename P::Scalar* center) {
  P sum = taps.at(0) * P::load(center);
  unroll<ssim_radius>([&](auto k) __attribute__((always_inline)) {
    constexpr int reach = decltype(k)::value + 1;
    sum = fma(taps.at(reach), P::load(center - reach), sum);
    sum = fma(taps.at(reach), P::load(center + reach), sum);
  });
  return sum;
}

/// 1 - S at one pixel, and the three maps whose blurs make the gradient of S.
template <class P>
struct SsimPoint {
  P distance;
  P u, q, p;
};
template <class P>
[[nodiscard]] COMPMARK_INLINE SsimPoint<P> ssim_point(P mean_x, P mean_d, P mean_xy, P mean_dd) {
  using T = typename P::Scalar;
  const P half(T(0.5));
  const P two(T(2));
  const P mean_y = mean_x - mean_d;
  const P e1 = mean_d * mean_d;
  const P e2 = mean_dd - e1;
  const P mu_y = mean_y + half;
  const P a1 = fma(two * (mean_x + half), mu_y, P(static_cast<T>(ssim_c1)));
  const P a2 = fma(two, mean_xy - mean_x * mean_y, P(static_cast<T>(ssim_c2)));
  const P b1 = a1 + e1;
  const P b2 = a2 + e2;
  const P inverse = P(T(1)) / (b1 * b2);
  const P distance = fma(a1, e2, e1 * b2) * inverse;
  const P p = two * a1 * inverse;
  const P q = p * e2 * (inverse * b1);
  const P mean_part = two * a2 * inverse * (inverse * b2) * (mu_y * e1 - mean_d * a1);
  return {distance, fma(mean_d, p, mean_part - mean_x * q), q, p};
}

}  // namespace detail
}  // namespace compmark
