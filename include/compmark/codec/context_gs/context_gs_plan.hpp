// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Which anchors ContextGS looks at in an iteration, and in which order. Wanted are the visible unmasked ones, for their
// steps, and a random share of all, for their rate; either kind needs the noisy attributes of its parent, and so the
// parent's own step, and so on. An anchor that is looked at is an entry: level 2 first, then 1, then 0, and in a level
// first those that need steps alone ("light"), from the next whole panel of 64 on those whose rate is counted ("full");
// each group in row order. Children are listed by parent in the order of entries, so that sums over them have one
// order. Cost: some ten reads of each anchor's level.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/codec/context_gs/anchor_levels.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"

namespace compmark {

struct ContextGsPlan {
  static constexpr std::size_t panel = 64;
  static constexpr std::uint8_t visible = 1, full_rate = 2, needed = 4;  ///< marks of a row; 0: not looked at
  struct Section {
    std::size_t first = 0, count = 0;
    [[nodiscard]] std::size_t panels() const { return chunk_count(count, panel); }
  };

  std::array<Section, 3> light{}, full{};   ///< entries of a level
  std::array<std::size_t, 3> first_rate{};  ///< where a level's full entries begin in tables of full entries alone
  std::size_t capacity = 0, coarse = 0;     ///< entries, empty ones of last panels included; of levels 2 and 1 alone
  std::size_t rates = 0;                    ///< full entries, empty ones of last panels included
  std::size_t drawn = 0, drawn_unmasked = 0, visible_unmasked = 0;
  Buffer<std::uint8_t> mark;          ///< [N]
  Buffer<std::uint32_t> entry;        ///< [N] of a marked row
  Buffer<std::uint32_t> row, parent;  ///< [capacity] the parent's entry, or AnchorLevels::none
  Buffer<std::uint32_t> child_begin,
      child;  ///< children of entry p < coarse: child[child_begin[p]] … child[child_begin[p + 1] - 1]

  /// Panels of a level: the light ones, then the full ones.
  [[nodiscard]] std::size_t panels(std::size_t level) const { return light[level].panels() + full[level].panels(); }
  [[nodiscard]] bool is_full(std::size_t level, std::size_t p) const { return p >= light[level].panels(); }
  [[nodiscard]] Section panel_at(std::size_t level, std::size_t p) const {
    const Section& section = is_full(level, p) ? full[level] : light[level];
    const std::size_t at = (is_full(level, p) ? p - light[level].panels() : p) * panel;
    return {section.first + at, section.count - at < panel ? section.count - at : panel};
  }
  /// The place of a full entry among full ones.
  [[nodiscard]] std::size_t rate_of(std::size_t level, std::size_t e) const {
    return e - full[level].first + first_rate[level];
  }

  /// `share` of all anchors is drawn for the rate; masked ones among them are counted as drawn and not looked at.
  void build(const AnchorLevels& levels, std::span<const std::uint32_t> rows, const Random& random, double share) {
    const std::span<const std::uint8_t> level = levels.level();
    const std::span<const std::uint32_t> parent_row = levels.parent();
    const std::size_t n = level.size();
    mark.resize(n, std::uint8_t{0});
    drawn = drawn_unmasked = visible_unmasked = 0;
    for (const std::uint32_t r : rows) {
      if (level[r] == AnchorLevels::masked) continue;
      mark[r] = visible;
      ++visible_unmasked;
    }
    for (std::size_t r = 0; share > 0 && r < n; ++r) {
      if (!(random.uniform(r) < share)) continue;
      ++drawn;
      if (level[r] == AnchorLevels::masked) continue;
      mark[r] |= full_rate;
      ++drawn_unmasked;
    }
    for (std::size_t r = 0; r < n; ++r) {
      if (mark[r] == 0) continue;
      for (std::uint32_t p = parent_row[r]; p != AnchorLevels::none && (mark[p] & needed) == 0; p = parent_row[p]) {
        mark[p] |= needed;
      }
    }

    light = full = {};
    for (std::size_t r = 0; r < n; ++r) {
      if (mark[r] != 0) ++section_of(level[r], mark[r]).count;
    }
    std::size_t at = 0;
    rates = 0;
    for (std::size_t l = 3; l-- > 0;) {
      if (l == 0) coarse = at;
      light[l].first = at;
      at += light[l].panels() * panel;
      full[l].first = at;
      at += full[l].panels() * panel;
      first_rate[l] = rates;
      rates += full[l].panels() * panel;
    }
    capacity = at;
    entry.resize(n);
    row.resize(capacity, 0u);
    parent.resize(capacity, AnchorLevels::none);
    std::array<std::size_t, 6> next{};
    for (std::size_t l = 0; l < 3; ++l) {
      next[2 * l] = light[l].first;
      next[2 * l + 1] = full[l].first;
    }
    for (std::size_t r = 0; r < n; ++r) {
      if (mark[r] == 0) continue;
      std::size_t& e = next[2 * level[r] + ((mark[r] & full_rate) != 0 ? 1 : 0)];
      entry[r] = static_cast<std::uint32_t>(e);
      row[e++] = static_cast<std::uint32_t>(r);
    }
    list_children(parent_row);
  }

 private:
  Section& section_of(std::uint8_t level, std::uint8_t marks) {
    return (marks & full_rate) != 0 ? full[level] : light[level];
  }
  /// body(e) for the entries of levels 1 and 0, in order.
  template <class Body>
  void for_children(const Body& body) const {
    for (const std::size_t l : {std::size_t{1}, std::size_t{0}}) {
      for (const Section& section : {light[l], full[l]}) {
        for (std::size_t e = section.first; e < section.first + section.count; ++e) body(e);
      }
    }
  }
  void list_children(std::span<const std::uint32_t> parent_row) {
    child_begin.resize(coarse + 2, 0u);
    std::size_t children = 0;
    for_children([&](std::size_t e) {
      parent[e] = entry[parent_row[row[e]]];
      ++child_begin[parent[e] + 2];
      ++children;
    });
    for (std::size_t p = 2; p < coarse + 2; ++p) child_begin[p] += child_begin[p - 1];
    child.resize(children);
    for_children([&](std::size_t e) { child[child_begin[parent[e] + 1]++] = static_cast<std::uint32_t>(e); });
  }
};

}  // namespace compmark
