// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writes SPZ files of Niantic, version 4 (Zstandard) or 3 (gzip), in their own frame: right, up, back (layout in
// spz.hpp). A position has 24 bits, signed: the bits behind its point are 12, or as many as the scene leaves. Harmonics
// keep 5 bits of degree 1 and 4 of the others unless told otherwise, as the reference writer has it. Cost: packing, and
// a pass over the values.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "compmark/io/bytes.hpp"
#include "compmark/io/splat/deflate.hpp"
#include "compmark/io/splat/splat_rounding.hpp"

namespace compmark {

namespace detail {

class SpzEncoder {
 public:
  SpzEncoder(const SplatTable& table, const SplatWriteSettings& settings, std::string name)
      : table_(table),
        settings_(settings),
        name_(std::move(name)) {}

  [[nodiscard]] Result<EncodedSplats> encode() {
    version_ = settings_.spz_version != 0 ? settings_.spz_version : reads_zstd ? 4 : 3;
    if (version_ != 3 && version_ != 4)
      return error(ErrorKind::invalid, "version", "is " + std::to_string(version_) + ", not 3 or 4", "write 3 or 4");
    for (const int bits : settings_.spz_harmonic_bits) {
      if (bits < 1 || bits > 8)
        return error(ErrorKind::invalid, "harmonic bits", "are " + std::to_string(bits), "keep 1 to 8 of them");
    }
    if (table_.count > std::uint64_t{0xffffffff})
      return error(ErrorKind::exhausted, "points", "are more than 4,294,967,295", "export a PLY");
    const Result<int> bits = choose_bits();
    if (!bits) return bits.error();
    bits_ = *bits;
    for (std::size_t row = 0; row < table_.count; ++row) put_row(row);

    EncodedSplats encoded;
    encoded.version = version_;
    encoded.fractional_bits = bits_;
    held_scales_.tell("log scales", "-10 to 5.94", encoded.notes);
    held_colors_.tell("coefficients of the colour", "-3.33 to 3.33", encoded.notes);
    held_harmonics_.tell("harmonics", "-1 to 0.99", encoded.notes);
    Result<std::vector<std::byte>> bytes = version_ == 4 ? frames() : blocks();
    if (!bytes) return bytes.error();
    encoded.bytes = std::move(*bytes);
    return encoded;
  }

 private:
  static constexpr std::size_t streams = 6;
  enum Stream : std::size_t { positions, alphas, colors, scales, rotations, harmonics };

  [[nodiscard]] Error error(ErrorKind kind, std::string field, std::string problem, std::string remedy) const {
    return splat_error(kind, name_, std::move(field), std::move(problem), std::move(remedy));
  }

  /// The bits behind the point: those that are asked for, or the most up to 12 with which every place fits.
  [[nodiscard]] Result<int> choose_bits() const {
    double farthest = 0;
    for (const std::vector<float>& column : table_.mean) {
      for (const float x : column) farthest = std::max(farthest, std::abs(static_cast<double>(x)));
    }
    constexpr double most = (1 << 23) - 1;
    const auto fits = [&](int bits) { return std::round(std::ldexp(farthest, bits)) <= most; };
    constexpr int usual = 12, limit = 23;
    int bits = settings_.fractional_bits.value_or(usual);
    if (bits < 0 || bits > limit)
      return error(ErrorKind::invalid, "fractional bits", "are " + std::to_string(bits), "give 0 to 23");
    while (!settings_.fractional_bits && bits > 0 && !fits(bits)) --bits;
    if (fits(bits)) return bits;
    return error(ErrorKind::invalid, "positions",
                 "reach " + std::to_string(farthest) + ", and 24 bits with " + std::to_string(bits) +
                     " behind the point end at " + std::to_string(std::ldexp(most, -bits)),
                 settings_.fractional_bits ? "ask for fewer fractional bits, or leave them to the program"
                                           : "remove splats that are so far away, or export a PLY");
  }

