// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the bytes of a PNG or JPEG can hold, and what decoding them takes, from headers alone: a small file that
// promises a large image is refused before memory is taken for it, and a JPEG is looked through for what stb_image
// believes or leaves as it found it. Cost: PNG none, JPEG one pass.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace compmark {

/// Larger images are refused: a header of a few bytes must not make us allocate gigabytes.
inline constexpr std::int64_t image_pixel_limit = std::int64_t{1} << 28;
inline constexpr std::uintmax_t image_file_limit = std::uintmax_t{1} << 31;
/// Bytes that decoding may take, unless a caller says less: enough for any image of image_pixel_limit that stb_image
/// takes.
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

/// The fewest bytes that a file of so many pixels has. PNG: deflate makes at most 1032 bytes of one (a copy of 258
/// bytes is two bits). JPEG: every block of 64 samples is one bit at least. With samplings up to 4 x 4 the least is 9
/// blocks for 1024 pixels (4 x 1, 1 x 4 and 1 x 1), 910 pixels a byte; 1024 are allowed.
[[nodiscard]] inline std::uint64_t least_file_bytes(std::span<const std::byte> bytes, std::uint64_t pixels) {
  if (is_png(bytes)) return pixels * png_pixel_bits(bytes) / 8 / 1032;
  return pixels / 1024;
}
/// The most bytes that decoding takes beside the file: the packed rows of a PNG, or three bytes a sample of a JPEG (a
/// progressive one keeps its coefficients), then twice the image of `channels` of `bits` (it is converted, and copied
/// out of stb_image's hands).
[[nodiscard]] inline std::uint64_t decoding_bytes(std::span<const std::byte> bytes, std::uint64_t pixels,
                                                  std::uint64_t channels, std::uint64_t bits) {
  const std::uint64_t image = pixels * channels * bits / 8;
  if (is_png(bytes)) return 2 * bytes.size() + pixels * png_pixel_bits(bytes) / 8 + 2 * image;
  return pixels * 3 * std::max<std::uint64_t>(channels, 3) + 2 * image;
}

/// The error of a PNG that stb_image does not find, or nullptr: stb takes as much memory as a chunk claims to have.
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

/// The channels that decoding a PNG of grey or RGB pixels gives, with one for alpha where a tRNS chunk names a colour
/// that is transparent; 0 for other files. Some releases of stb do not count that one from the header.
[[nodiscard]] inline int png_plain_channels(std::span<const std::byte> bytes) {
  int channels = 0;
  if (!is_png(bytes)) return 0;
  for (std::size_t at = 8; bytes.size() >= at + 8;) {
    std::uint64_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = 256 * length + std::to_integer<unsigned>(bytes[at + i]);
    const auto is = [&](const char* chunk) { return std::memcmp(bytes.data() + at + 4, chunk, 4) == 0; };
    if (is("IDAT") || is("IEND") || length > bytes.size() - at - 8) break;
    if (is("IHDR") && length > 9) {
      const int type = std::to_integer<int>(bytes[at + 17]);
      channels = type == 0 ? 1 : type == 2 ? 3 : 0;
    }
    if (is("tRNS")) return channels == 0 ? 0 : channels + 1;
    at += 12 + static_cast<std::size_t>(length);
  }
  return channels;
}

/// A PNG whose palette has all of its 256 colours, those that it lacks black; empty where nothing is to be done. stb
/// takes what a pixel names beyond the palette from the stack.
[[nodiscard]] inline std::vector<std::byte> with_whole_palette(std::span<const std::byte> bytes) {
  constexpr std::size_t type = 25, whole = 3 * 256;
  if (!is_png(bytes) || bytes.size() <= type || bytes[type] != std::byte{3} || png_damage(bytes) != nullptr ||
      bytes.size() > image_file_limit - 2 * whole)
    return {};
  for (std::size_t at = 8; bytes.size() >= at + 8;) {
    std::size_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = 256 * length + std::to_integer<std::size_t>(bytes[at + i]);
    if (std::memcmp(bytes.data() + at + 4, "PLTE", 4) == 0) {
      if (length >= whole || length % 3 != 0) return {};
      std::vector<std::byte> file(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(at + 8 + length));
      file[at + 2] = std::byte{whole >> 8};
      file[at + 3] = std::byte{whole & 255u};
      file.resize(at + 8 + whole);
      file.insert(file.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at + 8 + length), bytes.end());
      return file;
    }
    if (std::memcmp(bytes.data() + at + 4, "IDAT", 4) == 0 || std::memcmp(bytes.data() + at + 4, "IEND", 4) == 0) break;
    at += 12 + length;
  }
  return {};
}

