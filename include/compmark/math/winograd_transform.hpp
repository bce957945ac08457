// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The three small matrices of Winograd's convolution F(m, 3) = Toom and Cook's multiplication of polynomials,
// transposed: m outputs of a filter of three weights from n = m + 2 inputs by n multiplications, y = A^T [(G g) . (B^T
// d)] (Lavin and Gray 2016, section 4). The points of interpolation are 0, +-p_1, ..., +-p_(m/2) and infinity; with
// M(x) the product of x - q over the finite points q,
//   B^T: row of point p is M(x) / (x - p), of infinity M(x);
//   A^T: column of point p is 1, p, p^2, ...;   G: row of p is (1, p, p^2) / M'(p).
// Rows of p and -p share their even and odd parts. Cost of B^T on one row: 2 + 4 (m/2)^2 - 2 (m/2) operations at most
// (m = 4: 12).
#pragma once

#include <array>
#include <cstddef>

#include "compmark/core/config.hpp"
#include "compmark/math/pack.hpp"
#include "compmark/math/unroll.hpp"

namespace compmark {

/// The positive interpolation points of F(Tile x Tile, 3 x 3).
template <int Tile>
struct WinogradPoints;
template <>
struct WinogradPoints<2> {
  static constexpr std::array<double, 1> value{1};
};
template <>
struct WinogradPoints<4> {
  /// Exact in binary and near 1 on both sides: half the error of the usual 1, 2 at the same cost (measured,
  /// tests/math/winograd.test.cpp).
  static constexpr std::array<double, 2> value{0.75, 1.5};
};
template <>
struct WinogradPoints<6> {
  static constexpr std::array<double, 3> value{1, 2, 0.5};
};

namespace detail {

/// The three matrices, applied to one row or column.
template <int Tile, class Points>
struct WinogradTransform {
  static constexpr int n = Tile + 2;
  static constexpr int pairs = Tile / 2;
  static_assert(Points::value.size() == pairs, "one positive point for every two outputs");

  static constexpr double point(int q) { return Points::value[static_cast<std::size_t>(q)]; }
  static constexpr double power(double x, int exponent) {
    double result = 1;
    for (int i = 0; i < exponent; ++i) result *= x;
    return result;
  }
  /// Coefficient of z^k in the product of (z - p_r^2) over all r but `left_out` (-1: none).
  static constexpr double coefficient(int left_out, int k) {
    std::array<double, static_cast<std::size_t>(pairs) + 1> c{1};
    for (int r = 0; r < pairs; ++r) {
      if (r == left_out) continue;
      for (std::size_t i = c.size() - 1; i > 0; --i) c[i] = c[i - 1] - point(r) * point(r) * c[i];
      c[0] *= -point(r) * point(r);
    }
    return c[static_cast<std::size_t>(k)];
  }

  /// B^T: x -> y. Row of point p: the product of (x - q) over the other points q, as coefficients.
  template <class P>
  static COMPMARK_INLINE void input(const P (&x)[n], P (&y)[n]) {
    using T = typename P::Scalar;
    y[0] = x[2 * pairs];
    y[n - 1] = x[2 * pairs + 1];
    unroll<pairs>([&](auto k) __attribute__((always_inline)) {
      constexpr T c = static_cast<T>(coefficient(-1, k));
      y[0] = fma(P(c), x[2 * k], y[0]);
      y[n - 1] = fma(P(c), x[2 * k + 1], y[n - 1]);
    });
    unroll<pairs>([&](auto q) __attribute__((always_inline)) {
      P even = x[2 * pairs];
      P odd = x[2 * pairs - 1];
      unroll<pairs - 1>([&](auto k) __attribute__((always_inline)) {
        constexpr T c = static_cast<T>(coefficient(decltype(q)::value, k));
        even = fma(P(c), x[2 * k + 2], even);
        odd = fma(P(c), x[2 * k + 1], odd);
      });
      constexpr T p = static_cast<T>(point(q));
      y[1 + 2 * q] = fma(P(p), odd, even);
      y[2 + 2 * q] = fma(P(-p), odd, even);
    });
  }

  /// A^T: output i is the sum over the points of p^i m.
  template <class P>
  static COMPMARK_INLINE void output(const P (&m)[n], P (&y)[Tile]) {
    using T = typename P::Scalar;
    P part[2][pairs];
    unroll<pairs>([&](auto q) __attribute__((always_inline)) {
      part[0][q] = m[1 + 2 * q] + m[2 + 2 * q];
      part[1][q] = m[1 + 2 * q] - m[2 + 2 * q];
    });
    unroll<Tile>([&](auto i) __attribute__((always_inline)) {
      P sum = part[i % 2][0] * P(static_cast<T>(power(point(0), i)));
      unroll<pairs - 1>([&](auto q) __attribute__((always_inline)) {
        sum = fma(P(static_cast<T>(power(point(q + 1), i))), part[i % 2][q + 1], sum);
      });
      if constexpr (i == 0) sum += m[0];
      if constexpr (i == Tile - 1) sum += m[n - 1];
      y[i] = sum;
    });
  }

  /// G: three weights -> n, in double.
  static void filter(const double (&g)[3], double (&u)[n]) {
    u[0] = g[0] / coefficient(-1, 0);
    u[n - 1] = g[2];
    for (int q = 0; q < pairs; ++q) {
      const double p = point(q);
      double derivative = 2 * p * p;
      for (int r = 0; r < pairs; ++r) derivative *= r == q ? 1 : p * p - point(r) * point(r);
      u[1 + 2 * q] = (g[0] + p * p * g[2] + p * g[1]) / derivative;
      u[2 + 2 * q] = (g[0] + p * p * g[2] - p * g[1]) / derivative;
    }
  }
};

}  // namespace detail

}  // namespace compmark
