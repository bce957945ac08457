// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A distortion of watermark/pretrain/augmentation.hpp as an attack on a picture (attack_list.hpp).
#pragma once

#include <cstdint>

#include "compmark/core/executor.hpp"
#include "compmark/core/views.hpp"
#include "compmark/watermark/attack/attack_list.hpp"
#include "compmark/watermark/pretrain/augmentation.hpp"

namespace compmark::detail {

/// Colours are held in [0, 1].
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

}  // namespace compmark::detail
