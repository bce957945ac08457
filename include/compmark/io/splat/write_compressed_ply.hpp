// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writes the compressed PLY of SuperSplat (docs/splat_formats.md; layout in compressed_ply.hpp): chunks of 256 splats
// with the ranges of their places, log scales and colours, 16 bytes a splat, and a byte a harmonic. Log scales are held
// within -20 and 20, harmonics within -4 and 4. Cost: a sort and a pass over the values.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/io/bytes.hpp"
#include "compmark/io/splat/splat_rounding.hpp"

namespace compmark {

namespace detail {

class CompressedPlyEncoder {
 public:
  CompressedPlyEncoder(const SplatTable& table, const SplatWriteSettings& settings)
      : table_(table),
        settings_(settings),
        order_(splat_order(table, settings.reorder)) {}

  [[nodiscard]] EncodedSplats encode() {
    header();
    for (std::size_t begin = 0; begin < table_.count; begin += chunk_rows) ranges(begin);
    for (std::size_t i = 0; i < table_.count; ++i) vertex(i);
    const std::size_t rest = table_.coefficients() - 1;
    for (const std::uint32_t row : order_) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        for (std::size_t k = 1; k <= rest; ++k) harmonic(table_.color(channel, k)[row]);
      }
    }
    EncodedSplats encoded;
    encoded.bytes = out_.take();
    held_scales_.tell("log scales", "-20 to 20", encoded.notes);
    held_harmonics_.tell("harmonics", "-4 to 4", encoded.notes);
    return encoded;
  }

 private:
  static constexpr std::size_t chunk_rows = 256, quantities = 3;
  enum Quantity : std::size_t { place, scale, color };

  void header() {
    const std::size_t rest = 3 * (table_.coefficients() - 1);
    std::string text = "ply\nformat binary_little_endian 1.0\n";
    for (const std::string& comment : settings_.comments) text += "comment " + comment + "\n";
    if (settings_.antialiased) text += "comment SplatRenderMode: mip\n";
    text += "element chunk " + std::to_string((table_.count + chunk_rows - 1) / chunk_rows) + "\n";
    for (const std::array<std::string_view, 2> names :
         {std::array<std::string_view, 2>{"", "xyz"}, {"scale_", "xyz"}, {"", "rgb"}}) {
      for (const char* side : {"min_", "max_"}) {
        for (const char component : names[1])
          text += "property float " + std::string(side) + std::string(names[0]) + component + "\n";
      }
    }
    text += "element vertex " + std::to_string(table_.count) + "\n";
    for (const char* name : {"position", "rotation", "scale", "color"})
      text += "property uint packed_" + std::string(name) + "\n";
    if (rest != 0) text += "element sh " + std::to_string(table_.count) + "\n";
    for (std::size_t i = 0; i < rest; ++i) text += "property uchar f_rest_" + std::to_string(i) + "\n";
    out_.put(std::string_view(text + "end_header\n"));
  }

  [[nodiscard]] double value(std::size_t quantity, std::size_t axis, std::size_t row) const {
    if (quantity == place) return static_cast<double>(table_.mean[axis][row]);
    if (quantity == scale) return std::clamp(static_cast<double>(table_.log_scale[axis][row]), -20.0, 20.0);
    return color_of_dc(table_.color(axis, 0)[row]);
  }

  void ranges(std::size_t begin) {
    const std::size_t end = std::min(table_.count, begin + chunk_rows);
    Range& range = ranges_.emplace_back();
    for (std::size_t quantity = 0; quantity < quantities; ++quantity) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        double low = value(quantity, axis, order_[begin]), high = low;
        for (std::size_t i = begin; i < end; ++i) {
          low = std::min(low, value(quantity, axis, order_[i]));
          high = std::max(high, value(quantity, axis, order_[i]));
        }
        range[quantity][axis] = {static_cast<float>(low), static_cast<float>(high)};
      }
      for (const std::size_t side : {0u, 1u}) {
        for (std::size_t axis = 0; axis < 3; ++axis) out_.put(range[quantity][axis][side]);
      }
    }
  }

  void vertex(std::size_t i) {
    const std::size_t row = order_[i];
    for (std::size_t axis = 0; axis < 3; ++axis)
      static_cast<void>(held_scales_(static_cast<double>(table_.log_scale[axis][row]), -20, 20));
    const auto part = [&](std::size_t quantity, std::size_t axis, int bits) {
      const std::array<float, 2>& of = ranges_[i / chunk_rows][quantity][axis];
      return nearest_step(value(quantity, axis, row), static_cast<double>(of[0]), static_cast<double>(of[1]), bits);
    };
    const auto three = [&](std::size_t quantity) {
      return part(quantity, 0, 11) << 21 | part(quantity, 1, 10) << 11 | part(quantity, 2, 11);
    };
    const ThreeOfRotation q = three_of_rotation(unit_rotation(table_, row));
    std::uint32_t rotation = static_cast<std::uint32_t>(q.largest);
    for (const double x : q.others) rotation = rotation << 10 | nearest_step(x, -std::sqrt(0.5), std::sqrt(0.5), 10);
    out_.put(three(place)).put(rotation).put(three(scale));
    out_.put(part(color, 0, 8) << 24 | part(color, 1, 8) << 16 | part(color, 2, 8) << 8 |
             nearest_step(opacity_of_logit(table_.opacity[row]), 0, 1, 8));
  }

  void harmonic(float x) {
    const double inside = held_harmonics_(static_cast<double>(x), -4, 4);
    out_.put(static_cast<std::uint8_t>(std::clamp(std::floor((inside / 8 + 0.5) * 256), 0.0, 255.0)));
  }

  using Range = std::array<std::array<std::array<float, 2>, 3>, quantities>;
  const SplatTable& table_;
  const SplatWriteSettings& settings_;
  std::vector<std::uint32_t> order_;
  std::vector<Range> ranges_;
  ByteWriter out_;
  HeldNumbers held_scales_, held_harmonics_;
};

}  // namespace detail

/// A table whose numbers were checked (detail::check_splats) as a file.
[[nodiscard]] inline EncodedSplats compressed_ply_bytes_of(const SplatTable& table,
                                                           const SplatWriteSettings& settings = {}) {
  return detail::CompressedPlyEncoder(table, settings).encode();
}

}  // namespace compmark
