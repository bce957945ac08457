// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a photograph's lens does beyond a pinhole: one of COLMAP's camera models (docs/spec/formats.md, 3) without its
// focal lengths and principal point, which stay in Camera. A lens maps a ray's normalised coordinates (x/z, y/z) to
// distorted ones; pixel = f d + c.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace compmark {

/// COLMAP's model ids. 17 (EQUIRECTANGULAR) has no pinhole to return to and is refused by the readers.
enum class LensModel : std::uint8_t {
  simple_pinhole = 0,
  pinhole = 1,
  simple_radial = 2,                ///< k
  radial = 3,                       ///< k1 k2
  opencv = 4,                       ///< k1 k2 p1 p2
  opencv_fisheye = 5,               ///< k1 k2 k3 k4
  full_opencv = 6,                  ///< k1 k2 p1 p2 k3 k4 k5 k6
  fov = 7,                          ///< omega, radians
  simple_radial_fisheye = 8,        ///< k
  radial_fisheye = 9,               ///< k1 k2
  thin_prism_fisheye = 10,          ///< k1 k2 p1 p2 k3 k4 sx1 sy1
  rad_tan_thin_prism_fisheye = 11,  ///< k0 … k5 p0 p1 s0 … s3
  simple_division = 12,             ///< k
  division = 13,                    ///< k
  simple_fisheye = 14,
  fisheye = 15,
  eucm = 16  ///< alpha beta
};

inline constexpr std::size_t lens_model_count = 17;

/// Focal lengths and principal point that come before a model's distortion parameters in COLMAP's order: f cx cy, or fx
/// fy cx cy.
[[nodiscard]] constexpr std::size_t lens_intrinsics(LensModel model) {
  switch (model) {
    case LensModel::simple_pinhole:
    case LensModel::simple_radial:
    case LensModel::radial:
    case LensModel::simple_radial_fisheye:
    case LensModel::radial_fisheye:
    case LensModel::simple_division:
    case LensModel::simple_fisheye:
      return 3;
    default:
      return 4;
  }
}

/// A pinhole unless told otherwise. Parameters that a model does not have are zero.
struct Lens {
  LensModel model = LensModel::pinhole;
  std::array<double, 16> parameters{};

  friend bool operator==(const Lens&, const Lens&) = default;
};

/// True for the models whose rays are first mapped to the equidistant plane: d ~ theta instead of tan theta.
[[nodiscard]] constexpr bool is_fisheye(LensModel model) {
  switch (model) {
    case LensModel::opencv_fisheye:
    case LensModel::simple_radial_fisheye:
    case LensModel::radial_fisheye:
    case LensModel::thin_prism_fisheye:
    case LensModel::rad_tan_thin_prism_fisheye:
    case LensModel::simple_fisheye:
    case LensModel::fisheye:
      return true;
    default:
      return false;
  }
}

/// True if the lens moves nothing: a pinhole model, or one whose coefficients are zero. Without alpha EUCM is a pinhole
/// whatever beta.
[[nodiscard]] inline bool is_pinhole(const Lens& lens) {
  if (is_fisheye(lens.model)) return false;
  if (lens.model == LensModel::simple_pinhole || lens.model == LensModel::pinhole) return true;
  const std::size_t count = lens.model == LensModel::eucm ? 1 : lens.parameters.size();
  return std::all_of(lens.parameters.begin(), lens.parameters.begin() + static_cast<std::ptrdiff_t>(count),
                     [](double v) { return v == 0; });
}

}  // namespace compmark
