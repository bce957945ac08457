// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A lens on normalised coordinates: forward, with its Jacobian, and back. Back is a formula where there is one, else
// Newton's iteration on the plane that the polynomials bend, started at the distorted point, damped, and never left to
// settle beyond the radius up to which the lens is one-to-one (docs/spec/numerics.md, CA4). Cost: forward ~10 to 60
// flop; back 3 to 6 iterations of three times that.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_closed.hpp"
#include "compmark/scene/lens_dual.hpp"
#include "compmark/scene/lens_fisheye.hpp"
#include "compmark/scene/lens_model.hpp"
#include "compmark/scene/lens_radial.hpp"

namespace compmark {

namespace detail {

/// The polynomial part of a lens: on the plane of the pinhole, or on the equidistant plane of a fisheye.
template <class V>
[[nodiscard]] std::array<V, 2> bend(const Lens& lens, V x, V y) {
  if (is_fisheye(lens.model)) return bend_fisheye(lens, x, y);
  if (lens.model == LensModel::simple_pinhole || lens.model == LensModel::pinhole) return {x, y};
  return distort_radial(lens, x, y);
}

}  // namespace detail

/// Where the ray (x/z, y/z) = (x, y) lands, in units of the focal length.
template <class V>
[[nodiscard]] std::array<V, 2> distort(const Lens& lens, V x, V y) {
  if (detail::has_closed_inverse(lens.model)) return detail::distort_closed(lens, x, y);
  if (!is_fisheye(lens.model)) return detail::bend(lens, x, y);
  const std::array<V, 2> plane = detail::to_fisheye_plane(x, y);
  return detail::bend_fisheye(lens, plane[0], plane[1]);
}

/// Row-major derivatives of distort by (x, y).
template <class T>
[[nodiscard]] std::array<T, 4> distort_jacobian(const Lens& lens, T x, T y) {
  using D = detail::Dual<T>;
  const std::array<D, 2> d = distort(lens, D(x, T(1), T(0)), D(y, T(0), T(1)));
  return {d[0].dx, d[0].dy, d[1].dx, d[1].dy};
}

/// Up to which radius a lens is one-to-one, in every direction: the first one where the determinant of the Jacobian is
/// not positive.
struct LensLimit {
  double ray = std::numeric_limits<double>::infinity();  ///< of rays, hypot(x/z, y/z)
  double plane =
      std::numeric_limits<double>::infinity();  ///< on the plane the polynomials bend; an angle for a fisheye
};

/// Cost: ~20,000 evaluations, half a millisecond; once for each camera. Looked for up to 89.9 degrees.
[[nodiscard]] inline LensLimit lens_limit(const Lens& lens) {
  LensLimit limit;
  if (is_pinhole(lens)) return limit;
  if (detail::has_closed_inverse(lens.model)) {
    limit.ray = limit.plane = detail::closed_limit(lens);
    return limit;
  }
  const bool fisheye = is_fisheye(lens.model);
  constexpr double widest = 89.9 * std::numbers::pi / 180;
  constexpr int directions = 16;
  const auto good = [&](double angle) {
    const double radius = fisheye ? angle : std::tan(angle);
    for (int i = 0; i < directions; ++i) {
      const double phi = 2 * std::numbers::pi * i / directions;
      using D = detail::Dual<double>;
      const std::array<D, 2> d = detail::bend(lens, D(radius * std::cos(phi), 1, 0), D(radius * std::sin(phi), 0, 1));
      // The sum of the diagonal is positive too as long as no direction has turned around: both eigenvalues change sign
      // together else.
      if (!(d[0].dx * d[1].dy - d[0].dy * d[1].dx > 0) || !(d[0].dx + d[1].dy > 0)) return false;
    }
    return true;
  };
  constexpr int steps = 1024;
  double reached = 0, broken = -1;
  for (int i = 1; i <= steps && broken < 0; ++i) {
    const double angle = widest * i / steps;
    (good(angle) ? reached : broken) = angle;
  }
  if (broken < 0) {
    if (fisheye) limit = {std::tan(widest), widest};
    return limit;
  }
  for (int i = 0; i < 40; ++i) {
    const double middle = (reached + broken) / 2;
    (good(middle) ? reached : broken) = middle;
  }
  limit.ray = std::tan(reached);
  limit.plane = fisheye ? reached : limit.ray;
  return limit;
}

/// A ray found from a distorted point. Where `converged` is false no ray within the limit lands there, and (x, y) is
/// the nearest try.
struct Undistorted {
  double x = 0, y = 0;
  bool converged = false;
  int iterations = 0;
};

/// The inverse of distort to 1e-12 of residual, which is 1e-9 of the ray wherever the lens compresses by less than a
/// thousand.
[[nodiscard]] inline Undistorted undistort(const Lens& lens, const LensLimit& limit, double x, double y) {
  if (is_pinhole(lens)) return {x, y, true, 0};
  if (detail::has_closed_inverse(lens.model)) {
    const std::optional<std::array<double, 2>> ray = detail::undistort_closed(lens, x, y);
    return ray ? Undistorted{(*ray)[0], (*ray)[1], true, 0} : Undistorted{x, y, false, 0};
  }
  using D = detail::Dual<double>;
  const auto residual_at = [&](double px, double py, std::array<D, 2>& d) {
    d = detail::bend(lens, D(px, 1, 0), D(py, 0, 1));
    return std::hypot(d[0].value - x, d[1].value - y);
  };
  Undistorted result{x, y, false, 0};
  const double start = std::hypot(x, y);
  if (start > limit.plane) {  // begin where the lens is one-to-one
    result.x *= 0.99 * limit.plane / start;
    result.y *= 0.99 * limit.plane / start;
  }
  std::array<D, 2> d;
  double residual = residual_at(result.x, result.y, d);
  // One step past the residual of 1e-12 brings the point to rounding.
  bool last = false;
  for (; result.iterations < 50 && !last; ++result.iterations) {
    last = residual <= 1e-12 * (1 + start);
    const double determinant = d[0].dx * d[1].dy - d[0].dy * d[1].dx;
    if (!std::isfinite(determinant) || determinant == 0) break;
    const double ex = x - d[0].value, ey = y - d[1].value;
    const double step_x = (d[1].dy * ex - d[0].dy * ey) / determinant;
    const double step_y = (d[0].dx * ey - d[1].dx * ex) / determinant;
    double scale = 1;
    bool moved = false;
    for (int halving = 0; halving < 30 && !moved; ++halving, scale /= 2) {
      const double px = result.x + scale * step_x, py = result.y + scale * step_y;
      if (!(std::hypot(px, py) <= limit.plane)) continue;
      std::array<D, 2> next;
      const double now = residual_at(px, py, next);
      if (!(now < residual) && !(last && now <= 2 * residual)) continue;
      result.x = px;
      result.y = py;
      residual = now;
      d = next;
      moved = true;
    }
    if (!moved) break;
  }
  result.converged = residual <= 1e-12 * (1 + start) && std::hypot(result.x, result.y) <= limit.plane;
  if (is_fisheye(lens.model)) {
    const double ratio = detail::tangent_ratio(result.x * result.x + result.y * result.y);
    result.x *= ratio;
    result.y *= ratio;
  }
  return result;
}
[[nodiscard]] inline Undistorted undistort(const Lens& lens, double x, double y) {
  return undistort(lens, lens_limit(lens), x, y);
}

/// By how many pixels the lens moves points of the camera's image at most: the evidence for treating it at all. A grid
/// of 33 x 33 points, corners included; points beyond the limit count as moved by the image's diagonal.
[[nodiscard]] inline double lens_displacement(const Camera<double>& camera, const Lens& lens) {
  if (is_pinhole(lens)) return 0;
  const LensLimit limit = lens_limit(lens);
  double largest = 0;
  for (int i = 0; i <= 32; ++i) {
    for (int j = 0; j <= 32; ++j) {
      const double x = (camera.width * j / 32.0 - camera.cx) / camera.fx;
      const double y = (camera.height * i / 32.0 - camera.cy) / camera.fy;
      if (!(std::hypot(x, y) <= limit.ray)) return std::hypot(camera.width, camera.height);
      const std::array<double, 2> d = distort(lens, x, y);
      largest = std::fmax(largest, std::hypot(camera.fx * (d[0] - x), camera.fy * (d[1] - y)));
    }
  }
  return largest;
}

}  // namespace compmark
