// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A training image at rest: 8-bit RGB planes, a quarter of the memory of floats. And the one rule by which transparent
// images get their background (docs/spec/method.md, 3.4): rgb alpha + background (1 - alpha) in double, then back to 8
// bits.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// How a composited value becomes a byte. The published code truncates, which darkens by half a level on average;
/// nearest does not.
enum class AlphaRounding { truncate, nearest };

/// Planar RGB [3, height, width], 8 bits, and where there is a mask how much each pixel counts: 0 not at all, 255
/// whole.
struct StoredImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> planes;
  std::vector<std::uint8_t> mask = {};   ///< [height, width]; empty: every pixel counts whole
  std::vector<std::uint8_t> alpha = {};  ///< [height, width] coverage, if it was asked for; empty: opaque everywhere

  [[nodiscard]] std::size_t plane_size() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] std::size_t bytes() const { return planes.size() + mask.size() + alpha.size(); }
  [[nodiscard]] ImageView<const std::uint8_t> view() const { return {planes.data(), 3, height, width}; }

  /// Fills out [3, height, width] with value / 255, correctly rounded. Cost: one pass, ~5 bytes of traffic a value.
  void to_float(ImageView<float> out) const {
    COMPMARK_ASSERT(out.channels == 3 && out.width == width && out.height == height, "StoredImage::to_float: shape");
    const std::uint8_t* source = planes.data();
    float* target = out.data;
    const std::size_t count = planes.size();
    for (std::size_t i = 0; i < count; ++i) target[i] = static_cast<float>(source[i]) / 255.0f;
  }
};

/// Composites interleaved pixels of 1 to 4 channels over the background into planes [3, count].
inline void composite(std::span<const std::uint8_t> pixels, int channels, const std::array<float, 3>& background,
                      AlphaRounding rounding, std::span<std::uint8_t> planes) {
  const std::size_t stride = static_cast<std::size_t>(channels);
  const std::size_t count = pixels.size() / stride;
  COMPMARK_ASSERT(planes.size() == 3 * count, "composite: shapes");
  const bool colored = channels >= 3;
  const bool has_alpha = channels == 2 || channels == 4;
  const double half = rounding == AlphaRounding::nearest ? 0.5 : 0.0;
  for (std::size_t c = 0; c < 3; ++c) {
    std::uint8_t* plane = planes.data() + c * count;
    const std::uint8_t* color = pixels.data() + (colored ? c : 0);
    const double behind = static_cast<double>(background[c]);
    for (std::size_t i = 0; i < count; ++i) {
      if (!has_alpha) {
        plane[i] = color[i * stride];
        continue;
      }
      const double alpha = pixels[i * stride + stride - 1] / 255.0;
      const double value = color[i * stride] / 255.0 * alpha + behind * (1 - alpha);
      // 254.999… for an opaque 255 must not truncate to 254: the sum is exact there, as alpha is 1 and 255 / 255 is 1.
      plane[i] = static_cast<std::uint8_t>(std::fmin(std::fmax(value * 255.0 + half, 0.0), 255.0));
    }
  }
}

}  // namespace compmark
