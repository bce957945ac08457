// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Stable radix sort of (depth, index) pairs. Depths are positive (docs/spec/numerics.md, PR1), so their bits compare as
// unsigned integers; the smallest key is subtracted and only the bits that differ are sorted: two or three passes of at
// most 12 bits for one scene in float. A stable sort has one result, whatever the number of threads: ties stay in input
// order (docs/spec/numerics.md, TB4). All bits take part (TB5).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>

#include "compmark/core/buffer.hpp"
#include "compmark/core/executor.hpp"

namespace compmark {

template <class T>
using DepthKey = std::conditional_t<sizeof(T) == 4, std::uint32_t, std::uint64_t>;

template <class T>
struct DepthEntry {
  DepthKey<T> key;
  std::uint32_t index;
};

/// Scratch of the sort and its input: chunk c holds `counts[c]` entries from `entries[c * grain]` on.
template <class T>
struct DepthSortWorkspace {
  Buffer<DepthEntry<T>> entries, other;
  Buffer<std::uint32_t> counts;
  Buffer<std::uint32_t> histogram;
};

namespace detail {

/// Histograms of a pass, and bits of a digit: few for few entries, where the scan over all counters would be the longer
/// part.
[[nodiscard]] constexpr std::size_t radix_groups(std::size_t total) {
  return std::min<std::size_t>(16, 1 + total / 4096);
}
[[nodiscard]] constexpr int radix_bits(std::size_t total) { return total < 8192 ? 8 : 12; }

}  // namespace detail

/// Sorts and packs the entries of all chunks to workspace.entries[0 .. result). [smallest, largest] bounds the keys.
/// Cost: 8 bytes read twice and written once an entry and pass.
template <class T, Executor E>
std::size_t depth_sort(DepthSortWorkspace<T>& workspace, std::size_t chunks, std::size_t grain, DepthKey<T> smallest,
                       DepthKey<T> largest, E& executor) {
  std::size_t total = 0;
  for (std::size_t c = 0; c < chunks; ++c) total += workspace.counts[c];
  workspace.other.resize(workspace.entries.size());
  if (total == 0) return 0;
  const int bits = std::max(1, static_cast<int>(std::bit_width(static_cast<DepthKey<T>>(largest - smallest))));
  const std::size_t groups = detail::radix_groups(total);
  const int passes = (bits + detail::radix_bits(total) - 1) / detail::radix_bits(total);
  const int digit_bits = (bits + passes - 1) / passes;
  const std::size_t digits = std::size_t{1} << digit_bits;
  const DepthKey<T> mask = static_cast<DepthKey<T>>(digits - 1);
  workspace.histogram.resize(groups * digits);
  std::uint32_t* const histogram = workspace.histogram.data();

  for (int pass = 0; pass < passes; ++pass) {
    const int shift = pass * digit_bits;
    const DepthEntry<T>* const from = workspace.entries.data();
    DepthEntry<T>* const to = workspace.other.data();
    // Pass 0 reads the chunks with their gaps, the later passes a dense array: both are lists of runs, dealt to fixed
    // groups.
    const std::size_t runs = pass == 0 ? chunks : groups;
    const std::size_t run_stride = pass == 0 ? grain : chunk_count(total, groups);
    const std::size_t runs_per_group = chunk_count(runs, groups);
    const auto each_entry = [&](std::size_t group, const auto& visit) {
      for (std::size_t run = group * runs_per_group; run < std::min(runs, (group + 1) * runs_per_group); ++run) {
        const std::size_t begin = run * run_stride;
        const std::size_t length =
            pass == 0 ? workspace.counts[run] : (begin < total ? std::min(run_stride, total - begin) : 0);
        for (const DepthEntry<T>& entry : std::span<const DepthEntry<T>>(from + begin, length)) {
          visit(entry, static_cast<std::size_t>(((entry.key - smallest) >> shift) & mask));
        }
      }
    };
    executor.for_chunks(groups, 1, [&](std::size_t group, std::size_t, std::size_t) {
      std::uint32_t* const mine = histogram + group * digits;
      std::fill(mine, mine + digits, 0u);
      each_entry(group, [&](const DepthEntry<T>&, std::size_t digit) { ++mine[digit]; });
    });
    std::uint32_t sum = 0;
    for (std::size_t digit = 0; digit < digits; ++digit) {
      for (std::size_t group = 0; group < groups; ++group) {
        sum += std::exchange(histogram[group * digits + digit], sum);
      }
    }
    executor.for_chunks(groups, 1, [&](std::size_t group, std::size_t, std::size_t) {
      std::uint32_t* const mine = histogram + group * digits;
      each_entry(group, [&](const DepthEntry<T>& entry, std::size_t digit) { to[mine[digit]++] = entry; });
    });
    std::swap(workspace.entries, workspace.other);
  }
  return total;
}

}  // namespace compmark
