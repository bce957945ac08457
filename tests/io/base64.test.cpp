// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/io/base64.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

TEST_CASE("io/base64: the vectors of RFC 4648, section 10, and every byte") {
  using Pair = std::pair<std::string, std::string>;
  for (const Pair& one :
       {Pair{"", ""}, Pair{"f", "Zg=="}, Pair{"fo", "Zm8="}, Pair{"foo", "Zm9v"}, Pair{"foob", "Zm9vYg=="},
        Pair{"fooba", "Zm9vYmE="}, Pair{"foobar", "Zm9vYmFy"}, Pair{"\xfb\xff\xbf", "+/+/"}}) {
    CHECK(compmark::base64(std::as_bytes(std::span<const char>(one.first.data(), one.first.size()))) == one.second);
  }
  std::vector<std::byte> all(256);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::byte>(i);
  const std::string text = compmark::base64(all);
  CHECK(text.size() == 344);
  CHECK(text.substr(0, 8) == "AAECAwQF");
  CHECK(text.substr(340) == "/w==");
}
