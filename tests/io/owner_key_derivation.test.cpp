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
OwnerKey bound_before(char digit) {
  OwnerKey key = bound(digit);
  key.before_version_5 = true;
  return key;
}
std::array<std::byte, 32> derived(const OwnerKey& key) {
  std::array<std::byte, 32> bytes{};
  key.derive("compmark/message/v1", bytes);
  return bytes;
}

/// Of the secret and the decoder of 32 bytes aa, by scrypt alone.
Digest256 root_by_hand(const std::string& salt) {
  std::array<std::byte, 64> both{};
  const Digest256 start = secret();
  std::copy(start.begin(), start.end(), both.begin());
  std::fill(both.begin() + 32, both.end(), std::byte{0xaa});
  Digest256 root{};
  scrypt(both, bytes_of(salt), {10, 8, 1}, root);
  return root;
}

}  // namespace

TEST_CASE("io/owner_key_derivation: a bound key derives from secret and decoder together, as the documentation says") {
  const OwnerKey key = bound_before('a');
  CHECK(key.version() == 3);
  const Digest256 root = root_by_hand("compmark/key/v3");
  CHECK(key.root() == root);
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

TEST_CASE(
    "io/owner_key_derivation: length, code and whether there are recipients cost a derivation each from version 5 on") {
  OwnerKey key = bound('a');
  CHECK(key.version() == 5);
  // As the documentation says: the label, 48 and 0 in four bytes each, and no recipients.
  CHECK(key.root() == root_by_hand(std::string("compmark/key/v5") + std::string("\0\0\0\x30\0\0\0\0\0", 9)));
  std::array<OwnerKey, 5> keys{key, key, key, key, bound_before('a')};
  keys[1].bits = 47;
  keys[2].corrects = 4, keys[2].payload = "5eed";
  keys[3].recipients = 10;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      CAPTURE(i);
      CAPTURE(j);
      CHECK(derived(keys[i]) != derived(keys[j]));
      CHECK(keys[i].commitment() != keys[j].commitment());
    }
  }
  // Another payload of one code, and more recipients: the same carriers and mask, and another commitment.
  OwnerKey other = keys[2], more = keys[3];
  other.payload = "0000";
  more.recipients = 20;
  CHECK(derived(other) == derived(keys[2]));
  CHECK(other.commitment() != keys[2].commitment());
  CHECK(derived(more) == derived(keys[3]));
  CHECK(more.commitment() != keys[3].commitment());
  // The control: before version 5 one root serves them all, so that a cheat could say afterwards which was meant.
  OwnerKey before = bound_before('a'), shorter = before;
  shorter.bits = 47;
  CHECK(derived(before) == derived(shorter));
}

TEST_CASE("io/owner_key_derivation: what is changed after a key was made derives anew, with settle() or without") {
  OwnerKey key = *make_key(secret(), when, 48);
  const std::array<std::byte, 32> quick = derived(key);
  key.hardness = 10;  // and no root was made: a key must not derive from nothing, which anybody has
  const std::array<std::byte, 32> hard = derived(key);
  CHECK(hard != quick);
  CHECK(hard == derived(*make_hard_key(secret(), when, 48, "", 10)));
  Digest256 another = secret();
  another[0] ^= std::byte{1};
  OwnerKey stranger = *make_key(another, when, 48);
  stranger.hardness = 10;
  CHECK(derived(stranger) != hard);
  OwnerKey now_bound = *make_hard_key(secret(), when, 48, "", 10);
  now_bound.decoder = decoder('a');
  CHECK(derived(now_bound) == derived(bound('a')));
  now_bound.settle();
  CHECK(derived(now_bound) == derived(bound('a')));
}

}  // namespace derivation_test
