// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A PNG file of any kind of pixel, as masks come in: grey or coloured, of a palette, with alpha, of 8 or 16 bits.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace compmark::testing {

/// A PNG of `bits` and `channels` (by PNG's colour type), uncompressed; `palette` of RGB triples where there is one,
/// and `transparent`, the contents of a tRNS chunk.
inline std::string png_text(int width, int height, int bits, int type,
                            const std::function<std::vector<int>(int x, int y)>& pixel, const std::string& palette = "",
                            const std::string& transparent = "") {
  const auto big = [](std::uint32_t v) {
    std::string text;
    for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(v >> shift & 0xFF);
    return text;
  };
  const auto chunk = [&](const std::string& name, const std::string& data) {
    std::uint32_t crc = 0xFFFFFFFFu;
    for (const char c : name + data) {
      crc ^= static_cast<unsigned char>(c);
      for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0u);
    }
    return big(static_cast<std::uint32_t>(data.size())) + name + data + big(~crc);
  };
  std::string rows;
  for (int y = 0; y < height; ++y) {
    rows += '\0';
    for (int x = 0; x < width; ++x) {
      for (const int value : pixel(x, y)) {
        if (bits == 16) rows += static_cast<char>(value >> 8);
        rows += static_cast<char>(value & 0xFF);
      }
    }
  }
  std::uint32_t a = 1, b = 0;
  for (const char c : rows) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  const auto length = static_cast<unsigned>(rows.size());
  std::string stream = "\x78\x01\x01";
  for (const unsigned v : {length, ~length}) {
    stream += static_cast<char>(v & 0xFF);
    stream += static_cast<char>(v >> 8 & 0xFF);
  }
  stream += rows + big(b << 16 | a);
  std::string header = big(static_cast<std::uint32_t>(width)) + big(static_cast<std::uint32_t>(height));
  header += {static_cast<char>(bits), static_cast<char>(type), 0, 0, 0};
  return "\x89PNG\r\n\x1a\n" + chunk("IHDR", header) + (palette.empty() ? "" : chunk("PLTE", palette)) +
         (transparent.empty() ? "" : chunk("tRNS", transparent)) + chunk("IDAT", stream) + chunk("IEND", "");
}

}  // namespace compmark::testing
