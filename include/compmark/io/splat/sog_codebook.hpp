// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The two tables that a SOG file replaces numbers by (docs/splat_formats.md): 256 numbers for scales, colours and
// harmonics, and a palette of sets of harmonics. Both by k-means (Lloyd 1982): numbers over their sorted values, sets
// in a tree of groups of 32. Sums are taken in the order of the rows, so that the same table gives the same bits at any
// number of threads. Cost: a sort; of a palette, 32 distances a splat, level of the tree and iteration.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "compmark/core/executor.hpp"
#include "compmark/io/splat/splat_rounding.hpp"

namespace compmark {

namespace detail {

/// At most `entries` numbers, in ascending order, that are near to `values`: where there are as few different ones,
/// those.
[[nodiscard]] inline std::vector<float> number_codebook(std::vector<float> values, std::size_t entries) {
  std::sort(values.begin(), values.end());
  std::vector<float> different;
  for (const float value : values) {
    if (different.empty() || value != different.back()) different.push_back(value);
    if (different.size() > entries) break;
  }
  if (different.size() <= entries) return different;

  std::vector<double> sum(values.size() + 1, 0.0);
  for (std::size_t i = 0; i < values.size(); ++i) sum[i + 1] = sum[i] + static_cast<double>(values[i]);
  // Begun half by equal counts and half by equal widths: the dense middle and the far ends both have entries.
  std::vector<double> centers;
  const double low = static_cast<double>(values.front()), high = static_cast<double>(values.back());
  for (std::size_t k = 0; k < entries; ++k) {
    const double place = (static_cast<double>(k / 2) + 0.5) / std::ceil(static_cast<double>(entries) / 2);
    centers.push_back(k % 2 == 0 ? static_cast<double>(
                                       values[static_cast<std::size_t>(place * static_cast<double>(values.size() - 1))])
                                 : low + place * (high - low));
  }
  std::sort(centers.begin(), centers.end());
  constexpr int most_iterations = 100;
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    bool moved = false;
    std::size_t begin = 0;
    for (std::size_t k = 0; k < entries; ++k) {
      std::size_t end = values.size();
      if (k + 1 < entries) {
        const double border = (centers[k] + centers[k + 1]) / 2;
        end = static_cast<std::size_t>(
            std::upper_bound(values.begin() + static_cast<std::ptrdiff_t>(begin), values.end(), border,
                             [](double x, float value) { return x < static_cast<double>(value); }) -
            values.begin());
      }
      if (end > begin) {
        const double mean = (sum[end] - sum[begin]) / static_cast<double>(end - begin);
        moved = moved || mean != centers[k];
        centers[k] = mean;
      }
      begin = end;
    }
    std::sort(centers.begin(), centers.end());
    if (!moved) break;
  }
  std::vector<float> codebook;
  for (const double center : centers) codebook.push_back(static_cast<float>(center));
  return codebook;
}

/// The index of the nearest number of a codebook in ascending order.
[[nodiscard]] inline std::uint8_t nearest_code(const std::vector<float>& codebook, float value) {
  const auto above = std::lower_bound(codebook.begin(), codebook.end(), value);
  if (above == codebook.begin()) return 0;
  const bool lower = above == codebook.end() || static_cast<double>(value) - static_cast<double>(above[-1]) <=
                                                    static_cast<double>(above[0]) - static_cast<double>(value);
  return static_cast<std::uint8_t>(above - codebook.begin() - (lower ? 1 : 0));
}

/// Sets of numbers and, of every row, which of them stands for it.
struct Palette {
  std::size_t width = 0;
  std::vector<float> sets;  ///< [entries][width]
  std::vector<std::uint32_t> label;
  [[nodiscard]] std::size_t entries() const { return width == 0 ? 0 : sets.size() / width; }
};

template <Executor E>
class PaletteBuilder {
 public:
  /// `rows`: [count][width].
  PaletteBuilder(std::span<const float> rows, std::size_t width, E& executor)
      : rows_(rows),
        width_(width),
        executor_(executor) {}

  [[nodiscard]] Palette build(std::size_t entries) {
    palette_.width = width_;
    std::vector<std::uint32_t> members(rows_.size() / width_);
    std::iota(members.begin(), members.end(), 0u);
    palette_.label.assign(members.size(), 0);
    if (!members.empty()) split(members, std::max<std::size_t>(entries, 1));
    return std::move(palette_);
  }

