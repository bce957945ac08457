// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "compmark/codec/coder/slot_tables.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <set>
#include <vector>

#include "compmark/core/random.hpp"

namespace {

using namespace compmark;

/// 2 window + 2 slots; narrow ones and wide ones beside each other.
std::vector<std::uint32_t> random_bounds(std::uint64_t seed, int window) {
  const Random random(seed, 0, random_stage("slot tables"));
  std::set<std::uint32_t> bounds{0xffff};
  for (std::uint64_t i = 0; bounds.size() < static_cast<std::size_t>(2 * window + 2); ++i) {
    const std::uint64_t bits = random.bits(i);
    bounds.insert(static_cast<std::uint32_t>(i % 3 == 0 ? bits & 0xffff : 30'000 + (bits & 255)));
  }
  return {bounds.begin(), bounds.end()};
}

TEST_CASE("coder/slot_tables: every number is in the slot whose interval it lies in, with any search, in every row") {
  SlotTables tables;
  std::vector<std::vector<std::uint32_t>> rows;
  for (const int window : {0, 1, 15, 100}) {
    for (const int search_bits : {1, 4, 8, 12, 16}) {
      rows.push_back(random_bounds(rows.size(), window));
      tables.append(rows.back(), window, search_bits);
    }
  }
  REQUIRE(tables.tables().size() == rows.size());
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const SlotTables::Table& table = tables.tables()[r];
    std::uint32_t slot = 0, total = 0;
    for (std::uint32_t number = 0; number < 65536; ++number) {
      while (rows[r][slot] < number) ++slot;  // the definition
      REQUIRE(tables.slot_of(table, number) == slot);
    }
    for (std::uint32_t s = 0; s < rows[r].size(); ++s) {
      const SlotTables::Interval interval = tables.interval(table, s);
      REQUIRE(interval.start == total);
      REQUIRE(interval.frequency > 0);
      REQUIRE(tables.bound(table, s) == rows[r][s]);
      total += interval.frequency;
    }
    CHECK(total == 65536);
  }
}

TEST_CASE("coder/slot_tables: symbols outside the window escape, however far; a mirrored bin counts downwards") {
  SlotTables tables;
  tables.append(random_bounds(1, 2), 2, 4);
  const SlotTables::Table* const table = tables.tables().data();
  const SlotTables::Place up{table, 10, 0}, down{table, 10, -1};
  for (std::int32_t symbol = 8; symbol <= 12; ++symbol) {
    CHECK(SlotTables::slot_at(up, symbol) == static_cast<std::uint32_t>(symbol - 8));
    CHECK(SlotTables::slot_at(down, symbol) == static_cast<std::uint32_t>(12 - symbol));
  }
  for (const std::int32_t symbol : {7, 13, -2147483647 - 1, 2147483647}) {
    CHECK(SlotTables::slot_at(up, symbol) == 5);
    CHECK(SlotTables::slot_at(down, symbol) == 5);
  }
}

}  // namespace
