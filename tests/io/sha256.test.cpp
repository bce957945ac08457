// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <compmark/io/sha256.hpp>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

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

#if defined(__SHA__) && defined(__SSE4_1__)
TEST_CASE("io/sha256: the processor's instructions give what plain arithmetic gives") {
  std::vector<std::byte> data(64 * 37 + 1);
  std::uint32_t value = 1;
  for (std::byte& byte : data) byte = static_cast<std::byte>((value = value * 1664525u + 1013904223u) >> 24);
  for (const std::size_t blocks : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{37}}) {
    for (const std::size_t begin : {std::size_t{0}, std::size_t{1}}) {  // the second is not aligned
      compmark::detail::Sha256State portable{1, 2, 3, 4, 5, 6, 7, 0xfffffff8};
      compmark::detail::Sha256State instructions = portable;
      compmark::detail::sha256_portable(portable, data.data() + begin, blocks);
      compmark::detail::sha256_instructions(instructions, data.data() + begin, blocks);
      CHECK(portable == instructions);
    }
  }
}
#endif

TEST_CASE("io/sha256: plain arithmetic gives the vector of FIPS 180-4, whatever this program was built for") {
  std::array<std::byte, 64> block{};
  for (std::size_t i = 0; i < 3; ++i) block[i] = static_cast<std::byte>("abc"[i]);
  block[3] = std::byte{0x80};
  block[63] = std::byte{24};
  compmark::detail::Sha256State state{0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                      0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
  compmark::detail::sha256_portable(state, block.data(), 1);
  CHECK(state == compmark::detail::Sha256State{0xba7816bf, 0x8f01cfea, 0x414140de, 0x5dae2223, 0xb00361a3, 0x96177a9c,
                                               0xb410ff61, 0xf20015ad});
}
