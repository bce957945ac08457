// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the bytes of a PNG or JPEG can hold, and what decoding them takes, from headers alone: a small file that promises a large image is refused
// before memory is taken for it, and a JPEG is looked through for what stb_image believes or leaves as it found it. Cost: PNG none, JPEG one pass.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace compmark::inline v0 {

/// Larger images are refused: a header of a few bytes must not make us allocate gigabytes.
inline constexpr std::int64_t image_pixel_limit = std::int64_t{1} << 28;
inline constexpr std::uintmax_t image_file_limit = std::uintmax_t{1} << 31;
/// Bytes that decoding may take, unless a caller says less: enough for any image of image_pixel_limit that stb_image takes.
inline constexpr std::uint64_t image_memory_limit = std::uint64_t{5} << 30;

namespace detail {

/// Bits of a pixel in a PNG's rows, from its header; 1, the least, where that does not come first.
[[nodiscard]] inline std::uint64_t png_pixel_bits(std::span<const std::byte> bytes) {
  constexpr std::size_t header = 12, depth = 24, type = 25;
  if (bytes.size() <= type || std::memcmp(bytes.data() + header, "IHDR", 4) != 0) return 1;
  constexpr std::array<std::uint64_t, 7> samples{1, 1, 3, 1, 2, 1, 4};
  const auto color = std::to_integer<std::size_t>(bytes[type]);
  return color < samples.size() ? samples[color] * std::to_integer<std::uint64_t>(bytes[depth]) : 1;
}
[[nodiscard]] inline bool is_png(std::span<const std::byte> bytes) {
  return bytes.size() >= 4 && std::memcmp(bytes.data(), "\x89PNG", 4) == 0;
}

/// The fewest bytes that a file of so many pixels has. PNG: deflate makes at most 1032 bytes of one (a copy of 258 bytes is two bits).
/// JPEG: every block of 64 samples is one bit at least. With samplings up to 4 x 4 the least is 9 blocks for 1024 pixels (4 x 1, 1 x 4 and 1 x 1),
/// 910 pixels a byte; 1024 are allowed.
[[nodiscard]] inline std::uint64_t least_file_bytes(std::span<const std::byte> bytes, std::uint64_t pixels) {
  if (is_png(bytes)) return pixels * png_pixel_bits(bytes) / 8 / 1032;
  return pixels / 1024;
}
/// The most bytes that decoding takes beside the file: the packed rows of a PNG, or three bytes a sample of a JPEG (a progressive one keeps its
/// coefficients), then twice the image of `channels` of `bits` (it is converted, and copied out of stb_image's hands).
[[nodiscard]] inline std::uint64_t decoding_bytes(std::span<const std::byte> bytes, std::uint64_t pixels,
                                                  std::uint64_t channels, std::uint64_t bits) {
  const std::uint64_t image = pixels * channels * bits / 8;
  if (is_png(bytes)) return 2 * bytes.size() + pixels * png_pixel_bits(bytes) / 8 + 2 * image;
  return pixels * 3 * std::max<std::uint64_t>(channels, 3) + 2 * image;
}

/// What is wrong with a PNG that stb_image would not say; nullptr if nothing is: stb takes as much memory as a chunk says that it has.
[[nodiscard]] inline const char* png_damage(std::span<const std::byte> bytes) {
  for (std::size_t at = 8; bytes.size() >= at + 8;) {
    std::uint64_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = 256 * length + std::to_integer<unsigned>(bytes[at + i]);
    if (std::memcmp(bytes.data() + at + 4, "IEND", 4) == 0) break;
    if (length > bytes.size() - at - 8) return "a chunk longer than the file";
    at += 12 + static_cast<std::size_t>(length);
  }
  return nullptr;
}

/// What a JPEG's header says of its samples, as far as it tells how many units each scan has.
struct JpegFrame {
  unsigned width = 0, height = 0, widest = 1, tallest = 1;
  std::array<std::array<unsigned, 2>, 256> sampling{};  ///< of the components by their numbers; 0: none

