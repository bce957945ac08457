// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/io/sha256.hpp>
#include <string>
#include <string_view>

namespace {
std::string digest(std::string_view text, std::size_t piece = 1000000) {
  compmark::Sha256 sha;
  for (std::size_t i = 0; i < text.size(); i += piece) {
    const std::string_view part = text.substr(i, piece);
    sha.update(std::as_bytes(std::span<const char>(part.data(), part.size())));
  }
  return sha.hex();
}
}  // namespace

TEST_CASE("io/sha256: the vectors of FIPS 180-4") {
  CHECK(digest("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  CHECK(digest("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq") ==
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  CHECK(digest(std::string(1000000, 'a')) == "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST_CASE("io/sha256: pieces do not matter, one bit does") {
  std::string text(1000, 'x');
  for (const std::size_t piece : {1u, 7u, 63u, 64u, 65u, 999u}) CHECK(digest(text, piece) == digest(text));
  const std::string before = digest(text);
  text[500] = static_cast<char>(text[500] ^ 1);
  CHECK(digest(text) != before);
}