/// The tables of a JPEG so far, as far as a scan needs them: without this check stb_image decodes with missing tables,
/// from uninitialised memory.
class JpegTables {
 public:
  /// Each takes the contents of a segment, from `begin` to `end`; two of them return the error, or nullptr.
  const char* huffman(std::span<const std::byte> bytes, std::size_t begin, std::size_t end) {
    // stb before its release 2.29 writes past its tables otherwise; behind the file's end it reads zeros.
    for (std::size_t table = begin; table < end;) {
      unsigned codes = 0;
      for (std::size_t k = table + 1; k <= table + 16 && k < bytes.size(); ++k) codes += at(bytes, k);
      if (codes > 256) return "an oversized Huffman table";
      const unsigned name = at(bytes, table);
      if (name < 32 && name % 16 < 4) coded_[name / 16][name % 16] = true;
      table += 17 + codes;
    }
    return nullptr;
  }
  void quantisation(std::span<const std::byte> bytes, std::size_t begin, std::size_t end) {
    for (std::size_t table = begin; table < end;) {
      const unsigned name = at(bytes, table);
      if (name % 16 < 4) quantised_[name % 16] = true;
      table += name < 16 ? 65 : 129;
    }
  }
  void frame(std::span<const std::byte> bytes, std::size_t begin, std::size_t end, bool progressive) {
    if (begin + 6 > end) return;  // what stb refuses itself, here and below
    progressive_ = progressive;
    height_ = 256 * at(bytes, begin + 1) + at(bytes, begin + 2);
    width_ = 256 * at(bytes, begin + 3) + at(bytes, begin + 4);
    for (std::size_t c = 0, entry = begin + 6; c < at(bytes, begin + 5) && entry + 2 < end; ++c, entry += 3) {
      Component& component = components_[at(bytes, entry)];
      component = {true, false, at(bytes, entry + 1) / 16, at(bytes, entry + 1) % 16, at(bytes, entry + 2)};
      widest_ = std::max(widest_, component.across);
      tallest_ = std::max(tallest_, component.down);
    }
  }
  const char* scan(std::span<const std::byte> bytes, std::size_t begin, std::size_t end) {
    restarts_wanted_ = 0;
    if (begin >= end) return nullptr;
    const std::size_t count = at(bytes, begin), behind = begin + 1 + 2 * count;
    if (behind + 3 > end) return nullptr;
    // The first scan of a component begins with coefficient 0 and all of its high bits; others of a progressive file
    // add to it.
    const bool constant = at(bytes, behind) == 0, first = constant && at(bytes, behind + 2) < 16;
    for (std::size_t entry = begin + 1; entry < behind; entry += 2) {
      Component& component = components_[at(bytes, entry)];
      const unsigned tables = at(bytes, entry + 1);
      if (!component.known || tables / 16 > 3 || tables % 16 > 3 || component.table > 3) return nullptr;
      if ((!progressive_ || first) && !coded_[0][tables / 16]) return "a Huffman table that is missing";
      if ((!progressive_ || !constant) && !coded_[1][tables % 16]) return "a Huffman table that is missing";
      if (!quantised_[component.table]) return "a quantisation table that is missing";
      component.scanned = component.scanned || first;
    }
    const std::uint64_t units = count == 1 ? units_of(components_[at(bytes, begin + 1)]) : units_of_all();
    if (interval != 0 && units != 0) restarts_wanted_ = (units - 1) / interval;
    return nullptr;
  }
  /// `restarts`: that the last scan had.
  [[nodiscard]] const char* scan_end(std::uint64_t restarts) const {
    return restarts < restarts_wanted_ ? "data that end early" : nullptr;
  }
  [[nodiscard]] const char* end() const {
    const bool all = std::all_of(components_.begin(), components_.end(),
                                 [](const Component& component) { return !component.known || component.scanned; });
    return all ? nullptr : "a component without data";
  }

