// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Lenses as policies of a projection: types that map a point of the camera frame to normalised distorted coordinates,
// with the Jacobian that carries a covariance to the image and the second derivatives that its gradient needs. On the
// plane a = x/z, b = y/z all of them are
//   u = a s(q) + 2 p1 a b + p2 (q + 2 a^2),   v = b s(q) + 2 p2 a b + p1 (q + 2 b^2),   q = a^2 + b^2,   z > 0
// and differ in s alone. PinholeLens is empty and costs nothing. Methods are templates on the value: a scalar or a
// Pack. Cost above a pinhole: ~30 flop forward, ~60 backward; a fisheye adds one arctangent.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <type_traits>

#include "compmark/scene/lens.hpp"

namespace compmark {

/// A map of the plane at one point: value, Jacobian and second derivatives. The Jacobian is symmetric for every lens
/// here.
template <class V>
struct LensPlane {
  V u, v;
  V u_a, u_b, v_b;           ///< v_a = u_b
  V u_aa, u_ab, u_bb, v_bb;  ///< v_aa = u_ab, v_ab = u_bb
};

namespace detail {

/// s(q) and its first two derivatives by q.
template <class V>
struct RadialFactor {
  V s, s1, s2;
};

template <class V>
[[nodiscard]] LensPlane<V> lens_plane(V a, V b, const RadialFactor<V>& f, V p1, V p2) {
  using Constant = V;
  const Constant two(2), four(4), six(6);
  LensPlane<V> m;
  const V ab = a * b;
  m.u = a * f.s + two * p1 * ab + p2 * (two * a * a + (a * a + b * b));
  m.v = b * f.s + two * p2 * ab + p1 * (two * b * b + (a * a + b * b));
  m.u_a = f.s + two * a * a * f.s1 + two * p1 * b + six * p2 * a;
  m.u_b = two * ab * f.s1 + two * p1 * a + two * p2 * b;
  m.v_b = f.s + two * b * b * f.s1 + two * p2 * a + six * p1 * b;
  m.u_aa = six * a * f.s1 + four * a * a * a * f.s2 + six * p2;
  m.u_ab = two * b * f.s1 + four * a * ab * f.s2 + two * p1;
  m.u_bb = two * a * f.s1 + four * b * ab * f.s2 + two * p2;
  m.v_bb = six * b * f.s1 + four * b * b * b * f.s2 + six * p1;
  return m;
}

/// f(x) for a scalar or for every lane of a pack.
template <class V, class F>
[[nodiscard]] V each_lane(const V& x, const F& f) {
  if constexpr (std::is_floating_point_v<V>) {
    return f(x);
  } else {
    V result = x;
    for (int i = 0; i < V::width; ++i) result.set(i, f(x.lane(i)));
    return result;
  }
}

/// Everything after the plane, the same for every lens.
template <class Derived>
struct LensProjection {
  /// Normalised distorted coordinates of the camera point (x, y, z), z > 0.
  template <class V>
  [[nodiscard]] std::array<V, 2> project(V x, V y, V z) const {
    const LensPlane<V> m = self().plane(x / z, y / z);
    return {m.u, m.v};
  }
  /// Row-major 2 x 3 derivatives of project by (x, y, z).
  template <class V>
  [[nodiscard]] std::array<V, 6> jacobian(V x, V y, V z) const {
    const V w = V(1) / z;
    const V a = x * w, b = y * w;
    const LensPlane<V> m = self().plane(a, b);
    return {m.u_a * w, m.u_b * w, (m.u_a * a + m.u_b * b) * (V(0) - w),
            m.u_b * w, m.v_b * w, (m.u_b * a + m.v_b * b) * (V(0) - w)};
  }
  /// Adjoint of (x, y, z), given those of project and of jacobian.
  template <class V>
  [[nodiscard]] std::array<V, 3> backward(V x, V y, V z, const std::array<V, 2>& d_point,
                                          const std::array<V, 6>& d_jacobian) const {
    const V w = V(1) / z;
    const V a = x * w, b = y * w;
    const LensPlane<V> m = self().plane(a, b);
    const std::array<V, 6>& g = d_jacobian;
    // The Jacobian is w K P with P = [1 0 -a; 0 1 -b]; M is the adjoint of K / w, by P^T.
    const V m00 = g[0] - g[2] * a, m01 = g[1] - g[2] * b, m10 = g[3] - g[5] * a, m11 = g[4] - g[5] * b;
    const V mixed = m01 + m10;
    const V d_a = w * (m00 * m.u_aa + mixed * m.u_ab + m11 * m.u_bb - g[2] * m.u_a - g[5] * m.u_b) +
                  d_point[0] * m.u_a + d_point[1] * m.u_b;
    const V d_b = w * (m00 * m.u_ab + mixed * m.u_bb + m11 * m.v_bb - g[2] * m.u_b - g[5] * m.v_b) +
                  d_point[0] * m.u_b + d_point[1] * m.v_b;
    const V d_w = m00 * m.u_a + mixed * m.u_b + m11 * m.v_b;
    return {d_a * w, d_b * w, (V(0) - w) * (d_a * a + d_b * b + d_w * w)};
  }

