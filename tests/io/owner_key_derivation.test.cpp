// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What derives from a key's secret: the same for ever, another for another hardness or decoder.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <compmark/io/owner_key_derivation.hpp>
#include <cstddef>
#include <string>

using namespace compmark;

namespace derivation_test {
namespace {

constexpr const char* when = "2026-01-31T23:59:59Z";

Digest256 secret() {
  Digest256 bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::byte>(7 * i + 1);
  return bytes;
}
std::string decoder(char digit) { return std::string(64, digit); }
OwnerKey bound(char digit, unsigned hardness = 10) {
  return *make_bound_key(secret(), decoder(digit), when, 48, "", hardness);
}
std::array<std::byte, 32> derived(const OwnerKey& key) {
  std::array<std::byte, 32> bytes{};
  key.derive("compmark/message/v1", bytes);
  return bytes;
}

}  // namespace

TEST_CASE("io/owner_key_derivation: a bound key derives from secret and decoder together, as the documentation says") {
  const OwnerKey key = bound('a');
  CHECK(key.version() == 3);
  std::array<std::byte, 64> both{};
  const Digest256 start = secret();
  std::copy(start.begin(), start.end(), both.begin());
  std::fill(both.begin() + 32, both.end(), std::byte{0xaa});
  Digest256 root{};
  scrypt(both, bytes_of("compmark/key/v3"), {10, 8, 1}, root);
  CHECK(key.root == root);
  std::array<std::byte, 32> direct{};
  hkdf_sha256(root, bytes_of("compmark"), bytes_of("compmark/message/v1"), direct);
  CHECK(derived(key) == direct);
}

TEST_CASE("io/owner_key_derivation: another decoder is another message, another root and another commitment") {
  const OwnerKey one = bound('a'), other = bound('b'), harder = bound('a', 11);
  const OwnerKey unbound = *make_hard_key(secret(), when, 48, "", 10);
  CHECK(derived(one) != derived(other));
  CHECK(derived(one) != derived(harder));
  CHECK(derived(one) != derived(unbound));
  CHECK(one.commitment() != other.commitment());
  CHECK(one.commitment() != harder.commitment());
  CHECK(one.commitment() != unbound.commitment());
  OwnerKey payload = one;
  payload.payload = "5eed", payload.corrects = 4;
  CHECK(payload.commitment() != one.commitment());
  OwnerKey later = one;
  later.created[0] = '3';
  CHECK(later.commitment() != one.commitment());
}

TEST_CASE("io/owner_key_derivation: what is no SHA-256 in small letters is refused, and so is a quick bound key") {
  for (const std::string& digits : {std::string(), std::string("ab"), decoder('g'), decoder('A'), decoder('a') + "a"}) {
    CAPTURE(digits);
    const Result<OwnerKey> key = make_bound_key(secret(), digits, when, 48, "", 10);
    REQUIRE_FALSE(key.ok());
    CHECK(key.error().field == "decoder");
  }
  CHECK_FALSE(make_bound_key(secret(), decoder('a'), when, 48, "", 0).ok());
  CHECK_FALSE(make_bound_key(secret(), decoder('a'), when, 48, "", 9).ok());
  CHECK_FALSE(make_bound_key(secret(), decoder('a'), "today", 48, "", 10).ok());
  CHECK_FALSE(make_bound_key(Digest256{}, decoder('a'), when, 48, "", 10).ok());
}

}  // namespace derivation_test
