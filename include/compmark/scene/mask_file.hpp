// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One mask, decoded as it is stored: 8 or 16 bits, grey, colours (a palette is expanded), with an alpha channel or
// without. The meaning of the numbers is decided over all masks of a capture (scene/mask_reading.hpp). Cost: decoding,
// ~20 ns a pixel.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/scene/dataset.hpp"

namespace compmark {

struct MaskFile {
  int width = 0, height = 0, channels = 0;
  int white = 255;                    ///< largest number that a channel can hold
  std::vector<std::uint16_t> pixels;  ///< interleaved

  [[nodiscard]] std::size_t size() const { return pixels.size() / static_cast<std::size_t>(channels); }
  [[nodiscard]] bool has_alpha() const { return channels == 2 || channels == 4; }
  [[nodiscard]] int alpha(std::size_t i) const { return pixels[(i + 1) * static_cast<std::size_t>(channels) - 1]; }
  /// The brightest of the pixel's colours.
  [[nodiscard]] int value(std::size_t i) const {
    const std::uint16_t* p = pixels.data() + i * static_cast<std::size_t>(channels);
    return channels < 3 ? p[0] : std::max({p[0], p[1], p[2]});
  }
  [[nodiscard]] int darkest(std::size_t i) const {
    const std::uint16_t* p = pixels.data() + i * static_cast<std::size_t>(channels);
    return channels < 3 ? p[0] : std::min({p[0], p[1], p[2]});
  }
};

/// Decodes a mask with all of its bits.
[[nodiscard]] inline Result<MaskFile> read_mask_file(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_image_bytes(path);
  if (!bytes) return bytes.error();
  const Result<ImageInfo> info = decode_image_info(*bytes, path.string());
  if (!info) return info.error();
  MaskFile mask;
  if (info->bits != 16) {
    const Result<ImageBytes> image = decode_image(*bytes, path.string());
    if (!image) return image.error();
    mask = {image->width, image->height, image->channels, 255, {image->pixels.begin(), image->pixels.end()}};
    return mask;
  }
  if (const Result<Done> fits = detail::check_image(*bytes, *info, path.string(), image_memory_limit); !fits)
    return fits.error();
  struct Free {
    void operator()(void* p) const { detail::stb::stbi_image_free(p); }
  };
  const std::unique_ptr<std::uint16_t, Free> pixels(detail::stb::stbi_load_16_from_memory(
      reinterpret_cast<const unsigned char*>(bytes->data()), static_cast<int>(bytes->size()), &mask.width, &mask.height,
      &mask.channels, 0));
  if (!pixels) {
    return detail::image_error(ErrorKind::unreadable, path.string(), "the image is damaged or truncated",
                               "copy it again, or leave it out");
  }
  mask.white = 65535;
  const std::size_t count = static_cast<std::size_t>(mask.width) * static_cast<std::size_t>(mask.height);
  mask.pixels.assign(pixels.get(), pixels.get() + count * static_cast<std::size_t>(mask.channels));
  return mask;
}

namespace detail {
[[nodiscard]] inline Error mask_of_other_size(const View& view, int width, int height, int image_width,
                                              int image_height) {
  return {ErrorKind::invalid, view.mask_path.string(), "image size",
          "is " + std::to_string(width) + " x " + std::to_string(height) + ", but its image has " +
              std::to_string(image_width) + " x " + std::to_string(image_height) + " pixels",
          "make the mask as large as its image"};
}
}  // namespace detail

/// The weight of each pixel, 0 … 255, for a given meaning of the numbers.
[[nodiscard]] inline std::vector<std::uint8_t> mask_weights(const MaskFile& mask, MaskReading reading) {
  std::vector<std::uint8_t> weights(mask.size());
  const bool alpha = mask.has_alpha() && (reading == MaskReading::alpha || reading == MaskReading::any_alpha);
  const bool any = reading == MaskReading::any || reading == MaskReading::any_alpha;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const int v = alpha ? mask.alpha(i) : mask.value(i);
    weights[i] = static_cast<std::uint8_t>(any ? (v > 0 ? 255 : 0) : mask.white == 255 ? v : v >> 8);
  }
  return weights;
}

}  // namespace compmark
