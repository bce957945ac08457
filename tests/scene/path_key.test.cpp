// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/scene/path_key.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <string>
#include <vector>

using namespace compmark;

TEST_CASE("scene/path_key: one path, however it is written") {
  const auto key = [](const std::string& name) {
    const detail::PathKey k = detail::path_key(name);
    std::string text;
    for (const std::string& part : k.parts) text += part + "<";
    return text + "." + k.extension;
  };
  for (const char* same : {"a/b/c.JPG", "A\\B\\C.jpeg", "./a//b/./c.jpg", "x/../a/b/c.jpg", "C:\\a\\b\\c.jpg",
                           "C:a/b/c.jpg", "/a/b/c.jpe", "../a/b/c.jpg", "a/b/%63.jpg"})
    CHECK(key(same) == "c<b<a<.jpg");
  CHECK(key("https://host/a.png?x=1/2#3") == "a<host<.png");
  CHECK(key("file:///C:/s/a.png") == key("s/a.png"));
  CHECK(key("r_0.5") == "r_0.5<.");  // no extension
  CHECK(key("a.b.png") == "a.b<.png");
  CHECK(key("a.jpg.png") == "a<.png");
  CHECK(key("a.jpg.jpg.png") == "a.jpg<.png");  // once
  CHECK(key(".png") == ".png<.");
  CHECK(key("100%") == "100%<.");
  CHECK(key("caf\xC3\x89") == key("cafe\xCC\x81"));  // one character, or two
  CHECK(key("\xD0\x96\xD0\xAF") == key("\xD0\xB6\xD1\x8F"));
  CHECK(key("\xCE\xA9\xCE\x91") == key("\xCF\x89\xCE\xB1"));
  CHECK(key("\xC3\x98") == key("\xC3\xB8"));
  CHECK(key("\xC3\x9F") != key("\xC3\xBF"));
}

TEST_CASE("scene/path_key: numbers in names have the order of numbers, and the order is one") {
  const std::vector<std::string> sorted{"a", "a1", "a2", "a010", "a10", "a10b", "a11", "b", "b01c2", "b1c10"};
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    for (std::size_t j = 0; j < sorted.size(); ++j) {
      CAPTURE(sorted[i]);
      CAPTURE(sorted[j]);
      if (i != j && sorted[i] != "a010" && sorted[i] != "a10")
        CHECK(detail::natural_less(sorted[i], sorted[j]) == (i < j));
      if (i == j) CHECK(!detail::natural_less(sorted[i], sorted[j]));
    }
  }
  // Equal numbers in other spellings are apart, one way.
  CHECK(detail::natural_less("a010", "a10") != detail::natural_less("a10", "a010"));
}
