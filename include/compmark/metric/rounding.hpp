// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What a viewer gets is an 8-bit image, so that is what metrics look at: floor(255 clamp(v) + 1/2)
// (docs/spec/numerics.md, SH4).
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// Nearest 8-bit level of a colour value; below 0 and NaN give 0, above 1 gives 255.
template <class T>
[[nodiscard]] constexpr std::uint8_t to_8bit(T value) {
  if (!(value > T(0))) return 0;
  if (value >= T(1)) return 255;
  return static_cast<std::uint8_t>(value * T(255) + T(0.5));
}

/// Levels of a whole image, same layout.
template <class T>
void to_8bit(ImageView<const T> image, std::span<std::uint8_t> levels) {
  COMPMARK_ASSERT(levels.size() == image.size(), "to_8bit: sizes differ");
  for (std::size_t i = 0; i < levels.size(); ++i) levels[i] = to_8bit(image.data[i]);
}

/// The image as its 8-bit copy shows it: level / 255. `rounded` may be `image`. Largest error inside [0, 1]: 0.5 / 255.
template <class T>
void round_to_8bit(ImageView<const T> image, ImageView<T> rounded) {
  COMPMARK_ASSERT(rounded.size() == image.size(), "round_to_8bit: sizes differ");
  for (std::size_t i = 0; i < image.size(); ++i) rounded.data[i] = static_cast<T>(to_8bit(image.data[i])) / T(255);
}

}  // namespace compmark