  std::uint64_t interval = 0;  ///< units between restarts

 private:
  struct Component {
    bool known = false, scanned = false;
    unsigned across = 0, down = 0, table = 0;
  };
  static unsigned at(std::span<const std::byte> bytes, std::size_t i) {
    return i < bytes.size() ? std::to_integer<unsigned>(bytes[i]) : 0u;
  }
  [[nodiscard]] static std::uint64_t parts(std::uint64_t n, std::uint64_t size) { return (n + size - 1) / size; }
  [[nodiscard]] std::uint64_t units_of_all() const { return parts(width_, 8 * widest_) * parts(height_, 8 * tallest_); }
  [[nodiscard]] std::uint64_t units_of(const Component& c) const {
    return parts(parts(std::uint64_t{width_} * c.across, widest_), 8) *
           parts(parts(std::uint64_t{height_} * c.down, tallest_), 8);
  }

  unsigned width_ = 0, height_ = 0, widest_ = 1, tallest_ = 1;
  bool progressive_ = false;
  std::array<std::array<bool, 4>, 2> coded_{};  ///< of constants, of the other coefficients
  std::array<bool, 4> quantised_{};
  std::array<Component, 256> components_{};  ///< by their numbers
  std::uint64_t restarts_wanted_ = 0;        ///< of the last scan
};

/// The error of a JPEG (`header_only`: up to its size) that stb_image does not find, or nullptr. Segments are walked as
/// stb walks them; other errors are left for stb to refuse.
[[nodiscard]] inline const char* jpeg_damage(std::span<const std::byte> bytes, bool header_only = false) {
  const auto at = [&](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
  if (bytes.size() < 2 || at(0) != 0xFF) return nullptr;  // no JPEG; fill bytes may come first
  JpegTables tables;
  std::uint64_t restarts = 0;
  for (std::size_t i = 0; i + 3 < bytes.size();) {
    const unsigned marker = at(i) == 0xFF ? at(i + 1) : 0xFF;
    if (marker == 0xFF) {  // data, or a fill byte
      ++i;
      continue;
    }
    if (marker < 0xC0 || (marker >= 0xD0 && marker <= 0xD8)) {  // a stuffed byte, a restart, the start: no contents
      restarts += marker >= 0xD0 && marker <= 0xD7 ? 1 : 0;
      i += 2;
      continue;
    }
    if (const char* damage = tables.scan_end(restarts); damage != nullptr) return damage;
    if (marker == 0xD9) return tables.end();
    const std::size_t begin = i + 4, end = i + 2 + 256 * at(i + 2) + at(i + 3);
    const std::size_t inside = std::min(end, bytes.size());
    const bool frame = marker >= 0xC0 && marker <= 0xC2;
    if (frame && header_only) return nullptr;
    const char* damage = nullptr;
    if (marker == 0xC4) damage = tables.huffman(bytes, begin, inside);
    if (marker == 0xDB) tables.quantisation(bytes, begin, inside);
    if (marker == 0xDD && begin + 2 <= inside) tables.interval = 256 * at(begin) + at(begin + 1);
    if (frame) tables.frame(bytes, begin, inside, marker == 0xC2);
    if (marker == 0xDA) {
      damage = tables.scan(bytes, begin, inside);
      restarts = 0;
    }
    if (damage != nullptr) return damage;
    i = end;
  }
  const char* damage = tables.scan_end(restarts);
  return damage != nullptr || header_only ? damage : tables.end();
}

}  // namespace detail

}  // namespace compmark
