// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A normalised form of a photograph's path. Paths that differ in system, in capitals, in the extension or in the form
// of an address have one key. Cost: linear in the name.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "compmark/core/config.hpp"

namespace compmark {
namespace detail {

/// Small letters, accents apart from their letters: ASCII, Latin-1, Greek and Cyrillic as UTF-8; anything else stays.
/// (Systems differ in whether an accented letter is one character or two.)
[[nodiscard]] inline std::string folded(std::string_view text) {
  static constexpr std::string_view letters = "aaaaaa?ceeeeiiii?nooooo??uuuuy?y",
                                    accents = "`'^~:o?,`'^:`'^:?~`'^~:??`'^:'?:";
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0u;
    if (c >= 'A' && c <= 'Z') {
      result += static_cast<char>(c - 'A' + 'a');
    } else if (c == 0xC3 && next >= 0x80 && next <= 0xBF && next != 0x9F) {  // U+00C0 … U+00FF without the sharp s
      const std::size_t k = next & 0x1F;
      if (letters[k] == '?') {
        (result += '\xC3') += static_cast<char>(next == 0x97 ? next : next | 0x20);
      } else {
        const char accent = accents[k];
        result += letters[k];
        result += accent == '`'    ? "\xCC\x80"
                  : accent == '\'' ? "\xCC\x81"
                  : accent == '^'  ? "\xCC\x82"
                  : accent == '~'  ? "\xCC\x83"
                  : accent == ':'  ? "\xCC\x88"
                  : accent == 'o'  ? "\xCC\x8A"
                                   : "\xCC\xA7";
      }
      ++i;
    } else if (c == 0xCE && next >= 0x91 && next <= 0xA9) {  // Greek capitals
      result += next <= 0x9F ? '\xCE' : '\xCF';
      result += static_cast<char>(next <= 0x9F ? next + 0x20 : next - 0x20);
      ++i;
    } else if (c == 0xD0 && next >= 0x90 && next <= 0xAF) {  // Cyrillic capitals
      result += next <= 0x9F ? '\xD0' : '\xD1';
      result += static_cast<char>(next <= 0x9F ? next + 0x20 : next - 0x20);
      ++i;
    } else {
      result += text[i];
    }
  }
  return result;
}

/// "%20" as " ".
[[nodiscard]] inline std::string percent_decoded(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int high = text[i] == '%' && i + 2 < text.size() ? digit(text[i + 1]) : -1;
    const int low = high >= 0 ? digit(text[i + 2]) : -1;
    if (low < 0 || high + low == 0) {
      result += text[i];
    } else {
      result += static_cast<char>(16 * high + low);
      i += 2;
    }
  }
  return result;
}

/// Where the extension begins, dot included; the size of the name if it has none that photographs have ("r_0.5" has
/// none).
[[nodiscard]] inline std::size_t extension_place(std::string_view name) {
  static constexpr std::array<std::string_view, 26> known{
      "png", "jpg", "jpeg", "jpe", "jfif", "tif", "tiff", "bmp", "webp", "heic", "heif", "avif", "exr",
      "hdr", "tga", "ppm",  "pgm", "gif",  "dng", "cr2",  "cr3", "nef",  "arw",  "raw",  "orf",  "rw2"};
  const std::size_t dot = name.rfind('.');
  if (dot == std::string_view::npos || dot == 0) return name.size();
  const std::string extension = folded(name.substr(dot + 1));
  return std::find(known.begin(), known.end(), extension) != known.end() ? dot : name.size();
}

/// A name taken apart.
struct PathKey {
  std::vector<std::string> parts;  ///< folded; the stem, then its folder, then that one's …
  std::string extension;           ///< folded, without dot; "jpg" for all spellings of it
  std::string written;             ///< as it was written, but with single slashes, and without drive, "." and ".."

  [[nodiscard]] std::size_t folders() const { return parts.size() - 1; }
};

/// Backslashes are slashes; the drive, the scheme of an address and what follows a "?" in one are dropped. `parts` is
/// empty for a name without any letter of its own.
[[nodiscard]] inline PathKey path_key(std::string_view name) {
  std::string text(name);
  if (text.size() > 2 && text.front() == text.back() && (text.front() == '"' || text.front() == '\''))
    text = text.substr(1, text.size() - 2);
  std::replace(text.begin(), text.end(), '\\', '/');
  if (const std::size_t scheme = text.find("://"); scheme != std::string::npos) {
    text.erase(0, scheme + 3);
    text.erase(std::min(text.find_first_of("?#"), text.size()));
  }
  std::vector<std::string_view> folders;
  const std::string_view whole = text;
  for (std::size_t begin = 0; begin <= whole.size();) {
    const std::size_t end = std::min(whole.find('/', begin), whole.size());
    std::string_view part = whole.substr(begin, end - begin);
    const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
    if (folders.empty() && part.size() >= 2 && part[1] == ':' && letter(part[0])) part.remove_prefix(2);
    if (part == "..") {
      if (!folders.empty()) folders.pop_back();
    } else if (!part.empty() && part != ".") {
      folders.push_back(part);
    }
    begin = end + 1;
  }
  PathKey key;
  if (folders.empty()) return key;
  for (const std::string_view part : folders) (key.written += key.written.empty() ? "" : "/") += part;
  const std::string last = percent_decoded(folders.back());
  const std::size_t dot = extension_place(last);
  // "a.jpg.png" is a.jpg, converted by a program that appends.
  const std::string_view stem = std::string_view(last).substr(0, dot);
  key.parts.push_back(folded(stem.substr(0, extension_place(stem))));
  if (dot < last.size()) key.extension = folded(std::string_view(last).substr(dot + 1));
  if (key.extension == "jpeg" || key.extension == "jpe" || key.extension == "jfif") key.extension = "jpg";
  for (std::size_t i = folders.size() - 1; i-- > 0;) key.parts.push_back(folded(percent_decoded(folders[i])));
  return key;
}

/// "a2" before "a10": runs of digits compare as numbers.
[[nodiscard]] inline bool natural_less(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    while (i < a.size() && a[i] == '0') ++i;
    while (j < b.size() && b[j] == '0') ++j;
    std::size_t end_a = i, end_b = j;
    while (end_a < a.size() && digit(a[end_a])) ++end_a;
    while (end_b < b.size() && digit(b[end_b])) ++end_b;
    if (end_a - i != end_b - j) return end_a - i < end_b - j;
    const int order = a.compare(i, end_a - i, b, j, end_b - j);
    if (order != 0) return order < 0;
    i = end_a, j = end_b;
  }
  return a.size() != b.size() ? a.size() < b.size() : a < b;
}

}  // namespace detail
}  // namespace compmark
