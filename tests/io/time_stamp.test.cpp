// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The answer of an authority (OpenSSL, tests/golden/claim), and what is no answer: refused, never read past its end.
#include <doctest/doctest.h>

#include <algorithm>
#include <compmark/io/owner_claim.hpp>
#include <compmark/io/time_stamp.hpp>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <vector>

using namespace compmark;

namespace time_stamp_test {
namespace {

using Bytes = std::vector<std::byte>;

/// One element of DER.
Bytes der(unsigned tag, std::initializer_list<Bytes> parts) {
  Bytes content;
  for (const Bytes& part : parts) content.insert(content.end(), part.begin(), part.end());
  Bytes result{static_cast<std::byte>(tag)};
  if (content.size() >= 128) {
    result.push_back(std::byte{0x82});
    result.push_back(static_cast<std::byte>(content.size() >> 8));
  }
  result.push_back(static_cast<std::byte>(content.size() & 0xFF));
  result.insert(result.end(), content.begin(), content.end());
  return result;
}
Bytes hex(const std::string& digits) {
  Bytes bytes(digits.size() / 2);
  REQUIRE(from_hex(digits, bytes));
  return bytes;
}
Bytes text(const std::string& words) {
  const ByteSpan bytes = bytes_of(words);
  return {bytes.begin(), bytes.end()};
}

struct Stamp {
  std::string hash = "608648016503040201", digest = std::string(64, '7'), time = "20310102030405Z",
              content = "2a864886f70d0109100104";
  [[nodiscard]] Bytes token() const {
    const Bytes one = der(0x02, {hex("01")});
    const Bytes imprint = der(0x30, {der(0x30, {der(0x06, {hex(hash)})}), der(0x04, {hex(digest)})});
    const Bytes info = der(0x30, {one, der(0x06, {hex("2a0304")}), imprint, one, der(0x18, {text(time)})});
    const Bytes wrapped = der(0x30, {der(0x06, {hex(content)}), der(0xA0, {der(0x04, {info})})});
    return der(0x30, {der(0x06, {hex("2a864886f70d010702")}),
                      der(0xA0, {der(0x30, {der(0x02, {hex("03")}), der(0x31, {}), wrapped})})});
  }
  [[nodiscard]] Result<TimeStamp> read() const { return read_time_stamp(token(), "a.tsr"); }
};

}  // namespace

TEST_CASE("io/time_stamp: the answer of OpenSSL stamps the claim beside it") {
  const Result<OwnerClaim> claim = read_claim("tests/golden/claim/owner.claim");
  REQUIRE(claim.ok());
  const Bytes bytes = *read_file("tests/golden/claim/owner.tsr");
  const Result<TimeStamp> stamp = read_time_stamp(bytes, "owner.tsr");
  REQUIRE(stamp.ok());
  CHECK(stamp->digest == claim->digest());
  CHECK(stamp->time == "2026-11-28T03:34:28Z");
  // Cut short anywhere, or with something behind it, it is none. A flipped bit gives an answer or an error; one that
  // gives this claim at another time is a bit of the time, which the signature guards, and OpenSSL checks that.
  Bytes longer = bytes;
  longer.push_back(std::byte{0});
  CHECK_FALSE(read_time_stamp(longer, "a").ok());
  const std::string written = "20261128033428Z";
  const auto place = std::search(bytes.begin(), bytes.end(), written.begin(), written.end(),
                                 [](std::byte a, char b) { return a == static_cast<std::byte>(b); });
  REQUIRE(place != bytes.end());
  const auto time_begins = static_cast<std::size_t>(place - bytes.begin());
  std::size_t other_times = 0;
  for (std::size_t size = 0; size < bytes.size(); ++size)
    CHECK_FALSE(read_time_stamp(ByteSpan(bytes).first(size), "a").ok());
  for (std::size_t i = 0; i < 8 * bytes.size(); ++i) {
    Bytes flipped = bytes;
    flipped[i / 8] ^= static_cast<std::byte>(1u << (i % 8));
    const Result<TimeStamp> read = read_time_stamp(flipped, "a");
    if (!read) {
      CHECK(read.error().file == "a");
    } else if (read->digest == claim->digest() && read->time != stamp->time) {
      ++other_times;
      CHECK(i / 8 >= time_begins);
      CHECK(i / 8 < time_begins + written.size());
    }
  }
  CHECK(other_times > 0);  // so that the lines above were reached
}

TEST_CASE("io/time_stamp: a token, with fractions of a second or without, and what is none") {
  CHECK(Stamp{}.read()->time == "2031-01-02T03:04:05Z");
  CHECK(to_hex(Stamp{}.read()->digest) == Stamp{}.digest);
  Stamp other;
  other.time = "20310102030405.25Z";
  CHECK(other.read()->time == "2031-01-02T03:04:05Z");
  other.time = "310102030405Z";
  CHECK_FALSE(other.read().ok());
  other = {};
  other.hash = "2b0e03021a";  // SHA-1
  CHECK(other.read().error().problem == "is not of a SHA-256");
  other = {};
  other.digest = std::string(40, '7');
  CHECK_FALSE(other.read().ok());
  other = {};
  other.content = "2a864886f70d010701";  // data, not TSTInfo
  CHECK_FALSE(other.read().ok());
  const Bytes refused = der(0x30, {der(0x30, {der(0x02, {hex("02")})})});
  CHECK(read_time_stamp(refused, "a").error().problem == "is no time stamp (RFC 3161), or a request that was refused");
  for (const char* broken : {"", "30", "3080", "3085ffffffffff", "3084ffffffff", "30820100", "3003020101"})
    CHECK_FALSE(read_time_stamp(hex(broken), "a").ok());
  for (const char* none :
       {"20311302030405Z", "20310002030405Z", "20310132030405Z", "20310102240405Z", "20310102036005Z",
        "20310102030461Z", "20310102030405,5Z", "20310102030405.Z", "20310102030405.5x5Z"}) {
    other = {};
    other.time = none;
    CHECK_FALSE(other.read().ok());
  }
}

}  // namespace time_stamp_test
