// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a picture (attack_list.hpp): what happens to a render on its way. Those of place, sharpness and light are
// the distortions of watermark/pretrain/augmentation.hpp at a chosen strength. To add one: its type here, and its name
// in the list PictureAttacks. Cost: 1 to 6 ns a value.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string_view>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"

namespace compmark {

namespace detail {
[[nodiscard]] inline AttackedPicture distorted_picture(Augmentation kind, ImageView<const float> image, double amount,
                                                       std::uint64_t seed) {
  AugmentationDraw draw;
  draw.kind = kind;
  draw.amount = amount;
  draw.seed = seed;
  Augmenter<float> augmenter;
  SerialExecutor executor;
  const ImageView<const float> seen = augmenter.forward(
      image, draw, [](auto&&...) {}, executor);
  AttackedPicture result{seen.height, seen.width, {seen.data, seen.data + seen.size()}};
  for (float& value : result.planes) value = value > 0 ? (value < 1 ? value : 1.0f) : 0.0f;
  return result;
}
}  // namespace detail

struct CropAttack {
  static constexpr std::string_view name = "crop";
  static constexpr AttackAmount amount{0.5, 0.01, 1, "the share of the area that is kept, from the middle"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double share, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::crop, image, share, seed);
  }
};
struct ResizeAttack {
  static constexpr std::string_view name = "resize";
  static constexpr AttackAmount amount{0.7, 0.1, 2, "the factor of the sides"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double factor, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::resize, image, factor, seed);
  }
};
struct RotationAttack {
  static constexpr std::string_view name = "rotation";
  static constexpr AttackAmount amount{5, -180, 180, "the angle in degrees"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double degrees, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::rotation, image, degrees * std::numbers::pi / 180, seed);
  }
};
struct BlurAttack {
  static constexpr std::string_view name = "blur";
  static constexpr AttackAmount amount{1, 0.1, 20, "the deviation of the blur in pixels"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double sigma, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::blur, image, sigma, seed);
  }
};
struct NoiseAttack {
  static constexpr std::string_view name = "noise";
  static constexpr AttackAmount amount{0.05, 0, 1, "the deviation of the noise, of colours in [0, 1]"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double deviation, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::noise, image, deviation, seed);
  }
};
struct BrightnessAttack {
  static constexpr std::string_view name = "brightness";
  static constexpr AttackAmount amount{0.8, 0, 4, "the factor of the colours"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double factor, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::brightness, image, factor, seed);
  }
};

/// All that are shipped.
using PictureAttacks = AttackList<CropAttack, ResizeAttack, RotationAttack, BlurAttack, NoiseAttack, BrightnessAttack>;

}  // namespace compmark
