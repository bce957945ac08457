// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/coder/varint.hpp"

#include <doctest/doctest.h>

#include <limits>
#include <vector>

namespace {

using namespace compmark;

std::optional<std::uint64_t> read(std::vector<std::uint8_t> bytes) {
  std::span<const std::uint8_t> rest = bytes;
  return take_varint(rest);
}

}  // namespace

TEST_CASE("coder/varint: every size comes back, one after another (EN8)") {
  std::vector<std::uint64_t> values{0, 1, 127, 128, 16383, 16384, std::numeric_limits<std::uint64_t>::max()};
  for (int shift = 0; shift < 64; ++shift) values.push_back((std::uint64_t{1} << shift) + 3);
  std::vector<std::uint8_t> bytes;
  std::size_t size = 0;
  for (const std::uint64_t value : values) {
    put_varint(bytes, value);
    size += static_cast<std::size_t>(varint_size(value));
    REQUIRE(bytes.size() == size);
  }
  std::span<const std::uint8_t> rest = bytes;
  for (const std::uint64_t value : values) REQUIRE(take_varint(rest) == value);
  CHECK(rest.empty());
  CHECK(!take_varint(rest));
}

TEST_CASE("coder/varint: a number has one spelling, and what does not end or does not fit is refused") {
  CHECK(read({0x80, 0x01}) == 128u);
  CHECK(!read({0x80, 0x00}));                         // zero in two bytes
  CHECK(!read({0xff}));                               // cut off
  CHECK(!read(std::vector<std::uint8_t>(20, 0x80)));  // no end
  CHECK(!read({0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x02}));
  CHECK(read({0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x01}) ==
        std::numeric_limits<std::uint64_t>::max());
}

TEST_CASE("coder/varint: zig-zag is total") {
  using Limits = std::numeric_limits<std::int64_t>;
  for (const std::int64_t value : {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1}, std::int64_t{-2}, Limits::min(),
                                   Limits::max(), std::int64_t{-2147483648}}) {
    CHECK(unzigzag(zigzag(value)) == value);
  }
  CHECK(zigzag(0) == 0);
  CHECK(zigzag(-1) == 1);
  CHECK(zigzag(1) == 2);
  CHECK(zigzag(Limits::min()) == std::numeric_limits<std::uint64_t>::max());
  // Negative control: a sign and twice a magnitude, in 32 bits: the least number has the code of 0.
  const std::int64_t least = std::numeric_limits<std::int32_t>::min();
  CHECK(static_cast<std::uint32_t>(2 * -least) == 0);
}
