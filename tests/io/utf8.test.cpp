// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/utf8.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <string>

namespace {

using namespace compmark;

/// Bytes of a code point by the definition of the encoding, in `length` bytes: too many make an overlong form.
std::string coded(std::uint32_t point, int length) {
  if (length == 1) return std::string(1, static_cast<char>(point));
  std::string text;
  for (int i = length - 1; i > 0; --i) text.push_back(static_cast<char>(0x80u | (point >> (6 * (i - 1)) & 0x3Fu)));
  const unsigned mark = length == 2 ? 0xC0u : length == 3 ? 0xE0u : 0xF0u;
  return std::string(1, static_cast<char>(mark | point >> (6 * (length - 1)))) + text;
}

TEST_CASE("io/utf8: every code point is text in its shortest form, and in no other; surrogates are none") {
  for (std::uint32_t point = 0; point < 0x200000; ++point) {
    const int shortest = point < 0x80 ? 1 : point < 0x800 ? 2 : point < 0x10000 ? 3 : 4;
    const bool exists = point <= 0x10FFFF && (point < 0xD800 || point > 0xDFFF);
    REQUIRE(is_utf8(coded(point, shortest)) == exists);
    for (int length = shortest + 1; length <= 4; ++length) REQUIRE(!is_utf8(coded(point, length)));
  }
}

TEST_CASE("io/utf8: what is cut off, begins in the middle or is Latin-1 is no text") {
  for (const std::uint32_t point : {0xE9u, 0x20ACu, 0x1F600u}) {
    const std::string whole = coded(point, point < 0x800 ? 2 : point < 0x10000 ? 3 : 4);
    for (std::size_t n = 1; n < whole.size(); ++n) {
      CHECK(!is_utf8(whole.substr(0, n)));
      CHECK(!is_utf8(whole.substr(0, n) + "a.jpg"));
      CHECK(!is_utf8(whole.substr(n)));
    }
    CHECK(is_utf8("a" + whole + whole + "b"));
  }
  CHECK(is_utf8(""));
  CHECK(is_utf8(std::string("\0a", 2)));
  CHECK(!is_utf8("caf\xE9.jpg"));
  CHECK(!is_utf8("\xFF"));
}

}  // namespace
