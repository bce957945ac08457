// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The images of SOG files, lossless: WebP by libwebp where the program was built with it (COMPMARK_WITH_WEBP), as most
// viewers expect, and PNG by stb, which the format's specification allows too. A WebP image says its size before memory
// is taken for it, and few bytes of one can stand for many pixels: the caller bounds them. Cost: that of the library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/config.hpp"
#include "compmark/core/result.hpp"
#include "compmark/io/file_kind.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/splat/splat_file.hpp"

#if defined(COMPMARK_WITH_WEBP)
#include <webp/decode.h>
#include <webp/encode.h>
#endif

namespace compmark {

/// Whether this program reads and writes WebP images of SOG files.
#if defined(COMPMARK_WITH_WEBP)
inline constexpr bool has_webp = true;
#else
inline constexpr bool has_webp = false;
#endif

namespace detail {

/// An encoded image; empty where there was no memory for it.
struct SogImage {
  std::vector<std::byte> bytes;
  std::string ending = ".png";
};

#if defined(COMPMARK_WITH_WEBP)
/// A lossless WebP file that keeps the colours of transparent pixels too; empty without memory.
[[nodiscard]] inline std::vector<std::byte> encode_webp(const ImageBytes& image) {
  std::vector<std::byte> bytes;
  WebPConfig config;
  WebPPicture picture;
  constexpr int effort = 6;
  if (WebPConfigInit(&config) == 0 || WebPConfigLosslessPreset(&config, effort) == 0 || WebPPictureInit(&picture) == 0)
    return bytes;
  config.exact = 1;
  picture.use_argb = 1;
  picture.width = image.width;
  picture.height = image.height;
  WebPMemoryWriter memory;
  WebPMemoryWriterInit(&memory);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &memory;
  const int stride = image.width * image.channels;
  const int taken = image.channels == 4 ? WebPPictureImportRGBA(&picture, image.pixels.data(), stride)
                                        : WebPPictureImportRGB(&picture, image.pixels.data(), stride);
  if (taken != 0 && WebPEncode(&config, &picture) != 0) {
    const std::span<const std::byte> written = std::as_bytes(std::span<const std::uint8_t>(memory.mem, memory.size));
    bytes.assign(written.begin(), written.end());
  }
  WebPPictureFree(&picture);
  WebPMemoryWriterClear(&memory);
  return bytes;
}
#endif

/// An image of 3 or 4 channels.
[[nodiscard]] inline SogImage encode_sog_image(const ImageBytes& image, [[maybe_unused]] bool png) {
#if defined(COMPMARK_WITH_WEBP)
  if (!png && image.width <= WEBP_MAX_DIMENSION && image.height <= WEBP_MAX_DIMENSION)
    return {encode_webp(image), ".webp"};
#endif
  return {encode_png(image), ".png"};
}

[[nodiscard]] inline Result<ImageBytes> decode_webp([[maybe_unused]] std::span<const std::byte> bytes,
                                                    const std::string& name, const std::string& field,
                                                    [[maybe_unused]] std::size_t most_pixels) {
#if defined(COMPMARK_WITH_WEBP)
  const auto* const data = reinterpret_cast<const std::uint8_t*>(bytes.data());
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(data, bytes.size(), &features) != VP8_STATUS_OK)
    return splat_error(ErrorKind::malformed, name, field, "is a WebP image that is damaged");
  if (features.format != 2 || features.has_animation != 0) {
    return splat_error(ErrorKind::unsupported, name, field, "is a WebP image with losses, which change the numbers",
                       "export it again with lossless images");
  }
  const std::size_t width = static_cast<std::size_t>(features.width);
  const std::size_t height = static_cast<std::size_t>(features.height);
  if (width * height > most_pixels) {
    return splat_error(ErrorKind::exhausted, name, field,
                       "has " + std::to_string(width) + " x " + std::to_string(height) +
                           " pixels, more than the splats of the file need");
  }
  ImageBytes image{features.width, features.height, 4, std::vector<std::uint8_t>(4 * width * height)};
  if (WebPDecodeRGBAInto(data, bytes.size(), image.pixels.data(), image.pixels.size(), 4 * features.width) == nullptr)
    return splat_error(ErrorKind::malformed, name, field, "is a WebP image that is damaged");
  return image;
#else
  return splat_error(ErrorKind::unsupported, name, field, "is a WebP image, which this program does not read",
                     "build it with libwebp (Debian, Ubuntu: libwebp-dev), or convert the file with splat-transform");
#endif
}

/// An image of a SOG file; `name` is that of the file, `field` that of the image, for the messages.
[[nodiscard]] inline Result<ImageBytes> decode_sog_image(std::span<const std::byte> bytes, const std::string& name,
                                                         const std::string& field, std::size_t most_pixels) {
  if (!bytes.empty() && identify_bytes(bytes, bytes.size()) == FileKind::webp)
    return decode_webp(bytes, name, field, most_pixels);
  Result<ImageBytes> found = decode_image(bytes, name);
  if (found) return found;
  Error damaged = found.error();
  damaged.field = field;
  damaged.remedy = "copy or export it again";
  return damaged;
}

}  // namespace detail

}  // namespace compmark
