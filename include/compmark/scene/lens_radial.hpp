// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Lenses that bend the plane of a pinhole by polynomials (Brown 1966; COLMAP's RADIAL and OPENCV families): with r2 =
// x^2 + y^2
//   x' = x R(r2) + 2 p1 x y + p2 (r2 + 2 x^2),   y' = y R(r2) + 2 p2 x y + p1 (r2 + 2 y^2)
//   R = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
#pragma once

#include <array>

#include "compmark/scene/lens_model.hpp"

namespace compmark {
namespace detail {

/// The tangential part, shared with the fisheye that has one.
template <class V>
[[nodiscard]] std::array<V, 2> tangential(V p1, V p2, V x, V y) {
  const V r2 = x * x + y * y;
  const V two(2);
  return {two * p1 * x * y + p2 * (r2 + two * x * x), two * p2 * x * y + p1 * (r2 + two * y * y)};
}

/// Models simple_radial, radial, opencv, full_opencv.
template <class V>
[[nodiscard]] std::array<V, 2> distort_radial(const Lens& lens, V x, V y) {
  const auto k = [&](std::size_t i) { return V(static_cast<double>(lens.parameters[i])); };
  const V one(1);
  const V r2 = x * x + y * y;
  const V factor = one + r2 * (k(0) + r2 * (lens.model == LensModel::simple_radial ? V(0) : k(1)));
  if (lens.model == LensModel::simple_radial || lens.model == LensModel::radial) return {x * factor, y * factor};
  const std::array<V, 2> shift = tangential(k(2), k(3), x, y);
  if (lens.model == LensModel::opencv) return {x * factor + shift[0], y * factor + shift[1]};
  const V ratio = (factor + r2 * r2 * r2 * k(4)) / (one + r2 * (k(5) + r2 * (k(6) + r2 * k(7))));
  return {x * ratio + shift[0], y * ratio + shift[1]};
}

}  // namespace detail
}  // namespace compmark
