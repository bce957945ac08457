// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Image files: PNG and JPEG in, PNG and JPEG out, 8 bits a channel. The size in the header is checked before anything is allocated;
// a file that cannot be decoded whole is an Error, never a partly grey image. Cost: ~20 ns a pixel to read PNG, ~100 ns to write it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"
#include "compmark/io/atomic_file.hpp"
#include "compmark/io/detail/stb.hpp"
#include "compmark/io/exif.hpp"
#include "compmark/io/file_kind.hpp"

namespace compmark::inline v0 {

/// What the header of an image file says.
struct ImageInfo {
  int width = 0;        ///< pixels
  int height = 0;       ///< pixels
  int channels = 0;     ///< 1 grey, 2 grey and alpha, 3 RGB, 4 RGB and (straight) alpha
  int bits = 8;         ///< a channel in the file, 8 or 16; decoded images have 8
  int orientation = 1;  ///< Exif orientation of a JPEG, 1 … 8 (io/exif.hpp); decoding does not turn

  [[nodiscard]] bool has_alpha() const { return channels == 2 || channels == 4; }
};

/// A decoded file, interleaved: channel c of pixel (x, y) is pixels[(y * width + x) * channels + c].
struct ImageBytes {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<std::uint8_t> pixels;
};

/// Larger images are refused: a header of a few bytes must not make us allocate gigabytes.
inline constexpr std::int64_t image_pixel_limit = std::int64_t{1} << 28;
inline constexpr std::uintmax_t image_file_limit = std::uintmax_t{1} << 31;

namespace detail {

/// True if every Huffman table of a JPEG has at most 256 codes. stb before its release 2.29 writes past its tables otherwise, so files
/// are checked first. Segments are walked as stb walks them; anything odd that is not a table is left for stb to refuse.
[[nodiscard]] inline bool huffman_tables_fit(std::span<const std::byte> bytes) {
  const auto at = [&](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
  if (bytes.size() < 2 || at(0) != 0xFF || at(1) != 0xD8) return true;  // not a JPEG
  for (std::size_t i = 2; i + 3 < bytes.size();) {
    if (at(i) != 0xFF) {
      ++i;
      continue;
    }
    const unsigned marker = at(i + 1);
    if (marker == 0xFF) {
      ++i;
      continue;
    }
    if (marker < 0xC0 ||
        (marker >= 0xD0 && marker <= 0xD9)) {  // a stuffed byte, a restart, the start or the end: no contents
      i += 2;
      continue;
    }
    const std::size_t end = i + 2 + 256 * at(i + 2) + at(i + 3);
    if (marker == 0xC4) {
      for (std::size_t table = i + 4; table + 17 <= bytes.size() && table + 17 <= end;) {
        unsigned codes = 0;
        for (std::size_t k = 1; k <= 16; ++k) codes += at(table + k);
        if (codes > 256) return false;
        table += 17 + codes;
      }
    }
    i = end;
  }
  return true;
}

/// True for a PNG whose header asks for more than image_pixel_limit pixels.
[[nodiscard]] inline bool promises_too_much(std::span<const std::byte> bytes) {
  constexpr std::size_t size_field = 16;
  if (bytes.size() < size_field + 8 || std::memcmp(bytes.data(), "\x89PNG", 4) != 0) return false;
  double pixels = 1;
  for (const std::size_t side : {size_field, size_field + 4}) {
    double length = 0;
    for (std::size_t k = 0; k < 4; ++k) length = 256 * length + std::to_integer<int>(bytes[side + k]);
    pixels *= length;
  }
  return pixels > static_cast<double>(image_pixel_limit);
}

inline constexpr std::string_view image_kinds = "a PNG or JPEG image";
inline Error image_error(ErrorKind kind, const std::string& name, std::string problem, std::string remedy) {
  return {kind, name, "", std::move(problem), std::move(remedy)};
}
}  // namespace detail

/// Size and channels from the header of an encoded image in memory; `name` is for the message.
[[nodiscard]] inline Result<ImageInfo> decode_image_info(std::span<const std::byte> bytes, const std::string& name) {
  ImageInfo info;
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  if (bytes.empty())
    return detail::image_error(ErrorKind::truncated, name, "the image file is empty", "copy it again or remove it");
  if (bytes.size() > image_file_limit - 1 ||
      detail::stb::stbi_info_from_memory(data, static_cast<int>(bytes.size()), &info.width, &info.height,
                                         &info.channels) == 0) {
    if (detail::promises_too_much(bytes)) {  // stb forgets this reason
      return detail::image_error(ErrorKind::exhausted, name, "has more pixels than are allowed",
                                 "scale it down below 256 megapixels");
    }
    const FileKind kind = identify_bytes(bytes, bytes.size());
    if (tells_kind(kind) && kind != FileKind::png && kind != FileKind::jpeg)
      return wrong_kind(kind, name, detail::image_kinds);
    return detail::image_error(ErrorKind::unreadable, name, "is not an image that can be read",
                               "convert it to PNG or JPEG");
  }
  const std::int64_t pixels = std::int64_t{info.width} * info.height;
  if (info.width <= 0 || info.height <= 0 || pixels > image_pixel_limit) {
    return detail::image_error(
        ErrorKind::exhausted, name,
        "has " + std::to_string(info.width) + " x " + std::to_string(info.height) + " pixels, more than is allowed",
        "scale it down below " + std::to_string(image_pixel_limit >> 20) + " megapixels");
  }
  if (detail::stb::stbi_is_16_bit_from_memory(data, static_cast<int>(bytes.size())) != 0) info.bits = 16;
  info.orientation = jpeg_orientation(bytes);
  return info;
}

/// Decodes a PNG or JPEG in memory. 16-bit channels are reduced to 8.
[[nodiscard]] inline Result<ImageBytes> decode_image(std::span<const std::byte> bytes, const std::string& name) {
  const Result<ImageInfo> info = decode_image_info(bytes, name);
  if (!info) return info.error();
  if (!detail::huffman_tables_fit(bytes)) {
    return detail::image_error(ErrorKind::malformed, name, "the image is damaged (an oversized Huffman table)",
                               "copy it again or remove it from the dataset");
  }
  int width = 0;
  int height = 0;
  int channels = 0;
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  struct Free {
    void operator()(unsigned char* p) const { detail::stb::stbi_image_free(p); }
  };
  const std::unique_ptr<unsigned char, Free> pixels(
      detail::stb::stbi_load_from_memory(data, static_cast<int>(bytes.size()), &width, &height, &channels, 0));
  if (!pixels) {
    return detail::image_error(
        ErrorKind::unreadable, name,
        std::string("the image is damaged or truncated (") + detail::stb::stbi_failure_reason() + ")",
        "copy it again or remove it from the dataset");
  }
  ImageBytes image{width, height, channels, {}};
  const std::size_t count =
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(channels);
  image.pixels.assign(pixels.get(), pixels.get() + count);
  return image;
}

namespace detail {
[[nodiscard]] inline Result<std::vector<std::byte>> read_image_file(const std::filesystem::path& path) {
  return read_file_of(path, image_file_limit, image_kinds, [](FileKind kind, std::span<const std::byte>) {
    return kind == FileKind::png || kind == FileKind::jpeg;
  });
}
}  // namespace detail

/// Size and channels of a file. Reads the whole file: on a warm disk cache ~0.1 ms a megabyte.
[[nodiscard]] inline Result<ImageInfo> read_image_info(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = detail::read_image_file(path);
  if (!bytes) return bytes.error();
  return decode_image_info(*bytes, path.string());
}

[[nodiscard]] inline Result<ImageBytes> read_image(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = detail::read_image_file(path);
  if (!bytes) return bytes.error();
  return decode_image(*bytes, path.string());
}

namespace detail {
inline void append_bytes(void* context, void* data, int size) {
  auto& bytes = *static_cast<std::vector<std::byte>*>(context);
  if (size <= 0) return;
  // Not insert: g++ 12 at -O3 takes the spare room of the old storage for the whole and warns in the caller's program.
  const std::size_t before = bytes.size();
  bytes.resize(before + static_cast<std::size_t>(size));
  std::memcpy(bytes.data() + before, data, static_cast<std::size_t>(size));
}
}  // namespace detail

/// PNG file of an image of 1 to 4 channels, lossless.
[[nodiscard]] inline std::vector<std::byte> encode_png(const ImageBytes& image) {
  COMPMARK_ASSERT(image.width > 0 && image.height > 0 && image.channels >= 1 && image.channels <= 4,
                  "encode_png: empty image");
  std::vector<std::byte> bytes;
  detail::stb::stbi_write_png_to_func(detail::append_bytes, &bytes, image.width, image.height, image.channels,
                                      image.pixels.data(), image.width * image.channels);
  return bytes;
}

/// JPEG file of an image of 1 or 3 channels, quality 1 to 100.
[[nodiscard]] inline std::vector<std::byte> encode_jpeg(const ImageBytes& image, int quality) {
  COMPMARK_ASSERT(image.width > 0 && image.height > 0 && (image.channels == 1 || image.channels == 3),
                  "encode_jpeg: 1 or 3 channels");
  std::vector<std::byte> bytes;
  detail::stb::stbi_write_jpg_to_func(detail::append_bytes, &bytes, image.width, image.height, image.channels,
                                      image.pixels.data(), quality);
  return bytes;
}

/// Rounds a planar float image in [0, 1] to interleaved bytes: round(255 v), clamped, NaN becomes 0.
template <class T>
[[nodiscard]] ImageBytes to_bytes(ImageView<const T> image) {
  ImageBytes bytes{image.width, image.height, image.channels, std::vector<std::uint8_t>(image.size())};
  const std::size_t channels = static_cast<std::size_t>(image.channels);
  for (std::size_t c = 0; c < channels; ++c) {
    const T* plane = image.plane(static_cast<int>(c));
    for (std::size_t i = 0; i < image.plane_size(); ++i) {
      const T value = plane[i] > T(0) ? (plane[i] < T(1) ? plane[i] : T(1)) : T(0);
      bytes.pixels[i * channels + c] = static_cast<std::uint8_t>(value * T(255) + T(0.5));
    }
  }
  return bytes;
}

/// Writes a PNG, whole or not at all.
[[nodiscard]] inline Result<Done> write_png(const std::filesystem::path& path, const ImageBytes& image) {
  return write_file(path, std::span<const std::byte>(encode_png(image)));
}
[[nodiscard]] inline Result<Done> write_png(const std::filesystem::path& path, ImageView<const float> image) {
  return write_png(path, to_bytes(image));
}

}  // namespace compmark::inline v0
