// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Writes the .splat file of antimatter15's viewer (docs/splat_formats.md; layout in antimatter_splat.hpp). It holds no
// harmonics beyond the colour, and colours in [0, 1] alone. Cost: a pass over the values; 32 bytes a splat.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "compmark/io/bytes.hpp"
#include "compmark/io/splat/splat_rounding.hpp"

namespace compmark {

/// A table whose numbers were checked (detail::check_splats) as a file.
[[nodiscard]] inline EncodedSplats antimatter_splat_bytes_of(const SplatTable& table) {
  EncodedSplats encoded;
  ByteWriter out;
  detail::HeldNumbers scales, colors;
  for (std::size_t row = 0; row < table.count; ++row) {
    for (std::size_t axis = 0; axis < 3; ++axis) out.put(table.mean[axis][row]);
    for (std::size_t axis = 0; axis < 3; ++axis) out.put(detail::held_length(table.log_scale[axis][row], scales));
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const double color = colors(detail::color_of_dc(table.color(channel, 0)[row]), 0, 1);
      out.put(detail::nearest_byte(255 * color));
    }
    out.put(detail::nearest_byte(255 * detail::opacity_of_logit(table.opacity[row])));
    for (const double x : detail::unit_rotation(table, row)) out.put(detail::nearest_byte(128 + 128 * x));
  }
  encoded.bytes = out.take();
  scales.tell("log scales", detail::log_scale_range, encoded.notes);
  colors.tell("colours", "0 to 1", encoded.notes);
  if (table.degree > 0) encoded.notes.emplace_back("the format has no harmonics: the colours are those of degree 0");
  return encoded;
}

}  // namespace compmark
