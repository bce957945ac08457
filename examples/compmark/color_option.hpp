// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A colour as a word of the command line: black, white or RRGGBB.
#pragma once

#include <array>
#include <charconv>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "options.hpp"

namespace tool {

/// In [0, 1]; nothing if the word is no colour. A leading # is let pass.
[[nodiscard]] inline std::optional<std::array<float, 3>> color_of(std::string_view word) {
  if (word == "black") return std::array<float, 3>{0, 0, 0};
  if (word == "white") return std::array<float, 3>{1, 1, 1};
  if (word.starts_with('#')) word.remove_prefix(1);
  unsigned value = 0;
  const char* const end = word.data() + word.size();
  const std::from_chars_result read = std::from_chars(word.data(), end, value, 16);
  if (word.size() != 6 || read.ec != std::errc() || read.ptr != end) return std::nullopt;
  return std::array<float, 3>{static_cast<float>(value >> 16) / 255, static_cast<float>((value >> 8) & 255) / 255,
                              static_cast<float>(value & 255) / 255};
}

/// --background of commands that read pictures.
template <class App>
void background_option(App& app, std::string& target) {
  app.word("--background", target, "colour behind transparent pixels of images: black, white or RRGGBB")
      ->capture_default_str()
      ->check(CLI::Validator(
          [](std::string& word) {
            return color_of(word) ? std::string() : "\"" + word + "\" is not black, white or RRGGBB";
          },
          "black, white, RRGGBB"));
}

}  // namespace tool
