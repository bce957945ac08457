// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Image files: PNG and JPEG in, PNG and JPEG out, 8 bits a channel. The size in the header is checked before anything
// is allocated (image_limit.hpp); a file that cannot be decoded whole is an Error, never a partly grey image. Cost: ~20
// ns a pixel to read PNG, ~100 ns to write it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
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
#include "compmark/io/image_limit.hpp"

namespace compmark {

/// Information in the header of an image file.
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

namespace detail {

/// True for a PNG whose header asks for more than image_pixel_limit pixels.
[[nodiscard]] inline bool promises_too_much(std::span<const std::byte> bytes) {
  constexpr std::size_t size_field = 16;
  if (bytes.size() < size_field + 8 || !is_png(bytes)) return false;
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
inline Error damaged_image(const std::string& name, const std::string& how) {
  return image_error(ErrorKind::malformed, name, "the image is damaged (" + how + ")",
                     "copy it again, or leave it out");
}
}  // namespace detail

/// Size and channels from the header of an encoded image in memory; `name` is for the message.
[[nodiscard]] inline Result<ImageInfo> decode_image_info(std::span<const std::byte> bytes, const std::string& name) {
  ImageInfo info;
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  if (bytes.empty())
    return detail::image_error(ErrorKind::truncated, name, "the image file is empty", "copy it again, or leave it out");
  if (const char* damage = detail::jpeg_damage(bytes, true); damage != nullptr)
    return detail::damaged_image(name, damage);
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
  if (const int plain = detail::png_plain_channels(bytes); plain != 0) info.channels = plain;
  info.orientation = jpeg_orientation(bytes);
  return info;
}

namespace detail {
/// Checks that an image may be decoded: its file is long enough for its header, the memory suffices, and it has none of
/// the errors that stb does not find.
[[nodiscard]] inline Result<Done> check_image(std::span<const std::byte> bytes, const ImageInfo& info,
                                              const std::string& name, std::uint64_t memory_limit) {
  const auto count = [](int n) { return static_cast<std::uint64_t>(n); };
  const std::uint64_t pixels = count(info.width) * count(info.height);
  const std::string size = std::to_string(info.width) + " x " + std::to_string(info.height) + " pixels";
  if (const std::uint64_t least = least_file_bytes(bytes, pixels); bytes.size() < least) {
    return image_error(ErrorKind::truncated, name,
                       "says that it has " + size + ", for which a file has " + std::to_string(least) +
                           " bytes at least; this one has " + std::to_string(bytes.size()),
                       "copy it again, or leave it out");
  }
  const std::uint64_t memory = decoding_bytes(bytes, pixels, count(info.channels), count(info.bits));
  if (memory > memory_limit) {
    return image_error(ErrorKind::exhausted, name,
                       "has " + size + ", which take " + std::to_string((memory >> 20) + 1) +
                           " MiB to decode; the limit is " + std::to_string(memory_limit >> 20),
                       "scale it down or raise the limit");
  }
  if (const char* damage = is_png(bytes) ? png_damage(bytes) : jpeg_damage(bytes); damage != nullptr)
    return damaged_image(name, damage);
  return Done{};
}
}  // namespace detail

/// Decodes a PNG or JPEG in memory. 16-bit channels are reduced to 8. One that takes more than `memory_limit` bytes, or
/// whose header promises more pixels than a file of its length can hold, is an Error before any are taken.
[[nodiscard]] inline Result<ImageBytes> decode_image(std::span<const std::byte> bytes, const std::string& name,
                                                     std::uint64_t memory_limit = image_memory_limit) {
  const Result<ImageInfo> info = decode_image_info(bytes, name);
  if (!info) return info.error();
  if (const Result<Done> fits = detail::check_image(bytes, *info, name, memory_limit); !fits) return fits.error();
  const std::vector<std::byte> palette = detail::with_whole_palette(bytes);
  if (!palette.empty()) bytes = palette;
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
        "copy it again, or leave it out");
  }
  ImageBytes image{width, height, channels, {}};
  const std::size_t count =
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * static_cast<std::size_t>(channels);
  image.pixels.assign(pixels.get(), pixels.get() + count);
  return image;
}

/// The bytes of an image file, encoded; a file of another kind is not read whole.
[[nodiscard]] inline Result<std::vector<std::byte>> read_image_bytes(const std::filesystem::path& path) {
  return read_file_of(path, image_file_limit, detail::image_kinds, [](FileKind kind, std::span<const std::byte>) {
    return kind == FileKind::png || kind == FileKind::jpeg;
  });
}

/// Size and channels of a file. Reads the whole file: on a warm disk cache ~0.1 ms a megabyte.
[[nodiscard]] inline Result<ImageInfo> read_image_info(const std::filesystem::path& path) {
  const Result<std::vector<std::byte>> bytes = read_image_bytes(path);
  if (!bytes) return bytes.error();
  return decode_image_info(*bytes, path.string());
}

[[nodiscard]] inline Result<ImageBytes> read_image(const std::filesystem::path& path,
                                                   std::uint64_t memory_limit = image_memory_limit) {
  const Result<std::vector<std::byte>> bytes = read_image_bytes(path);
  if (!bytes) return bytes.error();
  return decode_image(*bytes, path.string(), memory_limit);
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
struct FreePng {
  void operator()(unsigned char* bytes) const { std::free(bytes); }
};
/// The file as stb has it, with its number of bytes; null without memory.
[[nodiscard]] inline std::unique_ptr<unsigned char, FreePng> png_of(const ImageBytes& image, int& size) {
  COMPMARK_ASSERT(image.width > 0 && image.height > 0 && image.channels >= 1 && image.channels <= 4,
                  "encode_png: empty image");
  return std::unique_ptr<unsigned char, FreePng>(stb::stbi_write_png_to_mem(
      image.pixels.data(), image.width * image.channels, image.width, image.height, image.channels, &size));
}
}  // namespace detail

/// PNG file of an image of 1 to 4 channels, lossless.
[[nodiscard]] inline std::vector<std::byte> encode_png(const ImageBytes& image) {
  int size = 0;
  std::vector<std::byte> bytes;
  if (const std::unique_ptr<unsigned char, detail::FreePng> png = detail::png_of(image, size); png)
    detail::append_bytes(&bytes, png.get(), size);
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
  int size = 0;
  const std::unique_ptr<unsigned char, detail::FreePng> png = detail::png_of(image, size);
  if (!png) return Error{ErrorKind::exhausted, path, {}, "is not written: no memory for it", "write a smaller image"};
  return write_file(path, std::as_bytes(std::span<const unsigned char>(png.get(), static_cast<std::size_t>(size))));
}
[[nodiscard]] inline Result<Done> write_png(const std::filesystem::path& path, ImageView<const float> image) {
  return write_png(path, to_bytes(image));
}

}  // namespace compmark
