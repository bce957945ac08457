// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A camera with its lens: the input of a pipeline that projects through lenses, for each view. Coefficients are on
// normalised coordinates, so that a resized or cropped camera keeps them. Cost: the size of the policy, 24 to 48 bytes.
#pragma once

#include <optional>
#include <type_traits>
#include <utility>

#include "compmark/scene/camera.hpp"
#include "compmark/scene/lens_policy.hpp"

namespace compmark {

/// Made of a camera alone it has the ideal lens of its family: a pinhole for RadialTangentialLens, d = theta for
/// FisheyeLens. That is what a viewer that knows no lens shows.
template <class LensPolicy>
struct LensCamera : Camera<double> {
  LensPolicy lens{};

  LensCamera() = default;
  LensCamera(const Camera<double>& camera) : Camera<double>(camera) {}  // NOLINT(google-explicit-constructor)
  LensCamera(const Camera<double>& camera, LensPolicy lens_policy)
      : Camera<double>(camera),
        lens(std::move(lens_policy)) {}
};

/// The camera that a projection with this lens policy wants; Camera<double> itself without a lens.
template <class LensPolicy>
using CameraOf = std::conditional_t<std::is_same_v<LensPolicy, PinholeLens>, Camera<double>, LensCamera<LensPolicy>>;

namespace detail {
template <class LensPolicy>
struct LensConversion;
template <>
struct LensConversion<PinholeLens> {
  static constexpr const char* family = "pinhole";
  [[nodiscard]] static std::optional<PinholeLens> from(const Lens& lens) {
    return is_pinhole(lens) ? std::optional<PinholeLens>(PinholeLens{}) : std::nullopt;
  }
};
template <class T>
struct LensConversion<RadialTangentialLens<T>> {
  static constexpr const char* family = "radial and tangential";
  [[nodiscard]] static std::optional<RadialTangentialLens<T>> from(const Lens& lens) {
    return radial_tangential_lens<T>(lens);
  }
};
template <class T>
struct LensConversion<FisheyeLens<T>> {
  static constexpr const char* family = "fisheye";
  [[nodiscard]] static std::optional<FisheyeLens<T>> from(const Lens& lens) { return fisheye_lens<T>(lens); }
};
}  // namespace detail

/// The policy of a photograph's lens, if it is of the policy's family. Cost: up to half a millisecond (lens_limit):
/// once for each camera.
template <class LensPolicy>
[[nodiscard]] std::optional<LensPolicy> lens_policy(const Lens& lens) {
  return detail::LensConversion<LensPolicy>::from(lens);
}
/// The name of the lens family in messages.
template <class LensPolicy>
inline constexpr const char* lens_family = detail::LensConversion<LensPolicy>::family;

}  // namespace compmark
