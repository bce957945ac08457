// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Lenses whose inverse is a formula: the field-of-view model (Devernay and Faugeras 2001), the division model
// (Fitzgibbon 2001) and the enhanced unified camera model (Khomutenko et al. 2016). Each scales (x, y) by a factor of
// r2 = x^2 + y^2.
//   FOV       c atan(c r) / (c r omega), c = 2 tan(omega/2)
//   DIVISION  2 / (1 + sqrt(1 - 4 k r2)), back 1 / (1 + k r'^2)
//   EUCM      1 / (alpha sqrt(beta r2 + 1) + 1 - alpha)
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "compmark/scene/lens_dual.hpp"
#include "compmark/scene/lens_fisheye.hpp"
#include "compmark/scene/lens_model.hpp"

namespace compmark {
namespace detail {

[[nodiscard]] constexpr bool has_closed_inverse(LensModel model) {
  return model == LensModel::fov || model == LensModel::simple_division || model == LensModel::division ||
         model == LensModel::eucm;
}

template <class V>
[[nodiscard]] std::array<V, 2> distort_closed(const Lens& lens, V x, V y) {
  using std::sqrt;
  const V one(1);
  const V q = x * x + y * y;
  V factor = one;
  if (lens.model == LensModel::fov) {
    const double omega = lens.parameters[0];
    const double c = 2 * std::tan(omega / 2);
    if (omega != 0) factor = V(c / omega) * angle_ratio(V(c * c) * q);
  } else if (lens.model == LensModel::eucm) {
    const V alpha(lens.parameters[0]);
    factor = one / (alpha * sqrt(one + V(lens.parameters[1]) * q) + (one - alpha));
  } else {
    factor = V(2) / (one + sqrt(one - V(4 * lens.parameters[0]) * q));
  }
  return {x * factor, y * factor};
}

/// The ray of a distorted point, where there is one in front of the camera.
[[nodiscard]] inline std::optional<std::array<double, 2>> undistort_closed(const Lens& lens, double x, double y) {
  const double q = x * x + y * y;
  double factor = 1;
  if (lens.model == LensModel::fov) {
    const double omega = lens.parameters[0];
    if (omega == 0) return std::array<double, 2>{x, y};
    const double angle = std::sqrt(q) * omega;
    if (!(std::abs(angle) < std::numbers::pi / 2)) return std::nullopt;
    factor = omega / (2 * std::tan(omega / 2)) * tangent_ratio(angle * angle);
  } else if (lens.model == LensModel::eucm) {
    const double alpha = lens.parameters[0], beta = lens.parameters[1];
    const double root = 1 - (2 * alpha - 1) * beta * q;
    if (!(root >= 0)) return std::nullopt;
    factor = (alpha * std::sqrt(root) + 1 - alpha) / (1 - alpha * alpha * beta * q);
    if (!(factor > 0)) return std::nullopt;  // the ray points backwards
  } else {
    const double k = lens.parameters[0];
    factor = 1 / (1 + k * q);
    // The other branch of the square root begins where k r'^2 = 1: no ray of the model lands beyond.
    if (!(factor > 0) || !(k * q <= 1)) return std::nullopt;
  }
  if (!std::isfinite(factor)) return std::nullopt;
  return std::array<double, 2>{x * factor, y * factor};
}

/// The largest radius of a ray the formula is good for.
[[nodiscard]] inline double closed_limit(const Lens& lens) {
  const double first = lens.parameters[0];
  const double infinity = std::numeric_limits<double>::infinity();
  if (lens.model == LensModel::simple_division || lens.model == LensModel::division)
    return first > 0 ? 1 / (2 * std::sqrt(first)) : infinity;
  return infinity;
}

}  // namespace detail
}  // namespace compmark
