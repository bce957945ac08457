// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Fisheye lenses (Kannala and Brandt 2006; COLMAP's FISHEYE families): a ray at the angle theta from the axis lands at
// the distance theta instead of tan theta; polynomials then bend that plane. Near the axis atan(r)/r is its series, so
// that nothing is divided by r.
//   (u, v) = (x, y) atan(r) / r,  r = hypot(x, y)
//   back: (x, y) = (u, v) tan(theta) / theta,  theta = hypot(u, v) < pi/2
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "compmark/scene/lens_dual.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/scene/lens_radial.hpp"

namespace compmark {
namespace detail {

/// atan(sqrt(q)) / sqrt(q) for q >= 0. Series of 13 terms below 1/16, where the first one left out is 1e-17.
template <class V>
[[nodiscard]] V angle_ratio(V q) {
  using std::atan;
  using std::sqrt;
  if (value_of(q) < 0.0625) {
    V sum(0);
    for (int n = 12; n >= 0; --n) sum = V((n % 2 == 0 ? 1.0 : -1.0) / (2 * n + 1)) + q * sum;
    return sum;
  }
  const V r = sqrt(q);
  return atan(r) / r;
}

/// The equidistant plane of a ray.
template <class V>
[[nodiscard]] std::array<V, 2> to_fisheye_plane(V x, V y) {
  const V ratio = angle_ratio(x * x + y * y);
  return {x * ratio, y * ratio};
}

/// tan(sqrt(q)) / sqrt(q) for 0 <= q < (pi/2)^2.
[[nodiscard]] inline double tangent_ratio(double q) {
  const double theta = std::sqrt(q);
  return theta < 1e-4 ? 1 + q / 3 : std::tan(theta) / theta;
}

/// The polynomials on the equidistant plane, for every model of the family.
template <class V>
[[nodiscard]] std::array<V, 2> bend_fisheye(const Lens& lens, V u, V v) {
  const auto k = [&](std::size_t i) { return V(static_cast<double>(lens.parameters[i])); };
  const V one(1);
  const V t2 = u * u + v * v;
  switch (lens.model) {
    case LensModel::simple_radial_fisheye: {
      const V factor = one + t2 * k(0);
      return {u * factor, v * factor};
    }
    case LensModel::radial_fisheye: {
      const V factor = one + t2 * (k(0) + t2 * k(1));
      return {u * factor, v * factor};
    }
    case LensModel::opencv_fisheye: {
      const V factor = one + t2 * (k(0) + t2 * (k(1) + t2 * (k(2) + t2 * k(3))));
      return {u * factor, v * factor};
    }
    case LensModel::thin_prism_fisheye: {
      const V factor = one + t2 * (k(0) + t2 * (k(1) + t2 * (k(4) + t2 * k(5))));
      const std::array<V, 2> shift = tangential(k(2), k(3), u, v);
      return {u * factor + shift[0] + k(6) * t2, v * factor + shift[1] + k(7) * t2};
    }
    case LensModel::rad_tan_thin_prism_fisheye: {
      V factor = k(5);
      for (std::size_t i = 5; i-- > 0;) factor = k(i) + t2 * factor;
      factor = one + t2 * factor;
      const V a = u * factor, b = v * factor;  // the shifts act on the point already scaled
      const V r2 = a * a + b * b;
      const std::array<V, 2> shift = tangential(k(7), k(6), a, b);  // p0 goes with x
      return {a + shift[0] + r2 * (k(8) + r2 * k(9)), b + shift[1] + r2 * (k(10) + r2 * k(11))};
    }
    default:
      return {u, v};
  }
}

}  // namespace detail
}  // namespace compmark
