// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The orientation a camera wrote into a JPEG (Exif 2.32, tag 0x0112): how the stored rows and columns are to be turned
// for viewing.
//   1 as stored  2 mirrored  3 upside down  4 mirrored upside down  5 … 8 the same after exchanging rows and columns
// Every offset in the file is checked before it is followed; anything odd means 1. Cost: walks the segments before the
// picture.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "compmark/core/config.hpp"

namespace compmark {
namespace detail {

/// Orientation in a TIFF block (what follows "Exif\0\0"), 1 if there is none.
[[nodiscard]] inline int tiff_orientation(std::span<const std::byte> tiff) {
  if (tiff.size() < 8) return 1;
  const auto at = [&](std::size_t i) { return std::to_integer<std::uint32_t>(tiff[i]); };
  const bool little = at(0) == 'I' && at(1) == 'I';
  if (!little && !(at(0) == 'M' && at(1) == 'M')) return 1;
  const auto u16 = [&](std::size_t i) { return little ? at(i) | at(i + 1) << 8 : at(i) << 8 | at(i + 1); };
  const auto u32 = [&](std::size_t i) { return little ? u16(i) | u16(i + 2) << 16 : u16(i) << 16 | u16(i + 2); };
  const std::size_t directory = u32(4);
  if (directory < 8 || directory > tiff.size() || tiff.size() - directory < 2) return 1;
  const std::size_t entries = u16(directory);
  for (std::size_t i = 0, place = directory + 2; i < entries && tiff.size() - place >= 12; ++i, place += 12) {
    if (u16(place) != 0x0112) continue;
    const std::uint32_t value = u16(place + 8);
    return u16(place + 2) == 3 && value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

}  // namespace detail

/// Orientation of an encoded JPEG, 1 … 8; 1 for every other kind of file.
[[nodiscard]] inline int jpeg_orientation(std::span<const std::byte> bytes) {
  const auto at = [&](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
  if (bytes.size() < 4 || at(0) != 0xFF || at(1) != 0xD8) return 1;
  for (std::size_t i = 2; i + 4 <= bytes.size() && at(i) == 0xFF;) {
    const unsigned marker = at(i + 1);
    if (marker == 0xFF) {
      ++i;
      continue;
    }
    const std::size_t length = 256 * at(i + 2) + at(i + 3);
    if (marker == 0xDA || length < 2 || bytes.size() - i - 2 < length) return 1;
    const std::span<const std::byte> body = bytes.subspan(i + 4, length - 2);
    if (marker == 0xE1 && body.size() > 6 && std::memcmp(body.data(), "Exif\0", 6) == 0)
      return detail::tiff_orientation(body.subspan(6));
    i += 2 + length;
  }
  return 1;
}

}  // namespace compmark
