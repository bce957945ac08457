// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A soft binding as CBOR: another reader (nlohmann's) finds what was put in, and the bytes are the deterministic ones
// that RFC 8949 asks for: numbers in the fewest bytes, keys in the order of their encodings.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/watermark/proof/soft_binding.hpp>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

using namespace compmark;

namespace soft_binding_test {

TEST_CASE("soft binding: another reader of CBOR finds the assertion's fields, whatever their lengths") {
  for (const std::size_t length : {0u, 1u, 23u, 24u, 255u, 256u, 65535u, 65536u}) {
    CAPTURE(length);
    const SoftBinding binding{"org.compmark.test.48", std::string(length, 'a'), "for people"};
    const std::vector<std::byte> bytes = soft_binding_cbor(binding);
    const nlohmann::json read = nlohmann::json::from_cbor(bytes);  // strict: throws at a byte too many or too few
    CHECK(read.size() == 4);
    CHECK(read["alg"] == binding.algorithm);
    CHECK(read["name"] == binding.name);
    CHECK(read["pad"].get_binary().empty());
    REQUIRE(read["blocks"].size() == 1);
    CHECK(read["blocks"][0]["value"] == binding.value);
    CHECK(read["blocks"][0]["scope"] == nlohmann::json::object());
    CHECK(read["blocks"][0].size() == 2);
  }
  CHECK(nlohmann::json::from_cbor(soft_binding_cbor({"a", "b", ""})).count("name") == 0);
}

TEST_CASE("soft binding: numbers take the fewest bytes, and keys stand in the order of their encodings") {
  // RFC 8949, appendix A.
  const std::vector<std::pair<std::uint64_t, std::vector<unsigned>>> published{
      {0, {0x00}},
      {23, {0x17}},
      {24, {0x18, 0x18}},
      {100, {0x18, 0x64}},
      {1000, {0x19, 0x03, 0xe8}},
      {1000000, {0x1a, 0x00, 0x0f, 0x42, 0x40}},
      {1000000000000, {0x1b, 0x00, 0x00, 0x00, 0xe8, 0xd4, 0xa5, 0x10, 0x00}},
      {18446744073709551615u, {0x1b, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff}}};
  for (const auto& entry : published) {
    std::vector<std::byte> bytes, expected;
    detail::cbor_head(bytes, 0, entry.first);
    for (const unsigned byte : entry.second) expected.push_back(static_cast<std::byte>(byte));
    CHECK(bytes == expected);
  }
  const std::vector<std::byte> bytes = soft_binding_cbor({"a", "b", "c"});
  std::size_t before = 0;
  for (const std::string key : {"\x63"
                                "alg",
                                "\x63"
                                "pad",
                                "\x64"
                                "name",
                                "\x66"
                                "blocks"}) {
    const auto at = std::search(bytes.begin(), bytes.end(), key.begin(), key.end(),
                                [](std::byte a, char b) { return a == static_cast<std::byte>(b); });
    REQUIRE(at != bytes.end());
    CHECK(static_cast<std::size_t>(at - bytes.begin()) >= before);
    before = static_cast<std::size_t>(at - bytes.begin());
  }
}

TEST_CASE("soft binding: an algorithm is named by the decoder's file and the number of bits") {
  CHECK(soft_binding_algorithm("universal3_64.safetensors", 48) == "org.compmark.universal3-64.48");
  CHECK(soft_binding_algorithm("My Decoder", 32) == "org.compmark.my-decoder.32");
}

}  // namespace soft_binding_test
