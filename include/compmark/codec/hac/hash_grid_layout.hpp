// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Where the entries of the mixed hash grid lie (HAC, ECCV 2024, section 4.2; docs/spec/compression.md, 1.1): one 3-D
// grid of 12 levels and three planes xy, xz, yz of 4 levels each, 4 features an entry, one table of all levels in that
// order, entry-major. A level of resolution R maps the box [0, 1] to p = t (R - 2) + 1/2; the vertices 0 and R - 1 do
// not exist, neighbours are clamped to 1 … R - 2 (the reference skips them and divides by the remaining weights, which
// is the same). Entries: dense while R^d fits the cap, else the XOR of coordinates times primes, modulo the cap. Shared
// by the training side in floats and the coding side in integers, so that they cannot differ.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace compmark {

/// One level of one grid.
struct HashGridLevel {
  int dimensions = 0;             ///< 3, or 2 for a plane
  std::array<int, 3> axis{};      ///< world axis of each grid axis; planes use two
  int resolution = 0;             ///< R, vertices along an axis, the two that do not exist included
  std::uint32_t entries = 0;      ///< of this level
  std::uint32_t first = 0;        ///< the level's first entry in the table of all levels
  bool dense = false;             ///< entries are numbered, else hashed
  std::uint32_t hash_mask = ~0u;  ///< entries - 1 of a hashed level

  /// Row of the table of all levels that holds this vertex; i2 is not read of a plane. Coordinates are below
  /// `resolution`.
  [[nodiscard]] constexpr std::uint32_t entry(std::uint32_t i0, std::uint32_t i1, std::uint32_t i2 = 0) const {
    const auto r = static_cast<std::uint32_t>(resolution);
    if (dense) return first + i0 + r * (dimensions == 3 ? i1 + r * i2 : i1);
    const std::uint32_t hash = i0 ^ (i1 * prime1) ^ (dimensions == 3 ? i2 * prime2 : 0u);
    return first + (hash & hash_mask);
  }
  /// A neighbour index in the range that exists.
  [[nodiscard]] constexpr int clamped(int i) const { return i < 1 ? 1 : (i > resolution - 2 ? resolution - 2 : i); }

  static constexpr std::uint32_t prime1 = 2654435761u, prime2 = 805459861u;
};

/// Sizes of the grid, known to the compiler. The default is the published one: 441 568 entries, 1 766 272 bits.
struct HashGridShape {
  std::array<int, 12> volume_resolution{18, 24, 33, 44, 59, 80, 108, 148, 201, 275, 376, 514};
  int volume_levels = 12;
  int volume_cap_log2 = 13;
  std::array<int, 4> plane_resolution{130, 258, 514, 1026};
  int plane_levels = 4;
  int plane_cap_log2 = 15;

  static constexpr int features = 4;  ///< of an entry
  static constexpr int planes = 3;
  static constexpr std::array<std::array<int, 3>, 4> grid_axes{{{0, 1, 2}, {0, 1, 0}, {0, 2, 0}, {1, 2, 0}}};

  [[nodiscard]] constexpr int levels() const { return volume_levels + planes * plane_levels; }
  [[nodiscard]] constexpr int channels() const { return features * levels(); }
  /// A file of a few bytes can name any grid: twenty times the published one, 32 MiB when decoded, is the largest there
  /// is.
  static constexpr std::size_t most_entries = std::size_t{1} << 25;
  [[nodiscard]] constexpr bool valid() const {
    bool good = volume_levels >= 0 && volume_levels <= 12 && plane_levels >= 0 && plane_levels <= 4 && levels() > 0;
    good = good && volume_cap_log2 >= 3 && volume_cap_log2 <= 24 && plane_cap_log2 >= 3 && plane_cap_log2 <= 24;
    for (int i = 0; good && i < volume_levels; ++i) good = resolution(i) >= 3 && resolution(i) <= 1 << 16;
    for (int i = 0; good && i < plane_levels; ++i)
      good = resolution(volume_levels + i) >= 3 && resolution(volume_levels + i) <= 1 << 16;
    return good && entries() <= most_entries;
  }
  [[nodiscard]] constexpr int resolution(int level) const {
    if (level < volume_levels) return volume_resolution[static_cast<std::size_t>(level)];
    return plane_resolution[static_cast<std::size_t>((level - volume_levels) % plane_levels)];
  }
  /// 0 for the volume, 1 … 3 for xy, xz, yz.
  [[nodiscard]] constexpr int grid(int level) const {
    return level < volume_levels ? 0 : 1 + (level - volume_levels) / plane_levels;
  }
  /// min(cap, R^d), rounded up to a multiple of 8.
  [[nodiscard]] constexpr std::uint32_t level_entries(int level) const {
    const bool volume = level < volume_levels;
    const auto r = static_cast<std::uint64_t>(resolution(level));
    const std::uint64_t vertices = volume ? r * r * r : r * r;
    const std::uint64_t cap = std::uint64_t{1} << (volume ? volume_cap_log2 : plane_cap_log2);
    return static_cast<std::uint32_t>(((vertices < cap ? vertices : cap) + 7) / 8 * 8);
  }
  [[nodiscard]] constexpr HashGridLevel level(int index) const {
    HashGridLevel result;
    const auto r = static_cast<std::uint64_t>(resolution(index));
    result.dimensions = index < volume_levels ? 3 : 2;
    result.axis = grid_axes[static_cast<std::size_t>(grid(index))];
    result.resolution = resolution(index);
    result.entries = level_entries(index);
    for (int before = 0; before < index; ++before) result.first += level_entries(before);
    result.dense = (result.dimensions == 3 ? r * r * r : r * r) <= result.entries;
    if (!result.dense) result.hash_mask = result.entries - 1;  // a cap is a power of two
    return result;
  }
  /// Rows of the table of all levels.
  [[nodiscard]] constexpr std::size_t entries() const {
    std::size_t sum = 0;
    for (int i = 0; i < levels(); ++i) sum += level_entries(i);
    return sum;
  }
  [[nodiscard]] constexpr std::size_t bits() const { return entries() * static_cast<std::size_t>(features); }

  friend bool operator==(const HashGridShape&, const HashGridShape&) = default;
};

/// A quarter of the published caps (491 520 bits): for objects and rooms whose whole file is about a MiB.
inline constexpr HashGridShape quarter_hash_grid{.volume_cap_log2 = 11, .plane_cap_log2 = 13};

/// All levels of a shape, computed once by the compiler.
template <HashGridShape shape>
inline constexpr auto hash_grid_levels = [] {
  static_assert(shape.valid(), "HashGridShape: no levels, or a size out of range");
  std::array<HashGridLevel, static_cast<std::size_t>(shape.levels())> levels{};
  for (int i = 0; i < shape.levels(); ++i) levels[static_cast<std::size_t>(i)] = shape.level(i);
  return levels;
}();

}  // namespace compmark
