// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Turning an image as its Exif orientation says (io/exif.hpp). Cost: one pass over the pixels.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>

#include "compmark/io/image_file.hpp"

namespace compmark {

/// True if rows and columns change places.
[[nodiscard]] constexpr bool exchanges_sides(int orientation) { return orientation >= 5 && orientation <= 8; }

/// The image as it is to be viewed.
[[nodiscard]] inline ImageBytes turned(ImageBytes image, int orientation) {
  if (orientation <= 1 || orientation > 8) return image;
  const bool exchanged = exchanges_sides(orientation);
  ImageBytes result{exchanged ? image.height : image.width, exchanged ? image.width : image.height, image.channels, {}};
  result.pixels.resize(image.pixels.size());
  // Which of the stored image's sides run backwards along the viewed image's: bit by bit of the eight orientations.
  const bool flip_x = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool flip_y = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  const std::size_t channels = static_cast<std::size_t>(image.channels);
  const auto index = [channels](int x, int y, int width) {
    return (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) * channels;
  };
  for (int y = 0; y < result.height; ++y) {
    for (int x = 0; x < result.width; ++x) {
      int from_x = exchanged ? y : x, from_y = exchanged ? x : y;
      if (flip_x) from_x = image.width - 1 - from_x;
      if (flip_y) from_y = image.height - 1 - from_y;
      std::copy_n(image.pixels.data() + index(from_x, from_y, image.width), channels,
                  result.pixels.data() + index(x, y, result.width));
    }
  }
  return result;
}

}  // namespace compmark