 private:
  [[nodiscard]] const Derived& self() const { return static_cast<const Derived&>(*this); }
};

}  // namespace detail

/// No lens: nothing stored, nothing computed beyond x/z and y/z.
struct PinholeLens : detail::LensProjection<PinholeLens> {
  template <class V>
  [[nodiscard]] LensPlane<V> plane(V a, V b) const {
    const V zero(0), one(1);
    return {a, b, one, zero, one, zero, zero, zero, zero};
  }
  /// True where the lens is one-to-one: rays elsewhere must not be drawn.
  template <class V>
  [[nodiscard]] std::true_type inside(V, V) const {
    return {};
  }
};

/// COLMAP's RADIAL and OPENCV families, with the third coefficient of FULL_OPENCV.
template <class T>
struct RadialTangentialLens : detail::LensProjection<RadialTangentialLens<T>> {
  T k1{}, k2{}, k3{}, p1{}, p2{};
  T limit2 = std::numeric_limits<T>::max();  ///< square of the largest radius of a ray

  template <class V>
  [[nodiscard]] LensPlane<V> plane(V a, V b) const {
    const V q = a * a + b * b;
    const detail::RadialFactor<V> f{V(T(1)) + q * (V(k1) + q * (V(k2) + q * V(k3))),
                                    V(k1) + q * (V(T(2) * k2) + q * V(T(3) * k3)), V(T(2) * k2) + q * V(T(6) * k3)};
    return detail::lens_plane(a, b, f, V(p1), V(p2));
  }
  template <class V>
  [[nodiscard]] auto inside(V a, V b) const {
    return a * a + b * b <= V(limit2);
  }
};

/// COLMAP's equidistant fisheye with a polynomial in theta^2 (Kannala and Brandt). With A(q) = atan(r)/r and w = q A^2
/// = theta^2, s = A (1 + k1 w + k2 w^2 + k3 w^3 + k4 w^4): only A needs a series near the axis, everything else is
/// products.
template <class T>
struct FisheyeLens : detail::LensProjection<FisheyeLens<T>> {
  T k1{}, k2{}, k3{}, k4{};
  T limit2 = std::numeric_limits<T>::max();  ///< square of the largest radius of a ray, tan(theta)^2

