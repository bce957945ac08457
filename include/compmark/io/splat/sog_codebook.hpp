// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The two tables that a SOG file replaces numbers by (docs/splat_formats.md): 256 numbers for scales, colours and
// harmonics, and a palette of sets of harmonics. Both by k-means (Lloyd 1982): numbers over their sorted values, sets
// within the cells of a tree that halves the splats (median cut, Heckbert 1982) until a cell has 32 sets. Sums are
// taken in the order of the rows, so that the same table gives the same bits at any number of threads. Cost: a sort; of
// a palette, a pass a level of the tree, and 32 distances a splat and iteration.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
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

  /// At most so many entries; fewer where rows are alike.
  [[nodiscard]] Palette build(std::size_t entries) {
    std::vector<std::uint32_t> members(rows_.size() / width_);
    std::iota(members.begin(), members.end(), 0u);
    cells_.clear();
    if (!members.empty()) divide(members, std::max<std::size_t>(entries, 1));
    executor_.for_chunks(cells_.size(), 1, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) cluster(cells_[i]);
    });
    Palette palette;
    palette.width = width_;
    palette.label.resize(members.size());
    for (const Cell& cell : cells_) {
      const std::uint32_t first = static_cast<std::uint32_t>(palette.entries());
      for (std::size_t i = 0; i < cell.members.size(); ++i) palette.label[cell.members[i]] = first + cell.group[i];
      palette.sets.insert(palette.sets.end(), cell.centers.begin(), cell.centers.end());
    }
    return palette;
  }

 private:
  static constexpr std::size_t most_in_cell = 32;
  static constexpr int iterations = 10;
  using Members = std::vector<std::uint32_t>;
  struct Cell {
    Members members;
    std::size_t entries = 0;
    std::vector<float> centers;        ///< [entries][width]
    std::vector<std::uint32_t> group;  ///< of every member
  };

  [[nodiscard]] const float* row(std::uint32_t member) const { return rows_.data() + member * width_; }

  void divide(const Members& members, std::size_t entries) {
    const std::optional<std::array<Members, 2>> half = entries > most_in_cell ? halves(members) : std::nullopt;
    if (!half) {
      cells_.push_back({members, entries, {}, {}});
      return;
    }
    divide((*half)[0], entries / 2);
    divide((*half)[1], entries - entries / 2);
  }

  /// The members by the median of the component that varies most; nothing where all are alike.
  [[nodiscard]] std::optional<std::array<Members, 2>> halves(const Members& members) const {
    std::vector<double> sum(width_, 0.0), square(width_, 0.0);
    const float* const first = row(members[0]);
    for (const std::uint32_t member : members) {
      for (std::size_t k = 0; k < width_; ++k) {
        const double x = static_cast<double>(row(member)[k]) - static_cast<double>(first[k]);
        sum[k] += x;
        square[k] += x * x;
      }
    }
    std::size_t widest = 0;
    double most = 0;
    for (std::size_t k = 0; k < width_; ++k) {
      const double spread = square[k] - sum[k] * sum[k] / static_cast<double>(members.size());
      if (spread <= most) continue;
      most = spread;
      widest = k;
    }
    if (!(most > 0)) return std::nullopt;
    std::vector<float> values;
    for (const std::uint32_t member : members) values.push_back(row(member)[widest]);
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    const float median = *middle;
    std::array<Members, 2> half;
    for (const std::uint32_t member : members) half[row(member)[widest] < median ? 0 : 1].push_back(member);
    if (half[0].empty()) {  // the median is the least: it alone is one half
      half[1].clear();
      for (const std::uint32_t member : members) half[row(member)[widest] > median ? 1 : 0].push_back(member);
    }
    if (half[0].empty() || half[1].empty()) return std::nullopt;
    return half;
  }

  /// Means of the cells that further halving gives, to begin Lloyd's iterations with.
  void seeds(const Members& members, std::size_t entries, std::vector<float>& centers) const {
    const std::optional<std::array<Members, 2>> half = entries > 1 ? halves(members) : std::nullopt;
    if (half) {
      seeds((*half)[0], entries / 2, centers);
      seeds((*half)[1], entries - entries / 2, centers);
      return;
    }
    std::vector<double> sum(width_, 0.0);
    for (const std::uint32_t member : members) {
      for (std::size_t k = 0; k < width_; ++k) sum[k] += static_cast<double>(row(member)[k]);
    }
    for (const double x : sum) centers.push_back(static_cast<float>(x / static_cast<double>(members.size())));
  }

  void cluster(Cell& cell) const {
    seeds(cell.members, cell.entries, cell.centers);
    const std::size_t groups = cell.centers.size() / width_;
    cell.group.assign(cell.members.size(), 0);
    std::vector<double> sum;
    std::vector<std::size_t> count;
    for (int iteration = 0; iteration < iterations; ++iteration) {
      bool moved = iteration == 0;
      for (std::size_t i = 0; i < cell.members.size(); ++i) {
        const std::uint32_t found = nearest(row(cell.members[i]), groups, cell.centers.data());
        moved = moved || found != cell.group[i];
        cell.group[i] = found;
      }
      if (!moved) return;
      sum.assign(groups * width_, 0.0);
      count.assign(groups, 0);
      for (std::size_t i = 0; i < cell.members.size(); ++i) {
        const float* const values = row(cell.members[i]);
        double* const to = sum.data() + cell.group[i] * width_;
        for (std::size_t k = 0; k < width_; ++k) to[k] += static_cast<double>(values[k]);
        ++count[cell.group[i]];
      }
      for (std::size_t g = 0; g < groups; ++g) {
        if (count[g] == 0) continue;
        for (std::size_t k = 0; k < width_; ++k)
          cell.centers[g * width_ + k] = static_cast<float>(sum[g * width_ + k] / static_cast<double>(count[g]));
      }
    }
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
  std::vector<Cell> cells_;
};

/// Entries of the palette of so many splats: a power of two near their number, 65,536 at most.
[[nodiscard]] inline std::size_t usual_palette(std::size_t splats) {
  std::size_t entries = 1024;
  while (entries < 65536 && 2 * entries <= splats) entries *= 2;
  return std::min(entries, splats);
}

}  // namespace detail

}  // namespace compmark