  /// Of a scan of all (component -1) or one of the components.
  [[nodiscard]] std::uint64_t units(int component) const {
    const auto ceil = [](std::uint64_t n, std::uint64_t d) { return (n + d - 1) / d; };
    if (component < 0) return ceil(width, 8 * widest) * ceil(height, 8 * tallest);
    const auto& [across, down] = sampling[static_cast<std::size_t>(component)];
    return ceil(ceil(std::uint64_t{width} * across, widest), 8) * ceil(ceil(std::uint64_t{height} * down, tallest), 8);
  }
};

/// What is wrong with a JPEG (`header_only`: as far as its size is told) that stb_image would not say; nullptr if nothing is. Of a component without a scan, and of what is behind a restart that is
/// missing, stb gives what lay in memory. Segments are walked as stb walks them; what is odd otherwise is left for stb to refuse.
[[nodiscard]] inline const char* jpeg_damage(std::span<const std::byte> bytes, bool header_only = false) {
  const auto at = [&](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
  if (bytes.size() < 2 || at(0) != 0xFF) return nullptr;  // no JPEG; fill bytes may come first
  JpegFrame frame;
  std::array<bool, 256> scanned{};
  std::uint64_t interval = 0, wanted = 0, restarts = 0;  // of the scan that is walked
  for (std::size_t i = 0; i + 3 < bytes.size();) {
    if (at(i) != 0xFF) {
      ++i;
      continue;
    }
    const unsigned marker = at(i + 1);
    if (marker == 0xFF) {
      ++i;
      continue;
    }
    if (marker < 0xC0 || (marker >= 0xD0 && marker <= 0xD8)) {  // a stuffed byte, a restart, the start: no contents
      if (marker >= 0xD0 && marker <= 0xD7) ++restarts;
      i += 2;
      continue;
    }
    if (restarts < wanted) return "data that end early";
    wanted = restarts = 0;
    if (marker == 0xD9) break;
    if (header_only && marker >= 0xC0 && marker <= 0xC2) return nullptr;
    const std::size_t end = i + 2 + 256 * at(i + 2) + at(i + 3);
    const std::size_t inside = std::min(end, bytes.size());
    if (marker == 0xC4) {
      // stb before its release 2.29 writes past its tables otherwise; behind the file's end it reads zeros.
      for (std::size_t table = i + 4; table < inside;) {
        unsigned codes = 0;
        for (std::size_t k = table + 1; k <= table + 16 && k < bytes.size(); ++k) codes += at(k);
        if (codes > 256) return "an oversized Huffman table";
        table += 17 + codes;
      }
    } else if (marker >= 0xC0 && marker <= 0xC2 && i + 10 <= inside) {
      frame.height = 256 * at(i + 5) + at(i + 6);
      frame.width = 256 * at(i + 7) + at(i + 8);
      for (std::size_t c = 0, entry = i + 10; c < at(i + 9) && entry + 1 < inside; ++c, entry += 3) {
        const std::array<unsigned, 2> sampling{at(entry + 1) >> 4, at(entry + 1) & 15u};
        if (sampling[0] == 0 || sampling[1] == 0) return nullptr;  // stb says so
        frame.sampling[at(entry)] = sampling;
        frame.widest = std::max(frame.widest, sampling[0]);
        frame.tallest = std::max(frame.tallest, sampling[1]);
      }
    } else if (marker == 0xDD && i + 6 <= inside) {
      interval = 256 * at(i + 4) + at(i + 5);
    } else if (marker == 0xDA && i + 5 <= inside) {
      const std::size_t list = i + 5, count = at(i + 4), behind = list + 2 * count;
      if (behind + 3 > inside) return nullptr;  // stb says so
      // The first scan of a component begins with coefficient 0 and all of its high bits; others add to it.
      const bool first = at(behind) == 0 && at(behind + 2) >> 4 == 0;
      for (std::size_t entry = list; first && entry < behind; entry += 2) scanned[at(entry)] = true;
      const std::uint64_t units = frame.units(count == 1 ? static_cast<int>(at(list)) : -1);
      if (interval != 0 && units != 0) wanted = (units - 1) / interval;
    }
    i = end;
  }
  if (restarts < wanted) return "data that end early";
  for (std::size_t c = 0; c < scanned.size(); ++c) {
    if (frame.sampling[c][0] != 0 && !scanned[c]) return "a component without data";
  }
  return nullptr;
}

}  // namespace detail

}  // namespace compmark::inline v0
