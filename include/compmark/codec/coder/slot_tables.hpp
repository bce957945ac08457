// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Tables of cumulative frequencies, 2^16 in all, as rows of slots with a search: what the Gaussian tables and those of
// the hyperprior share, so that one symbol coder serves both. The search is a look-up by the upper bits of a number and
// a few steps; how many bits it has is a matter of speed and memory, not of the format.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace compmark {

class SlotTables {
 public:
  static constexpr int precision = 16;  ///< bits of a frequency

  /// One row of slots. Slot numbers run from 0 to 2 window + 1; the last is the escape.
  struct Table {
    std::uint32_t first;  ///< of the search: entry [x >> shift] is a slot at or before that of the number x
    std::uint32_t
        bounds;  ///< entry [i] is the last number of slot i; entry [-1] is 2^16 - 1, which wraps to 0 when 1 is added
    std::int32_t window;
    std::uint32_t shift;
  };
  /// Where a symbol model puts its symbols: symbol = centre + (k ^ mirror) - mirror for the bin k = slot - window of
  /// the table.
  struct Place {
    const Table* table;
    std::int64_t centre;
    std::int64_t mirror;  ///< 0, or -1 where the mean lies below the centre of its bin
  };
  struct Interval {
    std::uint32_t start;
    std::uint32_t frequency;
  };

  /// Adds a row. `bounds` [2 window + 2]: the last number of each slot, rising, the last of them 2^16 - 1.
  /// `search_bits` in 1 to 16: 2^search_bits entries of two bytes.
  void append(std::span<const std::uint32_t> bounds, int window, int search_bits) {
    Table table{};
    table.window = window;
    table.shift = static_cast<std::uint32_t>(precision - search_bits);
    table.first = static_cast<std::uint32_t>(numbers_.size());
    std::uint16_t slot = 0;
    for (std::uint32_t bucket = 0; bucket < 1u << search_bits; ++bucket) {
      while (bounds[slot] < bucket << table.shift) ++slot;
      numbers_.push_back(slot);
    }
    numbers_.push_back(0xffff);
    table.bounds = static_cast<std::uint32_t>(numbers_.size());
    for (const std::uint32_t bound : bounds) numbers_.push_back(static_cast<std::uint16_t>(bound));
    tables_.push_back(table);
  }

  [[nodiscard]] std::span<const Table> tables() const { return tables_; }

  [[nodiscard]] Interval interval(const Table& table, std::uint32_t slot) const {
    const std::uint16_t* bounds = numbers_.data() + table.bounds;
    const auto start = static_cast<std::uint16_t>(bounds[static_cast<std::ptrdiff_t>(slot) - 1] + 1);
    return {start, static_cast<std::uint32_t>(bounds[slot] - start + 1)};
  }

  /// The slot of a number below 2^16: a look-up, two steps without a branch, and seldom more.
  [[nodiscard]] std::uint32_t slot_of(const Table& table, std::uint32_t number) const {
    const std::uint16_t* bounds = numbers_.data() + table.bounds;
    std::uint32_t slot = numbers_[table.first + (number >> table.shift)];
    slot += bounds[slot] < number;
    slot += bounds[slot] < number;
    while (bounds[slot] < number) ++slot;
    return slot;
  }

  /// The slot of a symbol; 2 window + 1 outside the window.
  [[nodiscard]] static std::uint32_t slot_at(const Place& at, std::int32_t symbol) {
    const std::int64_t bin = ((symbol - at.centre) ^ at.mirror) - at.mirror + at.table->window;
    const auto escape = static_cast<std::uint64_t>(2 * at.table->window + 1);
    return static_cast<std::uint32_t>(std::min(static_cast<std::uint64_t>(bin), escape));
  }

  /// The last number of slot `slot`.
  [[nodiscard]] std::uint16_t bound(const Table& table, std::uint32_t slot) const {
    return numbers_[table.bounds + slot];
  }

 private:
  std::vector<Table> tables_;
  std::vector<std::uint16_t> numbers_;
};

}  // namespace compmark
