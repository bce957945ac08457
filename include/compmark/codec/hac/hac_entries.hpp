// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The anchors that HacModel evaluates in an iteration. An entry is an anchor: first those that need only their steps
// ("light"), then, from the next whole panel on, those whose rate is counted ("full"). The sample is drawn row by row,
// keyed by seed and iteration, from all rows of the table or from the listed ones. With masks of anchors it includes
// masked anchors, else only unmasked ones (docs/spec/compression.md, 1.7; HAC++). Cost: one pass over the rows, 2 ns a
// random number.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/codec/rate/offset_mask.hpp"
#include "compmark/codec/rate/rate.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"
#include "compmark/core/random.hpp"
#include "compmark/core/views.hpp"

namespace compmark {

struct HacSample {
  double share = 0;         ///< of the candidates; 0: none
  bool everywhere = false;  ///< all rows are candidates, else the listed ones
  bool masked = true;       ///< masked anchors too
};

struct HacEntries {
  static constexpr std::size_t panel = 64;
  std::size_t light = 0, full = 0, first_full = 0, capacity = 0;
  Buffer<std::uint8_t> mark;  ///< [N] bit 0 listed, bit 1 sampled
  Buffer<std::uint32_t> row;  ///< [capacity] of the anchor table; padding of panels is meaningless

  [[nodiscard]] bool visible(std::size_t entry) const { return (mark[row[entry]] & 1) != 0; }

  /// Fills all of it, and the report's sample and unmasked share: of the sample, or, where masked anchors are left out,
  /// of the candidates.
  template <class T>
  void draw(std::span<const std::uint32_t> rows, const HacSample& sample, const RatePhase& phase,
            MatrixView<const T> mask, RateReport& report) {
    const std::size_t anchors = mask.rows;
    std::size_t candidates = 0, unmasked = 0, both = 0;
    full = 0;
    mark.resize(anchors, std::uint8_t{0});
    for (const std::uint32_t r : rows) mark[r] = 1;
    if (sample.share > 0) {
      const Random random(phase.seed, phase.iteration, random_stage("hac sample"));
      const auto consider = [&](std::size_t r, bool drawn) {
        if (!drawn && sample.masked) return;
        const bool coded = any_unmasked(mask.row(r), mask.columns);
        unmasked += coded ? 1 : 0;
        if (!drawn || (!coded && !sample.masked)) return;
        both += mark[r];
        mark[r] |= 2;
        ++full;
      };
      // The numbers of a block first: without a branch between them they are drawn side by side.
      const auto consider_all = [&](std::size_t count, const auto& row_at) {
        std::array<std::uint8_t, panel> drawn;
        for (std::size_t begin = 0; begin < count; begin += panel) {
          const std::size_t n = std::min(panel, count - begin);
          for (std::size_t i = 0; i < n; ++i) drawn[i] = random.uniform(row_at(begin + i)) < sample.share ? 1 : 0;
          for (std::size_t i = 0; i < n; ++i) consider(row_at(begin + i), drawn[i] != 0);
        }
        candidates = count;
      };
      if (sample.everywhere) {
        consider_all(anchors, [](std::size_t i) { return i; });
      } else {
        consider_all(rows.size(), [&](std::size_t i) { return std::size_t{rows[i]}; });
      }
    }
    report.sampled = full;
    const std::size_t among = sample.masked ? full : candidates;
    report.unmasked_share = among == 0 ? 0 : static_cast<double>(unmasked) / static_cast<double>(among);

    light = rows.size() - both;
    first_full = chunk_count(light, panel) * panel;
    capacity = first_full + chunk_count(full, panel) * panel;
    row.resize(capacity);
    std::size_t next_light = 0, next_full = first_full;
    for (const std::uint32_t r : rows) {
      const std::size_t sampled = mark[r] >> 1;
      row[sampled != 0 ? next_full : next_light] = r;
      next_full += sampled;
      next_light += 1 - sampled;
    }
    if (!sample.everywhere) return;
    for (std::size_t r = 0; r < anchors; ++r) {
      if (mark[r] == 2) row[next_full++] = static_cast<std::uint32_t>(r);
    }
  }
};

}  // namespace compmark
