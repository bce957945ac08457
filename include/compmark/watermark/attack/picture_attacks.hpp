// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Attacks on a picture (attack_list.hpp): what happens to a render on its way. Those of place, sharpness and light are
// the distortions of watermark/pretrain/augmentation.hpp at a chosen strength, those of colour and of files are those
// of watermark/edit; viewer_attacks.hpp, file_attacks.hpp and field_attacks.hpp have others. To add one: its type here,
// and its name in the list PictureAttacks. Cost: 1 to 25 ns a value.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string_view>

#include "compmark/core/views.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/attack/field_attacks.hpp"
#include "compmark/watermark/attack/file_attacks.hpp"
#include "compmark/watermark/attack/picture_distortion.hpp"
#include "compmark/watermark/attack/viewer_attacks.hpp"
#include "compmark/watermark/edit/augmentation_edit.hpp"
#include "compmark/watermark/edit/tone_edit.hpp"

namespace compmark {

namespace detail {
/// A matrix [3, 3] of every pixel's colour.
[[nodiscard]] inline AttackedPicture recoloured_picture(ImageView<const float> image,
                                                        const std::array<double, 9>& matrix) {
  AttackedPicture result{image.height, image.width, std::vector<float>(image.size())};
  const std::size_t plane = image.plane_size();
  for (std::size_t i = 0; i < plane; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      double sum = 0;
      for (std::size_t k = 0; k < 3; ++k) sum += matrix[3 * c + k] * static_cast<double>(image.data[k * plane + i]);
      result.planes[c * plane + i] = static_cast<float>(sum > 0 ? (sum < 1 ? sum : 1) : 0);
    }
  }
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
struct GammaAttack {
  static constexpr std::string_view name = "gamma";
  static constexpr AttackAmount amount{1.25, 0.1, 10, "the exponent of the colours"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double exponent, std::uint64_t /*seed*/) {
    AttackedPicture result{image.height, image.width, {image.data, image.data + image.size()}};
    for (float& value : result.planes) {
      const double power = std::pow(static_cast<double>(value), exponent);
      value = power > 0 ? (power < 1 ? static_cast<float>(power) : 1.0f) : 0.0f;
    }
    return result;
  }
};
struct HueAttack {
  static constexpr std::string_view name = "hue";
  static constexpr AttackAmount amount{10, -180, 180, "the angle in degrees"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double degrees, std::uint64_t /*seed*/) {
    return detail::recoloured_picture(image, ToneEdit::colour_matrix({1, 1, 1}, 1, degrees * std::numbers::pi / 180));
  }
};
struct SaturationAttack {
  static constexpr std::string_view name = "saturation";
  static constexpr AttackAmount amount{0.7, 0, 4, "the factor of the saturation, 0 for grey"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double factor, std::uint64_t /*seed*/) {
    return detail::recoloured_picture(image, ToneEdit::colour_matrix({1, 1, 1}, factor, 0));
  }
};
struct JpegAttack {
  static constexpr std::string_view name = "jpeg";
  static constexpr AttackAmount amount{50, 1, 100, "the quality of a JPEG file", 1};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double quality, std::uint64_t /*seed*/) {
    AttackedPicture result{image.height, image.width, std::vector<float>(image.size())};
    jpeg_picture<float>(image, static_cast<int>(std::lround(quality)),
                        {result.planes.data(), 3, image.height, image.width});
    return result;
  }
};
struct FrameAttack {
  static constexpr std::string_view name = "frame";
  static constexpr AttackAmount amount{20, 1, 512, "the width of a nearly white frame in pixels, a whole number", 1};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double pixels, std::uint64_t /*seed*/) {
    const int width = static_cast<int>(std::lround(pixels));
    return detail::picture_on_page(image, image.height + 2 * width, image.width + 2 * width, width, width, 0.96f);
  }
};
/// What a chat service does: smaller, stronger colours, JPEG of quality 70.
struct ChatAttack {
  static constexpr std::string_view name = "chat";
  static constexpr AttackAmount amount{0.6, 0.1, 1, "the factor of the sides"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double factor, std::uint64_t seed) {
    const AttackedPicture small = ResizeAttack::apply(image, factor, seed);
    return JpegAttack::apply(SaturationAttack::apply(small.view(), 1.15, seed).view(), 70, seed);
  }
};

/// A photograph of a screen that was cut out roughly: smaller, a frame, JPEG of quality 80.
struct ScreenshotAttack {
  static constexpr std::string_view name = "screenshot";
  static constexpr AttackAmount amount{0.8, 0.1, 2, "the factor of the sides"};
  [[nodiscard]] static AttackedPicture apply(ImageView<const float> image, double factor, std::uint64_t seed) {
    const AttackedPicture small = ResizeAttack::apply(image, factor, seed);
    return JpegAttack::apply(FrameAttack::apply(small.view(), 16, seed).view(), 80, seed);
  }
};

/// All that are shipped.
using PictureAttacks =
    AttackList<CropAttack, ResizeAttack, RotationAttack, BlurAttack, NoiseAttack, BrightnessAttack, GammaAttack,
               ContrastAttack, HueAttack, SaturationAttack, JpegAttack, FrameAttack, PageAttack, PaintAttack,
               MirrorAttack, MedianAttack, SharpenAttack, LevelsAttack, ChatAttack, ScreenshotAttack, FieldNoiseAttack,
               FieldCropAttack, FieldScaleAttack, FieldRotationAttack, FieldBlurAttack, FieldBrightnessAttack,
               PaletteAttack, ResampleAttack>;

}  // namespace compmark
