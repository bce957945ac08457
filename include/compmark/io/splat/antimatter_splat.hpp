// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The .splat file of antimatter15's viewer (docs/splat_formats.md): 32 bytes a splat and nothing else, little-endian:
//   x y z, scale x y z (floats; the scales are lengths), r g b a (bytes), w x y z (bytes, 128 + 128 q)
// The colour is what is seen without further harmonics, a the opacity. It begins with no sign, so that only its length
// and its numbers tell it from other files.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "compmark/io/bytes.hpp"
#include "compmark/io/splat/splat_file.hpp"

namespace compmark {

inline constexpr std::size_t antimatter_splat_bytes = 32;

namespace detail {

struct AntimatterSplat {
  std::array<float, 3> mean{}, scale{};
  std::array<std::uint8_t, 4> rgba{}, rotation{};
};
[[nodiscard]] inline AntimatterSplat antimatter_splat(std::span<const std::byte> bytes) {
  ByteReader reader(bytes);
  AntimatterSplat splat;
  for (float& x : splat.mean) x = reader.get<float>();
  for (float& x : splat.scale) x = reader.get<float>();
  for (std::uint8_t& x : splat.rgba) x = reader.get<std::uint8_t>();
  for (std::uint8_t& x : splat.rotation) x = reader.get<std::uint8_t>();
  return splat;
}

}  // namespace detail

/// Places and lengths from here on are no sign of the format: random numbers have them, scenes do not.
inline constexpr float antimatter_recognised = 1e9f;

/// Whether bytes without any sign of a format are such a file: whole splats, and the first thousand of them have places
/// and lengths below antimatter_recognised, lengths of at least 0 and rotations of norm 1 to the rounding of their
/// bytes. Of 32 random bytes one in a thousand passes. A limit, not a law of the format: a file of larger numbers is
/// read where its name ends in .splat, as the writer's does (read_splat).
[[nodiscard]] inline bool looks_like_antimatter_splat(std::span<const std::byte> bytes) {
  if (bytes.empty() || bytes.size() % antimatter_splat_bytes != 0) return false;
  const std::size_t count = std::min<std::size_t>(1000, bytes.size() / antimatter_splat_bytes);
  for (std::size_t i = 0; i < count; ++i) {
    const detail::AntimatterSplat splat =
        detail::antimatter_splat(bytes.subspan(i * antimatter_splat_bytes, antimatter_splat_bytes));
    double square = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const double q = (static_cast<double>(splat.rotation[k]) - 128) / 128;
      square += q * q;
    }
    if (std::abs(std::sqrt(square) - 1) > 0.03) return false;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!(std::abs(splat.mean[axis]) < antimatter_recognised) || !(splat.scale[axis] >= 0) ||
          !(splat.scale[axis] < antimatter_recognised))
        return false;
    }
  }
  return true;
}

/// Reads a whole file; `name` is for the messages. Cost: a pass over the bytes.
[[nodiscard]] inline Result<SplatTable> parse_antimatter_splat(std::span<const std::byte> bytes,
                                                               const std::string& name) {
  if (bytes.empty()) return detail::splat_error(ErrorKind::truncated, name, "byte 0", "holds no splat");
  if (bytes.size() % antimatter_splat_bytes != 0) {
    return detail::splat_error(ErrorKind::truncated, name, "size",
                               "is " + std::to_string(bytes.size()) + " bytes, no multiple of the 32 of a splat");
  }
  SplatTable table;
  table.resize(bytes.size() / antimatter_splat_bytes, 0);
  const std::array<float, 256> logit = detail::byte_logits();
  for (std::size_t i = 0; i < table.count; ++i) {
    const detail::AntimatterSplat splat =
        detail::antimatter_splat(bytes.subspan(i * antimatter_splat_bytes, antimatter_splat_bytes));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      table.mean[axis][i] = splat.mean[axis];
      table.log_scale[axis][i] = std::log(splat.scale[axis]);  // NaN of a negative length is refused below
      table.color(axis, 0)[i] = detail::dc_of_color(static_cast<double>(splat.rgba[axis]) / 255);
    }
    table.opacity[i] = logit[splat.rgba[3]];
    for (std::size_t k = 0; k < 4; ++k) table.rotation[k][i] = (static_cast<float>(splat.rotation[k]) - 128) / 128;
  }
  if (const Result<Done> usable = detail::finish_splats(table, name); !usable) return usable.error();
  return table;
}

}  // namespace compmark
