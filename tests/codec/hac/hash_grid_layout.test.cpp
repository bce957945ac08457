// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/hac/hash_grid_layout.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <set>

namespace {
using namespace compmark;
constexpr HashGridShape published{};
}  // namespace

TEST_CASE("hac/hash_grid_layout: the published sizes: 96 channels, 95 944 + 3 x 115 208 entries, 1 766 272 bits") {
  static_assert(published.valid() && quarter_hash_grid.valid());
  static_assert(published.channels() == 96 && quarter_hash_grid.channels() == 96);
  static_assert(published.entries() == 95944 + 3 * 115208);
  static_assert(published.bits() == 1766272);
  static_assert(quarter_hash_grid.bits() == 491520);
  static_assert(published.level(12).first == 95944 && published.level(16).first == 95944 + 115208);
  static_assert(published.level(0).dense && !published.level(1).dense);
  static_assert(published.level(12).dense && !published.level(13).dense);
  static_assert(!HashGridShape{.volume_levels = 13}.valid());
  static_assert(!HashGridShape{.volume_levels = 0, .plane_levels = 0}.valid());
  CHECK(published.level(17).axis[0] == 0);
  CHECK(published.level(17).axis[1] == 2);
  CHECK(published.level(23).axis[0] == 1);
  CHECK(published.level(23).axis[1] == 2);
}

TEST_CASE("hac/hash_grid_layout: every entry lies in its level; a dense level has no two vertices in one entry") {
  for (int index = 0; index < published.levels(); ++index) {
    const HashGridLevel level = hash_grid_levels<published>[static_cast<std::size_t>(index)];
    const auto last = static_cast<std::uint32_t>(level.resolution - 2);
    std::set<std::uint32_t> seen;
    std::size_t vertices = 0;
    const std::uint32_t step = level.dense ? 1 : 37;
    for (std::uint32_t i = 1; i <= last; i += step) {
      for (std::uint32_t j = 1; j <= last; j += step) {
        for (std::uint32_t k = 1; k <= (level.dimensions == 3 ? last : 1); k += step) {
          const std::uint32_t entry = level.entry(i, j, k);
          REQUIRE(entry >= level.first);
          REQUIRE(entry < level.first + level.entries);
          if (level.dense) seen.insert(entry);
          ++vertices;
        }
      }
    }
    if (level.dense) CHECK(seen.size() == vertices);
  }
}

TEST_CASE("hac/hash_grid_layout: hashed entries are those of the published hash, modulo in 32 bits") {
  const HashGridLevel level = published.level(11);
  for (std::uint32_t i = 1; i < 513; i += 51) {
    const std::uint64_t j = 513 - i, k = (i * 7) % 513;
    const std::uint64_t hash = i ^ ((j * 2654435761ull) & 0xFFFFFFFFull) ^ ((k * 805459861ull) & 0xFFFFFFFFull);
    CHECK(level.entry(i, static_cast<std::uint32_t>(j), static_cast<std::uint32_t>(k)) ==
          level.first + static_cast<std::uint32_t>(hash % 8192));
  }
  CHECK(level.clamped(0) == 1);
  CHECK(level.clamped(513) == 512);
  CHECK(level.clamped(7) == 7);
}

TEST_CASE("hac/hash_grid_layout: a grid that a few bytes of a file name takes no gigabyte") {
  HashGridShape shape;
  CHECK(shape.valid());
  shape.volume_cap_log2 = 24;
  for (int& resolution : shape.volume_resolution) resolution = 60'000;
  CHECK(shape.entries() > std::size_t{1} << 26);
  CHECK_FALSE(shape.valid());
}
