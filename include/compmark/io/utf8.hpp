// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Names go into JSON, which is UTF-8; file systems allow any bytes.
#pragma once

#include <cstddef>
#include <string_view>

namespace compmark {

/// Whether a text is well-formed UTF-8 (Unicode 15, table 3-7): no overlong form, no surrogate, nothing beyond
/// U+10FFFF, nothing cut off.
[[nodiscard]] inline bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<unsigned char>(text[i]);
    if (first < 0x80) {
      ++i;
      continue;
    }
    if (first < 0xC2 || first > 0xF4) return false;
    const std::size_t more = first < 0xE0 ? 1 : first < 0xF0 ? 2 : 3;
    if (more >= text.size() - i) return false;
    // The second byte's range is what keeps overlong forms, surrogates and numbers beyond the last out.
    const unsigned low = first == 0xE0 ? 0xA0u : first == 0xF0 ? 0x90u : 0x80u;
    const unsigned high = first == 0xED ? 0x9Fu : first == 0xF4 ? 0x8Fu : 0xBFu;
    for (std::size_t j = 1; j <= more; ++j) {
      const auto next = static_cast<unsigned char>(text[i + j]);
      if (next < (j == 1 ? low : 0x80u) || next > (j == 1 ? high : 0xBFu)) return false;
    }
    i += more + 1;
  }
  return true;
}

}  // namespace compmark