 private:
  static constexpr std::size_t branches = 32;
  static constexpr int iterations = 8;

  [[nodiscard]] const float* row(std::uint32_t member) const { return rows_.data() + member * width_; }
  void add_entry(std::span<const std::uint32_t> members, const float* set) {
    for (const std::uint32_t member : members) palette_.label[member] = static_cast<std::uint32_t>(palette_.entries());
    palette_.sets.insert(palette_.sets.end(), set, set + width_);
  }

  void split(std::span<const std::uint32_t> members, std::size_t entries) {
    if (entries >= members.size()) {
      for (std::size_t i = 0; i < members.size(); ++i) add_entry(members.subspan(i, 1), row(members[i]));
      return;
    }
    const std::size_t groups = std::min(entries, branches);
    std::vector<float> centers;
    const std::vector<std::uint32_t> group = cluster(members, groups, centers);
    std::vector<std::vector<std::uint32_t>> of(groups);
    for (std::size_t i = 0; i < members.size(); ++i) of[group[i]].push_back(members[i]);
    // Every group has an entry; the others go by the number of its members.
    std::size_t spare = entries - groups, left = members.size();
    for (std::size_t g = 0; g < groups; ++g) {
      if (of[g].empty()) continue;
      const std::size_t more = std::min(of[g].size() - 1, spare * of[g].size() / left);
      left -= of[g].size();
      spare -= more;
      if (more == 0) {
        add_entry(of[g], centers.data() + g * width_);
      } else {
        split(of[g], 1 + more);
      }
    }
  }

  /// Lloyd's iterations from rows at equal distances in the order of the members.
  [[nodiscard]] std::vector<std::uint32_t> cluster(std::span<const std::uint32_t> members, std::size_t groups,
                                                   std::vector<float>& centers) {
    centers.resize(groups * width_);
    for (std::size_t g = 0; g < groups; ++g) {
      const std::size_t at = (2 * g + 1) * members.size() / (2 * groups);
      std::copy_n(row(members[at]), width_, centers.data() + g * width_);
    }
    std::vector<std::uint32_t> group(members.size(), 0);
    std::vector<double> sum;
    std::vector<std::size_t> count;
    for (int iteration = 0; iteration < iterations; ++iteration) {
      executor_.for_chunks(members.size(), 2048, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i) group[i] = nearest(row(members[i]), groups, centers.data());
      });
      sum.assign(groups * width_, 0.0);
      count.assign(groups, 0);
      for (std::size_t i = 0; i < members.size(); ++i) {
        const float* const values = row(members[i]);
        double* const to = sum.data() + group[i] * width_;
        for (std::size_t k = 0; k < width_; ++k) to[k] += static_cast<double>(values[k]);
        ++count[group[i]];
      }
      for (std::size_t g = 0; g < groups; ++g) {
        if (count[g] == 0) continue;
        for (std::size_t k = 0; k < width_; ++k)
          centers[g * width_ + k] = static_cast<float>(sum[g * width_ + k] / static_cast<double>(count[g]));
      }
    }
    return group;
  }
  [[nodiscard]] std::uint32_t nearest(const float* values, std::size_t groups, const float* centers) const {
    float least = std::numeric_limits<float>::infinity();
    std::uint32_t found = 0;
    for (std::size_t g = 0; g < groups; ++g) {
      const float* const center = centers + g * width_;
      float distance = 0;
      for (std::size_t k = 0; k < width_; ++k) distance += (values[k] - center[k]) * (values[k] - center[k]);
      if (distance < least) {
        least = distance;
        found = static_cast<std::uint32_t>(g);
      }
    }
    return found;
  }

  std::span<const float> rows_;
  std::size_t width_;
  E& executor_;
  Palette palette_;
};

/// Entries of the palette of so many splats: a power of two near their number, 65,536 at most.
[[nodiscard]] inline std::size_t usual_palette(std::size_t splats) {
  std::size_t entries = 1024;
  while (entries < 65536 && 2 * entries <= splats) entries *= 2;
  return std::min(entries, splats);
}

}  // namespace detail

}  // namespace compmark
