// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A picture that somebody found, as it is read: a file or pixels in memory, upright, opaque, and without the page that
// it stands on.
//   Result<OpenPicture> picture = open_picture("screenshot.png");
//   picture->image();                                                     // [3, height, width] in [0, 1]
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

/// A picture in memory: rows of 8-bit values [height, width, channels], grey, grey and alpha, RGB or RGBA. In reports
/// its SHA-256 is that of these bytes.
struct GivenPicture {
  std::string name;  ///< for the report
  int width = 0, height = 0, channels = 3;
  std::span<const std::uint8_t> pixels;
};

/// How a picture is read.
struct PictureSettings {
  std::array<float, 3> background{};  ///< behind transparent pixels: black, as models are drawn
  std::size_t memory_budget_mb = 1400;
  bool mirrored = false;  ///< it is mirrored, left for right, after the page is cut off
  bool pages = true;      ///< of an image that is a page, the picture on it is read (watermark/decoder/page_box.hpp)
};

struct OpenPicture {
  std::vector<float> planes;  ///< [3, height, width] in [0, 1]
  int width = 0, height = 0;
  std::string sha256;              ///< of the file, or of the pixels that were given
  std::optional<PictureBox> part;  ///< of the file's image, where it is the picture on a page

  [[nodiscard]] ImageView<const float> image() const { return {planes.data(), 3, height, width}; }
};
/// A part of it.
[[nodiscard]] OpenPicture part_of(const OpenPicture& picture, const PictureBox& box);

/// Reads an image file: 8 or 16 bits, grey, RGB, CMYK or a palette, turned upright as its EXIF entry says. An Error
/// names the file, and the memory that it would take. Cost: 20 bytes a pixel while it is read, 12 after; decoding, and
/// a few passes over the pixels to look for a page.
[[nodiscard]] Result<OpenPicture> open_picture(const std::filesystem::path& path, const PictureSettings& settings = {});
/// The same of pixels in memory.
[[nodiscard]] Result<OpenPicture> open_picture(const GivenPicture& given, const PictureSettings& settings = {});

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/picture.hpp"
#endif
