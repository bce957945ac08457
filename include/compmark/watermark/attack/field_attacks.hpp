// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a picture (attack_list.hpp) as the attack code of the field does them, under names of their own, where it
// differs from what papers write: "noise .1" adds deviations of .1^2, "crop .4" keeps .4 of each side, "scaling 75 %"
// is a share of the area, "rotation" is drawn up to the angle, from the nearest pixel, and "blur .1" has three taps
// (docs/robustness.md). PictureAttacks (picture_attacks.hpp) has them in its list. Cost: 1 to 20 ns a value.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <string_view>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/attack/picture_distortion.hpp"
#include "compmark/watermark/attack/viewer_attacks.hpp"

namespace compmark {

struct FieldNoiseAttack {
  static constexpr std::string_view name = "field_noise";
  static constexpr AttackAmount amount{0.1, 0, 1, "the root of the deviation: 0.1 adds noise of 0.01"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double root, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::noise, image, root * root, seed);
  }
};
struct FieldCropAttack {
  static constexpr std::string_view name = "field_crop";
  static constexpr AttackAmount amount{0.4, 0.1, 1, "the share of each side that is kept, from the middle"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double side, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::crop, image, side * side, seed);
  }
};
struct FieldScaleAttack {
  static constexpr std::string_view name = "field_scale";
  static constexpr AttackAmount amount{0.75, 0.01, 4, "the factor of the area"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double area, std::uint64_t seed) {
    return detail::distorted_picture(Augmentation::resize, image, std::sqrt(area), seed);
  }
};
/// On the same canvas, black where nothing is.
struct FieldRotationAttack {
  static constexpr std::string_view name = "field_rotation";
  static constexpr AttackAmount amount{30, 0, 180, "degrees; the angle is drawn between minus and plus this"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double degrees, std::uint64_t seed) {
    const Random random(seed, 0, random_stage("attack/field_rotation"));
    const double angle = (2 * random.uniform(0) - 1) * degrees * std::numbers::pi / 180;
    const double cosine = std::cos(angle), sine = std::sin(angle);
    AttackedPicture result{image.height, image.width, std::vector<float>(image.size())};
    const ImageView<float> to{result.planes.data(), 3, image.height, image.width};
    for (int y = 0; y < image.height; ++y) {
      const double down = y - 0.5 * (image.height - 1);
      for (int x = 0; x < image.width; ++x) {
        const double right = x - 0.5 * (image.width - 1);
        const double u = std::round(cosine * right - sine * down + 0.5 * (image.width - 1)),
                     v = std::round(sine * right + cosine * down + 0.5 * (image.height - 1));
        if (u < 0 || v < 0 || u >= image.width || v >= image.height) continue;
        for (int c = 0; c < 3; ++c) to(c, y, x) = image(c, static_cast<int>(v), static_cast<int>(u));
      }
    }
    return result;
  }
};
/// Of .1, as published, it changes nothing; code that leaves the deviation out has .8.
struct FieldBlurAttack {
  static constexpr std::string_view name = "field_blur";
  static constexpr AttackAmount amount{0.8, 0.05, 20, "the deviation of a blur of 3 x 3 pixels"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double sigma, std::uint64_t /*seed*/) {
    const double tap = std::exp(-0.5 / (sigma * sigma));
    return detail::filtered_picture(image, 1, [tap](std::span<const float> window) {
      double sum = 0, weight = 0;
      for (std::size_t i = 0; i < 9; ++i) {
        const double w = (i / 3 == 1 ? 1 : tap) * (i % 3 == 1 ? 1 : tap);
        sum += w * static_cast<double>(window[i]);
        weight += w;
      }
      return detail::colour_of(sum / weight);
    });
  }
};
struct FieldBrightnessAttack {
  static constexpr std::string_view name = "field_brightness";
  static constexpr AttackAmount amount{0.5, 0, 1, "the factor is drawn between 1 minus and 1 plus this"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double range, std::uint64_t seed) {
    const Random random(seed, 0, random_stage("attack/field_brightness"));
    return detail::distorted_picture(Augmentation::brightness, image, 1 + (2 * random.uniform(0) - 1) * range, seed);
  }
};

}  // namespace compmark
