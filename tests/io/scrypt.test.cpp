// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The vectors of RFC 7914, of each part and of the whole.
#include <doctest/doctest.h>

#include <array>
#include <compmark/io/scrypt.hpp>
#include <cstddef>
#include <string>
#include <vector>

using namespace compmark;

namespace scrypt_test {
namespace {

std::string derived(const char* password, const char* salt, const ScryptCost& cost) {
  std::array<std::byte, 64> out{};
  scrypt(bytes_of(password), bytes_of(salt), cost, out);
  return to_hex(out);
}

std::vector<std::byte> bytes(const char* digits) {
  const std::string_view text(digits);
  std::vector<std::byte> result(text.size() / 2);
  REQUIRE(from_hex(text, result));
  return result;
}

}  // namespace

TEST_CASE("io/scrypt: the vectors of RFC 7914, 12") {
  CHECK(derived("", "", {4, 1, 1}) ==
        "77d6576238657b203b19ca42c18a0497f16b4844e3074ae8dfdffa3fede21442fcd0069ded0948f8326a753a0fc81f17e8d3e0fb2e0d36"
        "28cf"
        "35e20c38d18906");
  CHECK(derived("password", "NaCl", {10, 8, 16}) ==
        "fdbabe1c9d3472007856e7190d01e9fe7c6ad7cbc8237830e77376634b3731622eaf30d92e22a3886ff109279d9830dac727afb94a83ee"
        "6d83"
        "60cbdfa2cc0640");
  CHECK(derived("pleaseletmein", "SodiumChloride", {14, 8, 1}) ==
        "7023bdcb3afd7348461c06cd81fd38ebfda8fbba904f8e3ea9b543f6545da1f2d5432955613f0fcf62d49705242a9af9e61e85dc0d651e"
        "40df"
        "cf017b45575887");
}

TEST_CASE("io/scrypt: Salsa20/8 of RFC 7914, 8") {
  const std::vector<std::byte> in = bytes(
      "7e879a214f3ec9867ca940e641718f26baee555b8c61c1b50df846116dcd3b1dee24f319df9b3d8514121e4b5ac5aa3276021d2909c74829"
      "edeb"
      "c68db8b8c25e");
  detail::SalsaBlock block{};
  for (std::size_t i = 0; i < in.size(); ++i)
    block.words[i / 4] |= std::to_integer<std::uint32_t>(in[i]) << (8 * (i % 4));
  detail::salsa20_8(block);
  std::vector<std::byte> out;
  for (const std::uint32_t word : block.words)
    for (int k = 0; k < 4; ++k) out.push_back(static_cast<std::byte>(word >> (8 * k)));
  CHECK(to_hex(out) ==
        "a41f859c6608cc993b81cacb020cef05044b2181a2fd337dfd7b1c6396682f29b4393168e3c9e6bcfe6bc5b7a06d96bae424cc102c9174"
        "5c24ad"
        "673dc7618f81");
}

TEST_CASE("io/scrypt: every part of the cost counts, and memory is what it says") {
  const std::string one = derived("a", "b", {6, 2, 1});
  CHECK(one != derived("a", "b", {7, 2, 1}));
  CHECK(one != derived("a", "b", {6, 3, 1}));
  CHECK(one != derived("a", "b", {6, 2, 2}));
  CHECK(one != derived("a", "c", {6, 2, 1}));
  CHECK(scrypt_memory({17, 8, 1}) == 134'217'728);
}

}  // namespace scrypt_test
