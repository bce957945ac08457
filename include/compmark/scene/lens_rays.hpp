// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which rays a rectangle of the image is made of, for a lens policy: the limits within which a projection's Jacobian is
// taken (docs/spec/numerics.md, PR4), the same for everything that projects through one camera. Cost: 8 inversions,
// ~2,000 flop a camera; nothing for a pinhole.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>

#include "compmark/scene/lens_policy.hpp"

namespace compmark {

namespace detail {

template <class Lens>
inline constexpr bool is_pinhole_policy = std::is_same_v<Lens, PinholeLens>;

/// The ray (x/z, y/z) that lands at (u, v), by damped Newton steps; where no ray does, one at the edge of the region
/// that is one-to-one.
template <class T, class Lens>
[[nodiscard]] std::array<T, 2> ray_through(const Lens& lens, T u, T v) {
  T a = u, b = v;
  for (int i = 0; i < 200 && !lens.inside(a, b); ++i) {
    a *= T(0.95);
    b *= T(0.95);
  }
  const auto residual_of = [&](const LensPlane<T>& m) { return std::hypot(u - m.u, v - m.v); };
  LensPlane<T> m = lens.plane(a, b);
  T residual = residual_of(m);
  for (int i = 0; i < 30 && residual > 4 * std::numeric_limits<T>::epsilon() * (1 + std::hypot(u, v)); ++i) {
    const T determinant = m.u_a * m.v_b - m.u_b * m.u_b;
    const T step_a = (m.v_b * (u - m.u) - m.u_b * (v - m.v)) / determinant;
    const T step_b = (m.u_a * (v - m.v) - m.u_b * (u - m.u)) / determinant;
    bool moved = false;
    T scale = 1;
    for (int halving = 0; halving < 12 && !moved; ++halving, scale /= 2) {
      const T next_a = a + scale * step_a, next_b = b + scale * step_b;
      if (!lens.inside(next_a, next_b)) continue;
      const LensPlane<T> next = lens.plane(next_a, next_b);
      if (!(residual_of(next) < residual)) continue;
      a = next_a;
      b = next_b;
      m = next;
      residual = residual_of(next);
      moved = true;
    }
    if (!moved) break;
  }
  return {a, b};
}

/// Rectangle of rays within which the Jacobian is taken.
template <class T>
struct RayLimits {
  T x_low, x_high, y_low, y_high;
};

/// Where the Jacobian is clamped. Pinhole: the image, widened on each side by 0.15 of its size (docs/spec/numerics.md,
/// PR4: the limits follow the principal point; with the principal point at the centre they are the published 1.3
/// tan(fov/2)). With a lens the same widened image, but the limits are of rays, so it is taken back through the lens:
/// the box around the rays through its corners and around those through its edges at the axes, where a lens that bends
/// evenly has its extremes. A widened image that the lens does not fill ends where the lens does. Zero coefficients
/// give the pinhole's limits to the bit.
template <class T, class Lens>
[[nodiscard]] RayLimits<T> ray_limits(const Lens& lens, RayLimits<T> image) {
  if constexpr (is_pinhole_policy<Lens>) {
    return image;
  } else {
    const auto middle = [](T low, T high) { return std::min(std::max(T(0), low), high); };
    const std::array<T, 3> us{image.x_low, middle(image.x_low, image.x_high), image.x_high},
        vs{image.y_low, middle(image.y_low, image.y_high), image.y_high};
    constexpr T infinite = std::numeric_limits<T>::infinity();
    RayLimits<T> rays{infinite, -infinite, infinite, -infinite};
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        if (i == 1 && j == 1) continue;
        const std::array<T, 2> ray = ray_through(lens, us[i], vs[j]);
        rays = {std::min(rays.x_low, ray[0]), std::max(rays.x_high, ray[0]), std::min(rays.y_low, ray[1]),
                std::max(rays.y_high, ray[1])};
      }
    }
    return rays;
  }
}

}  // namespace detail
}  // namespace compmark
