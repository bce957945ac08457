// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The functions of app/picture.hpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/detail/files.hpp"
#include "compmark/app/picture.hpp"
#include "compmark/io/image_file.hpp"
#include "compmark/io/sha256.hpp"
#include "compmark/math/mirror.hpp"
#include "compmark/scene/image.hpp"
#include "compmark/scene/turn.hpp"
#include "compmark/watermark/decoder/page_box.hpp"

namespace compmark {
namespace detail {

/// Of an image while it is read, at most: its floats, their blurs and what is read at each position.
inline constexpr std::uint64_t read_bytes_a_pixel = 56;

/// The planes as floats, of the picture alone where they are a page. A large image is never held in two forms longer
/// than needed: the file, its pixels, their planes and the floats are 20 bytes a pixel together, the floats alone 12.
[[nodiscard]] inline OpenPicture without_page(const std::vector<std::uint8_t>& planes, const PictureSettings& settings,
                                              OpenPicture picture) {
  picture.planes.resize(planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) picture.planes[i] = static_cast<float>(planes[i]) / 255.0f;
  if (settings.pages) {
    const PictureBox part = page_box(picture.image());
    if (part.height != picture.height || part.width != picture.width) {
      picture = part_of(picture, part);
      picture.part = part;
    }
  }
  if (settings.mirrored) mirror_rows(ImageView<float>{picture.planes.data(), 3, picture.height, picture.width});
  return picture;
}

}  // namespace detail

COMPMARK_APP_INLINE OpenPicture part_of(const OpenPicture& picture, const PictureBox& box) {
  OpenPicture part{{}, box.width, box.height, picture.sha256, picture.part};
  part.planes.reserve(3 * static_cast<std::size_t>(box.width) * static_cast<std::size_t>(box.height));
  for (int c = 0; c < 3; ++c) {
    for (int y = box.top; y < box.top + box.height; ++y) {
      const auto row = picture.planes.begin() + (static_cast<std::ptrdiff_t>(c) * picture.height + y) * picture.width;
      part.planes.insert(part.planes.end(), row + box.left, row + box.left + box.width);
    }
  }
  return part;
}

COMPMARK_APP_INLINE Result<OpenPicture> open_picture(const std::filesystem::path& path,
                                                     const PictureSettings& settings) {
  OpenPicture picture;
  std::vector<std::uint8_t> planes;
  {
    Result<std::vector<std::byte>> bytes = read_image_bytes(path);
    if (!bytes) return bytes.error();
    const Result<ImageInfo> info = decode_image_info(*bytes, path.string());
    if (!info) return info.error();
    if (Result<Done> fits = check_image_memory(*info, path, detail::read_bytes_a_pixel, settings.memory_budget_mb);
        !fits)
      return fits.error();
    picture.sha256 = Sha256{}.update(*bytes).hex();
    Result<ImageBytes> image = decode_image(*bytes, path.string());
    if (!image) return image.error();
    std::vector<std::byte>().swap(*bytes);  // an assignment would keep the memory
    *image = turned(std::move(*image), info->orientation);
    picture.width = image->width;
    picture.height = image->height;
    planes.resize(3 * static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
    composite(image->pixels, image->channels, settings.background, AlphaRounding::nearest, planes);
  }
  return detail::without_page(planes, settings, std::move(picture));
}

COMPMARK_APP_INLINE Result<OpenPicture> open_picture(const GivenPicture& given, const PictureSettings& settings) {
  const bool sized = given.width > 0 && given.height > 0 && given.channels >= 1 && given.channels <= 4;
  const std::uint64_t pixels =
      sized ? static_cast<std::uint64_t>(given.width) * static_cast<std::uint64_t>(given.height) : 0;
  if (!sized || given.pixels.size() != pixels * static_cast<std::uint64_t>(given.channels)) {
    return Error{ErrorKind::invalid, given.name, "picture", "has not as many values as its sides and channels say",
                 "give height * width * channels values of 8 bits, of 1 to 4 channels"};
  }
  const ImageInfo info{given.width, given.height, given.channels, 8, 1};
  if (Result<Done> fits = check_image_memory(info, given.name, detail::read_bytes_a_pixel, settings.memory_budget_mb);
      !fits)
    return fits.error();
  OpenPicture picture;
  picture.width = given.width;
  picture.height = given.height;
  picture.sha256 = Sha256{}.update(std::as_bytes(given.pixels)).hex();
  std::vector<std::uint8_t> planes(3 * pixels);
  composite(given.pixels, given.channels, settings.background, AlphaRounding::nearest, planes);
  return detail::without_page(planes, settings, std::move(picture));
}

}  // namespace compmark
