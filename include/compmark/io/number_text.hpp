// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Numbers as text, with a decimal point in every locale: what is written into a file or an identity, and what a report
// says, does not depend on the program that the library is part of.
#pragma once

#include <array>
#include <charconv>
#include <string>
#include <system_error>

namespace compmark::detail {

/// The shortest text that reads back as this number.
[[nodiscard]] inline std::string exact_text(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

/// With so many significant digits: "1.2e-07", "41".
[[nodiscard]] inline std::string short_number(double value, int digits = 2) {
  std::array<char, 64> text{};
  const auto [end, status] =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::general, digits);
  return status == std::errc() ? std::string(text.data(), end) : exact_text(value);
}

/// With so many digits behind the point: "41.0".
[[nodiscard]] inline std::string fixed_number(double value, int digits) {
  std::array<char, 384> text{};  // 309 digits before the point, and those behind
  const auto [end, status] =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, digits);
  return status == std::errc() ? std::string(text.data(), end) : exact_text(value);
}

}  // namespace compmark::detail