  template <class V>
  [[nodiscard]] LensPlane<V> plane(V a, V b) const {
    const V q = a * a + b * b, one(T(1)), two(T(2));
    const V A = detail::each_lane(q, [](T x) { return ratio(x, 0); });
    const V A1 = detail::each_lane(q, [](T x) { return ratio(x, 1); });
    const V A2 = detail::each_lane(q, [](T x) { return ratio(x, 2); });
    const V w = q * A * A;
    const V w1 = A * A + two * q * A * A1;
    const V w2 = V(T(4)) * A * A1 + two * q * (A1 * A1 + A * A2);
    const V p = one + w * (V(k1) + w * (V(k2) + w * (V(k3) + w * V(k4))));
    const V dp = V(k1) + w * (V(T(2) * k2) + w * (V(T(3) * k3) + w * V(T(4) * k4)));
    const V ddp = V(T(2) * k2) + w * (V(T(6) * k3) + w * V(T(12) * k4));
    const detail::RadialFactor<V> f{A * p, A1 * p + A * dp * w1,
                                    A2 * p + two * A1 * dp * w1 + A * (ddp * w1 * w1 + dp * w2)};
    return detail::lens_plane(a, b, f, V(T(0)), V(T(0)));
  }
  template <class V>
  [[nodiscard]] auto inside(V a, V b) const {
    return a * a + b * b <= V(limit2);
  }

 private:
  /// A(q) = atan(sqrt q) / sqrt q and its derivatives. The series holds to rounding below its bound, which balances the
  /// digits that the differences lose above it: eps / q^2 of the second derivative.
  [[nodiscard]] static T ratio(T q, int derivative) {
    constexpr T bound = sizeof(T) < sizeof(double) ? T(0.25) : T(0.0625);
    if (q < bound) {
      T sum = T(0);
      for (int n = 18; n >= derivative; --n) {
        const T falling = derivative == 0 ? T(1) : derivative == 1 ? T(n) : T(n) * T(n - 1);
        sum = T(n % 2 == 0 ? 1 : -1) * falling / T(2 * n + 1) + q * sum;
      }
      return sum;
    }
    const T r = std::sqrt(q);
    const T zeroth = std::atan(r) / r;
    if (derivative == 0) return zeroth;
    const T inverse = T(1) / (T(1) + q);
    const T first = (inverse - zeroth) / (T(2) * q);
    if (derivative == 1) return first;
    return (T(0) - inverse * inverse - T(3) * first) / (T(2) * q);
  }
};

/// The policy of a lens, where it is of that family.
template <class T>
[[nodiscard]] std::optional<RadialTangentialLens<T>> radial_tangential_lens(const Lens& lens) {
  const auto& p = lens.parameters;
  RadialTangentialLens<T> policy;
  const bool full = lens.model == LensModel::full_opencv;
  if (full && (p[5] != 0 || p[6] != 0 || p[7] != 0)) return std::nullopt;  // a rational factor: undistort the images
  switch (lens.model) {
    case LensModel::simple_pinhole:
    case LensModel::pinhole:
      return policy;
    case LensModel::full_opencv:
    case LensModel::opencv:
      policy.p1 = static_cast<T>(p[2]), policy.p2 = static_cast<T>(p[3]);
      [[fallthrough]];
    case LensModel::radial:
      policy.k2 = static_cast<T>(p[1]);
      [[fallthrough]];
    case LensModel::simple_radial:
      policy.k1 = static_cast<T>(p[0]);
      break;
    default:
      return std::nullopt;
  }
  if (full) policy.k3 = static_cast<T>(p[4]);
  const double limit = lens_limit(lens).ray;
  if (limit < 1e9) policy.limit2 = static_cast<T>(limit * limit);
  return policy;
}

template <class T>
[[nodiscard]] std::optional<FisheyeLens<T>> fisheye_lens(const Lens& lens) {
  const auto& p = lens.parameters;
  FisheyeLens<T> policy;
  switch (lens.model) {
    case LensModel::opencv_fisheye:
      policy.k3 = static_cast<T>(p[2]), policy.k4 = static_cast<T>(p[3]);
      [[fallthrough]];
    case LensModel::radial_fisheye:
      policy.k2 = static_cast<T>(p[1]);
      [[fallthrough]];
    case LensModel::simple_radial_fisheye:
      policy.k1 = static_cast<T>(p[0]);
      break;
    case LensModel::simple_fisheye:
    case LensModel::fisheye:
      break;
    default:
      return std::nullopt;
  }
  const double limit = lens_limit(lens).ray;
  if (limit < 1e9) policy.limit2 = static_cast<T>(limit * limit);
  return policy;
}

}  // namespace compmark