  void put_row(std::size_t row) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = static_cast<double>(signs_.mean[axis]) * static_cast<double>(table_.mean[axis][row]);
      const std::int32_t fixed = static_cast<std::int32_t>(std::round(std::ldexp(x, bits_)));
      for (int shift = 0; shift < 24; shift += 8)
        out_[positions].put(static_cast<std::uint8_t>(static_cast<std::uint32_t>(fixed) >> shift & 255u));
      const double color = held_colors_(static_cast<double>(table_.color(axis, 0)[row]), -0.5 / 0.15, 0.5 / 0.15);
      out_[colors].put(nearest_byte(127.5 + 255 * 0.15 * color));
      const double scale = held_scales_(static_cast<double>(table_.log_scale[axis][row]), -10, 255.0 / 16 - 10);
      out_[scales].put(nearest_byte(16 * (scale + 10)));
    }
    out_[alphas].put(nearest_byte(255 * opacity_of_logit(table_.opacity[row])));
    for (std::size_t k = 1; k < table_.coefficients(); ++k) {
      for (std::size_t channel = 0; channel < 3; ++channel) put_harmonic(k, table_.color(channel, k)[row]);
    }
    std::array<double, 4> xyzw{};
    const std::array<double, 4> wxyz = unit_rotation(table_, row);
    for (std::size_t k = 0; k < 4; ++k) xyzw[(k + 3) % 4] = static_cast<double>(signs_.rotation[k]) * wxyz[k];
    const ThreeOfRotation three = three_of_rotation(xyzw);
    std::uint32_t word = static_cast<std::uint32_t>(three.largest);
    for (const double x : three.others)
      word = word << 10 | (x < 0 ? 512u : 0u) | nearest_step(std::abs(x), 0, std::sqrt(0.5), 9);
    out_[rotations].put(word);
  }

  void put_harmonic(std::size_t k, float value) {
    const int bits = settings_.spz_harmonic_bits[k < 4 ? 0 : 1];
    const double x = static_cast<double>(signs_.harmonics[k]) * static_cast<double>(value);
    const double inside = held_harmonics_(x, -1, 127.0 / 128), step = std::ldexp(1.0, 8 - bits);
    out_[harmonics].put(nearest_byte(std::min(128 + std::round(128 * inside / step) * step, 256 - step)));
  }

  [[nodiscard]] ByteWriter header(int stream_count) const {
    ByteWriter out;
    out.put(std::string_view("NGSP")).put(static_cast<std::uint32_t>(version_));
    out.put(static_cast<std::uint32_t>(table_.count));
    for (const int value : {table_.degree, bits_, settings_.antialiased ? 1 : 0, stream_count})
      out.put(static_cast<std::uint8_t>(value));
    return out;
  }
  /// Version 3: header and blocks, packed as one.
  [[nodiscard]] Result<std::vector<std::byte>> blocks() {
    ByteWriter content = header(0);
    for (const ByteWriter& stream : out_) content.put(stream.bytes());
    return gzipped(content.bytes(), name_);
  }
  /// Version 4: the header of 32 bytes, the table of sizes, and a frame a quantity; harmonics of degree 0 have none.
  [[nodiscard]] Result<std::vector<std::byte>> frames() {
    const std::size_t count = table_.degree == 0 ? streams - 1 : streams;
    ByteWriter out = header(static_cast<int>(count)), packed;
    out.put(std::uint32_t{32});
    for (int i = 0; i < 3; ++i) out.put(std::uint32_t{0});
    for (std::size_t i = 0; i < count; ++i) {
      const Result<std::vector<std::byte>> frame = zstandard(out_[i].bytes(), name_);
      if (!frame) return frame.error();
      out.put(std::uint64_t{frame->size()}).put(std::uint64_t{out_[i].size()});
      packed.put(*frame);
    }
    out.put(packed.bytes());
    return out.take();
  }

  const SplatTable& table_;
  const SplatWriteSettings& settings_;
  std::string name_;
  int version_ = 0, bits_ = 0;
  SplatSigns signs_ = splat_signs({1, -1, -1});  ///< of right, up, back
  std::array<ByteWriter, streams> out_;
  HeldNumbers held_scales_, held_colors_, held_harmonics_;
};

}  // namespace detail

/// A table whose numbers were checked (detail::check_splats) as a file; `name` is for the messages. Error: a place that
/// 24 bits do not hold, a version that this program does not write.
[[nodiscard]] inline Result<EncodedSplats> spz_bytes_of(const SplatTable& table, const SplatWriteSettings& settings,
                                                        const std::string& name) {
  return detail::SpzEncoder(table, settings, name).encode();
}

}  // namespace compmark
