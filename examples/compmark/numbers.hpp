// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Parses numbers of the command line. The whole word must be a finite number in its range, or the option is refused by
// name. The parser's own conversion takes -1 for 18446744073709551615 where a count is wanted, "010" for eight, and
// lets NaN through its comparisons.
#pragma once

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <system_error>
#include <type_traits>

namespace tool {

/// Both ends belong to it.
struct WholeRange {
  std::int64_t low = 0;
  std::uint64_t high = 0;
};
/// Both ends belong to it, but for `low` where `above` says so.
struct RealRange {
  double low = 0, high = 0;
  bool above = false;
};

inline constexpr WholeRange any_seed{0, UINT64_MAX};
inline constexpr WholeRange thread_range{0, 1024};         ///< 0: all
inline constexpr WholeRange run_length{1, 1'000'000'000};  ///< iterations, and cadences of them
inline constexpr WholeRange any_count{0, 1'000'000'000};
inline constexpr RealRange downscale_range{1, 64};
inline constexpr RealRange share_range{0, 1};

namespace numbers {

inline std::string number_text(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}
inline std::string range_text(const WholeRange& range) {
  return "a whole number from " + std::to_string(range.low) + " to " + std::to_string(range.high);
}
inline std::string range_text(const RealRange& range) {
  return "a number " + std::string(range.above ? "above " : "from ") + number_text(range.low) +
         (range.above ? " up to " : " to ") + number_text(range.high);
}

/// Whether the word is one of the range; it becomes the plain decimal of its value.
inline bool read_whole(std::string& word, const WholeRange& range) {
  const bool negative = !word.empty() && word[0] == '-';
  std::uint64_t size = 0;
  const char* const begin = word.data() + (negative ? 1 : 0);
  const char* const end = word.data() + word.size();
  const std::from_chars_result read = std::from_chars(begin, end, size);
  if (begin == end || read.ec != std::errc() || read.ptr != end) return false;
  if (negative && size != 0) {
    if (range.low >= 0 || size - 1 > static_cast<std::uint64_t>(-(range.low + 1))) return false;
    word = "-" + std::to_string(size);
    return true;
  }
  if (size > range.high || (range.low > 0 && size < static_cast<std::uint64_t>(range.low))) return false;
  word = std::to_string(size);
  return true;
}
inline bool read_real(const std::string& word, const RealRange& range) {
  double value = 0;
  const char* const end = word.data() + word.size();
  const std::from_chars_result read = std::from_chars(word.data(), end, value);
  if (word.empty() || read.ec != std::errc() || read.ptr != end || !std::isfinite(value)) return false;
  return (range.above ? value > range.low : value >= range.low) && value <= range.high;
}

}  // namespace numbers

/// For CLI::Option::check: the word is a number of the range, or an error that says what would be one.
inline CLI::Validator in_range(WholeRange range) {
  return {[range](std::string& word) {
            if (numbers::read_whole(word, range)) return std::string();
            return "\"" + word + "\" is not " + numbers::range_text(range);
          },
          std::to_string(range.low) + " to " + std::to_string(range.high)};
}
inline CLI::Validator in_range(RealRange range) {
  return {[range](std::string& word) {
            if (numbers::read_real(word, range)) return std::string();
            return "\"" + word + "\" is not " + numbers::range_text(range);
          },
          (range.above ? "above " : "") + numbers::number_text(range.low) + " to " + numbers::number_text(range.high)};
}

/// The parser's error as one line for the user.
inline std::string parse_error_line(const CLI::ParseError& error) {
  std::string line = error.what();
  for (char& c : line) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

}  // namespace tool
