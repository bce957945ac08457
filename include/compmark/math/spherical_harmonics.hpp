// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Real spherical harmonics of degree 0 to 3 in the order and with the signs of the 3DGS file format
// (docs/spec/formats.md, 1; docs/spec/numerics.md, SH2): index l^2 + l + m, m = -l … l, Condon-Shortley phase. They are
// orthonormal over the unit sphere. Cost: ~40 flops for all 16.
#pragma once

#include <array>
#include <cstddef>

#include "compmark/core/config.hpp"

namespace compmark {

inline constexpr int max_sh_degree = 3;

/// Number of basis functions up to and including a degree: 1, 4, 9, 16.
[[nodiscard]] constexpr std::size_t sh_count(int degree) {
  return static_cast<std::size_t>((degree + 1) * (degree + 1));
}

/// Degree (band) of basis function i.
[[nodiscard]] constexpr int sh_band(std::size_t i) { return i < 1 ? 0 : (i < 4 ? 1 : (i < 9 ? 2 : 3)); }

/// Y_00 = 1 / sqrt(4 pi), the factor between a constant colour and its coefficient.
inline constexpr double sh_constant = 0.28209479177387814;

/// All 16 basis functions at a unit direction (in the format: from the camera centre to the Gaussian, normalised).
template <class T>
[[nodiscard]] COMPMARK_INLINE std::array<T, 16> sh_basis(const std::array<T, 3>& direction) {
  const T x = direction[0], y = direction[1], z = direction[2];
  const T xx = x * x, yy = y * y, zz = z * z;
  const T xy = x * y, yz = y * z, xz = x * z;
  return {T(sh_constant),
          T(-0.4886025119029199) * y,
          T(0.4886025119029199) * z,
          T(-0.4886025119029199) * x,
          T(1.0925484305920792) * xy,
          T(-1.0925484305920792) * yz,
          T(0.31539156525252005) * (T(2) * zz - xx - yy),
          T(-1.0925484305920792) * xz,
          T(0.5462742152960396) * (xx - yy),
          T(-0.5900435899266435) * y * (T(3) * xx - yy),
          T(2.890611442640554) * xy * z,
          T(-0.4570457994644658) * y * (T(4) * zz - xx - yy),
          T(0.3731763325901154) * z * (T(2) * zz - T(3) * xx - T(3) * yy),
          T(-0.4570457994644658) * x * (T(4) * zz - xx - yy),
          T(1.445305721320277) * z * (xx - yy),
          T(-0.5900435899266435) * x * (xx - T(3) * yy)};
}

/// sum_i weight_i dY_i/d(x, y, z) of the first `count` basis functions as polynomials in x, y, z. Of a function of the
/// direction alone only the part across the direction has a meaning: project it there.
template <class T>
[[nodiscard]] COMPMARK_INLINE std::array<T, 3> sh_gradient(const std::array<T, 3>& direction, const T* weight,
                                                           std::size_t count) {
  const T x = direction[0], y = direction[1], z = direction[2];
  std::array<T, 3> d{};
  const auto add = [&](std::size_t i, T dx, T dy, T dz) {
    d[0] += weight[i] * dx;
    d[1] += weight[i] * dy;
    d[2] += weight[i] * dz;
  };
  if (count > 1) {
    add(1, T(0), T(-0.4886025119029199), T(0));
    add(2, T(0), T(0), T(0.4886025119029199));
    add(3, T(-0.4886025119029199), T(0), T(0));
  }
  if (count > 4) {
    const T c1 = T(1.0925484305920792), c2 = T(0.31539156525252005), c3 = T(0.5462742152960396);
    add(4, c1 * y, c1 * x, T(0));
    add(5, T(0), -c1 * z, -c1 * y);
    add(6, T(-2) * c2 * x, T(-2) * c2 * y, T(4) * c2 * z);
    add(7, -c1 * z, T(0), -c1 * x);
    add(8, T(2) * c3 * x, T(-2) * c3 * y, T(0));
  }
  if (count > 9) {
    const T xx = x * x, yy = y * y, zz = z * z, xy = x * y, yz = y * z, xz = x * z;
    const T c1 = T(0.5900435899266435), c2 = T(2.890611442640554), c3 = T(0.4570457994644658),
            c4 = T(0.3731763325901154), c5 = T(1.445305721320277);
    add(9, T(-6) * c1 * xy, T(-3) * c1 * (xx - yy), T(0));
    add(10, c2 * yz, c2 * xz, c2 * xy);
    add(11, T(2) * c3 * xy, -c3 * (T(4) * zz - xx - T(3) * yy), T(-8) * c3 * yz);
    add(12, T(-6) * c4 * xz, T(-6) * c4 * yz, c4 * (T(6) * zz - T(3) * xx - T(3) * yy));
    add(13, -c3 * (T(4) * zz - T(3) * xx - yy), T(2) * c3 * xy, T(-8) * c3 * xz);
    add(14, T(2) * c5 * xz, T(-2) * c5 * yz, c5 * (xx - yy));
    add(15, T(-3) * c1 * (xx - yy), T(6) * c1 * xy, T(0));
  }
  return d;
}

}  // namespace compmark
