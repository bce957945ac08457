// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <compmark/io/hmac_sha256.hpp>
#include <string>
#include <string_view>
#include <vector>

using namespace compmark;

namespace {
std::vector<std::byte> hex(std::string_view text) {
  std::vector<std::byte> bytes(text.size() / 2);
  REQUIRE(from_hex(text, bytes));
  return bytes;
}
std::vector<std::byte> repeat(unsigned char value, std::size_t count) {
  return std::vector<std::byte>(count, std::byte{value});
}
std::vector<std::byte> count_up(unsigned first, unsigned last) {
  std::vector<std::byte> bytes;
  for (unsigned value = first; value <= last; ++value) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}
std::string mac(ByteSpan key, ByteSpan data) { return to_hex(hmac_sha256(key, {data})); }
std::string expand(ByteSpan secret, ByteSpan salt, ByteSpan info, std::size_t length) {
  std::vector<std::byte> out(length);
  hkdf_sha256(secret, salt, info, out);
  return to_hex(out);
}
}  // namespace

TEST_CASE("io/hmac_sha256: the vectors of RFC 4231") {
  CHECK(mac(repeat(0x0b, 20), bytes_of("Hi There")) ==
        "b0344c61d8db38535ca8afceaf0bf12b881dc200c9833da726e9376c2e32cff7");
  CHECK(mac(bytes_of("Jefe"), bytes_of("what do ya want for nothing?")) ==
        "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  CHECK(mac(repeat(0xaa, 20), repeat(0xdd, 50)) == "773ea91e36800e46854db8ebd09181a72959098b3ef8c122d9635514ced565fe");
  CHECK(mac(count_up(1, 25), repeat(0xcd, 50)) == "82558a389a443c0ea4cc819899f2083a85f0faa3e578f8077a2e3ff46729665b");
  CHECK(mac(repeat(0x0c, 20), bytes_of("Test With Truncation")).substr(0, 32) == "a3b6167473100ee06e0c796c2955552b");
  CHECK(mac(repeat(0xaa, 131), bytes_of("Test Using Larger Than Block-Size Key - Hash Key First")) ==
        "60e431591ee0b67f0d8a26aacbf5b77f8e0bc6213728c5140546040f0ee37f54");
  CHECK(mac(repeat(0xaa, 131), bytes_of("This is a test using a larger than block-size key and a larger than "
                                        "block-size data. The key needs to be hashed before being used by the HMAC "
                                        "algorithm.")) ==
        "9b09ffa71b942fcb27635fbcd5b0e944bfdc63644f0713938a7f51535c3a35e2");
  // Pieces do not matter.
  const auto key = repeat(0x0b, 20);
  CHECK(to_hex(hmac_sha256(key, {bytes_of("Hi "), ByteSpan{}, bytes_of("There")})) == mac(key, bytes_of("Hi There")));
}

TEST_CASE("io/hmac_sha256: the vectors of RFC 5869") {
  CHECK(expand(repeat(0x0b, 22), count_up(0x00, 0x0c), count_up(0xf0, 0xf9), 42) ==
        "3cb25f25faacd57a90434f64d0362f2a2d2d0a90cf1a5a4c5db02d56ecc4c5bf34007208d5b887185865");
  CHECK(expand(count_up(0x00, 0x4f), count_up(0x60, 0xaf), count_up(0xb0, 0xff), 82) ==
        "b11e398dc80327a1c8e7f78c596a49344f012eda2d4efad8a050cc4c19afa97c59045a99cac7827271cb41c65e590e09da3275600c2f09"
        "b8367793a9aca3db71cc30c58179ec3e87c14c01d5c1f3434f1d87");
  CHECK(expand(repeat(0x0b, 22), {}, {}, 42) ==
        "8da4e775a563c18f715f802a063c5a31b8a11f5c5ee1879ec3454e5f3c738d2d9d201395faa4b61a96c8");
  // The longest output is filled to its end, and starts like a short one.
  const std::string longest = expand(repeat(0x0b, 22), {}, {}, 255 * 32);
  CHECK(longest.substr(0, 84) == expand(repeat(0x0b, 22), {}, {}, 42));
  CHECK(longest.substr(2 * 254 * 32) != std::string(64, '0'));
}

TEST_CASE("io/hmac_sha256: hexadecimal digits") {
  CHECK(to_hex(hex("00ff10Ab")) == "00ff10ab");
  std::vector<std::byte> two(2);
  CHECK_FALSE(from_hex("00f", two));
  CHECK_FALSE(from_hex("00fff0", two));
  CHECK_FALSE(from_hex("00g0", two));
  CHECK_FALSE(from_hex("00 0", two));
}
