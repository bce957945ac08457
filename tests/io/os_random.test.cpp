// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <array>
#include <bit>
#include <compmark/io/os_random.hpp>
#include <cstdint>
#include <set>
#include <vector>

using namespace compmark;

TEST_CASE("io/os_random: all bytes are drawn, and no two draws agree") {
  for (const bool device : {false, true}) {
    std::set<std::array<std::byte, 32>> seen;
    for (int i = 0; i < 50; ++i) {
      std::array<std::byte, 32> secret{};
      REQUIRE((device ? device_random(secret) : os_random(secret)).ok());
      seen.insert(secret);
    }
    CHECK(seen.size() == 50);
    std::vector<std::byte> many(100000);
    REQUIRE((device ? device_random(many) : os_random(many)).ok());
    std::size_t ones = 0;
    for (const std::byte value : many)
      ones += static_cast<std::size_t>(std::popcount(std::to_integer<unsigned>(value)));
    CHECK(ones > 400000 - 6 * 448);  // standard deviation of 800,000 fair bits: 447
    CHECK(ones < 400000 + 6 * 448);
  }
}

TEST_CASE("io/os_random: a source that is missing or runs dry is an error") {
  std::array<std::byte, 32> secret{};
  const Result<Done> missing = device_random(secret, "/nonexistent/random");
  REQUIRE_FALSE(missing.ok());
  CHECK(missing.error().file == "/nonexistent/random");
  CHECK_FALSE(device_random(secret, "/dev/null").ok());
}
