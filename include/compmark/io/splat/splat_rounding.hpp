// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the writers of splat files share: settings, what they give, the rounding of a number to the steps of a
// format, and the order of splats along a space-filling curve. Everything here is a function of the table alone: the
// same table gives the same bytes at any number of threads.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/io/splat/splat_file.hpp"
#include "compmark/math/spherical_harmonics.hpp"
#include "compmark/scene/splat_table.hpp"

namespace compmark {

/// How a splat file is written; what a format does not have is passed over.
struct SplatWriteSettings {
  std::optional<SplatFormat> format;   ///< nothing: by the ending of the name
  bool antialiased = false;            ///< trained with the mip filter: compressed PLY, SPZ and SOG can say so
  bool reorder = true;                 ///< compressed PLY and SOG: near splats next to one another, for finer steps
  int spz_version = 0;                 ///< 3 or 4; 0: 4 where this program has libzstd, else 3
  std::optional<int> fractional_bits;  ///< SPZ: bits of a position behind the point, 0 to 23; nothing: 12, or what fits
  std::array<int, 2> spz_harmonic_bits{5, 4};  ///< SPZ: kept of the 8 of degree 1, and of degrees 2 and 3
  std::size_t sog_palette = 0;                 ///< SOG: sets of harmonics, at most 65,536; 0: by the number of splats
  bool sog_png = false;                        ///< SOG: PNG images also where this program has libwebp
  std::vector<std::string> comments;           ///< of a PLY
};

/// A splat file in memory.
struct EncodedSplats {
  std::vector<std::byte> bytes;
  int version = 0;                     ///< of SPZ, SOG and glTF
  std::optional<int> fractional_bits;  ///< of SPZ
  std::vector<std::string> notes;      ///< what the format could not hold, a sentence each
};

/// A splat file that was written.
struct SplatWritten {
  SplatFormat format = SplatFormat::ply;
  int version = 0;                     ///< of SPZ, SOG and glTF
  std::optional<int> fractional_bits;  ///< of SPZ: bits of a position behind the point
  std::uint64_t bytes = 0;             ///< 0 where they went to a pipe or a device
  std::vector<std::string> notes;      ///< what the format could not hold, a sentence each
};

namespace detail {

[[nodiscard]] inline double opacity_of_logit(float logit) { return 1 / (1 + std::exp(-static_cast<double>(logit))); }
/// The colour of f_dc as it is seen without the other harmonics.
[[nodiscard]] inline double color_of_dc(float dc) { return 0.5 + sh_constant * static_cast<double>(dc); }

/// The nearest of the 2^bits steps from `low` to `high`; 0 for a range of no width.
[[nodiscard]] inline std::uint32_t nearest_step(double x, double low, double high, int bits) {
  if (!(high > low)) return 0;
  const double most = static_cast<double>((1u << bits) - 1);
  return static_cast<std::uint32_t>(std::round(std::clamp((x - low) / (high - low), 0.0, 1.0) * most));
}
[[nodiscard]] inline std::uint8_t nearest_byte(double x) {
  return static_cast<std::uint8_t>(std::clamp(std::round(x), 0.0, 255.0));
}

/// Counts the numbers that a format cannot hold and that are held at its ends.
struct HeldNumbers {
  std::size_t count = 0;
  [[nodiscard]] double operator()(double x, double low, double high) {
    if (x >= low && x <= high) return x;
    ++count;
    return x < low ? low : high;
  }
  void tell(const std::string& what, const std::string& range, std::vector<std::string>& notes) const {
    if (count == 0) return;
    notes.push_back(std::to_string(count) + " " + what + " lie outside of " + range + " and are held at its ends");
  }
};

/// Log scales whose length is a finite float: the largest of those is e^88.7228.
inline constexpr float most_log_scale = 88.72f;
inline constexpr const char* log_scale_range = "-infinity to 88.72";

/// The length of a log scale; 0 for minus infinity.
[[nodiscard]] inline float held_length(float log_scale, HeldNumbers& held) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  return std::exp(static_cast<float>(held(static_cast<double>(log_scale), -infinity, double{most_log_scale})));
}

/// w x y z of a row, of norm 1.
[[nodiscard]] inline std::array<double, 4> unit_rotation(const SplatTable& table, std::size_t row) {
  const double norm = rotation_norm(table, row);
  std::array<double, 4> q{};
  for (std::size_t k = 0; k < 4; ++k) q[k] = static_cast<double>(table.rotation[k][row]) / norm;
  return q;
}

/// The largest of four components, and the others in their order with the sign that makes it positive.
struct ThreeOfRotation {
  std::size_t largest = 0;
  std::array<double, 3> others{};
};
[[nodiscard]] inline ThreeOfRotation three_of_rotation(const std::array<double, 4>& q) {
  ThreeOfRotation found;
  for (std::size_t k = 1; k < 4; ++k) {
    if (std::abs(q[k]) > std::abs(q[found.largest])) found.largest = k;
  }
  for (std::size_t k = 0, n = 0; k < 4; ++k) {
    if (k != found.largest) found.others[n++] = q[found.largest] < 0 ? -q[k] : q[k];
  }
  return found;
}

/// The order of a table's rows in a file: as they are, or along a Z-curve through the box of their places (Morton
/// 1966), 21 bits an axis. Cost: a sort.
[[nodiscard]] inline std::vector<std::uint32_t> splat_order(const SplatTable& table, bool reorder) {
  std::vector<std::uint32_t> order(table.count);
  std::iota(order.begin(), order.end(), 0u);
  if (!reorder || table.count == 0) return order;
  std::vector<std::uint64_t> code(table.count, 0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<float>& column = table.mean[axis];
    const auto ends = std::minmax_element(column.begin(), column.end());
    const double low = static_cast<double>(*ends.first), high = static_cast<double>(*ends.second);
    for (std::size_t i = 0; i < table.count; ++i) {
      const std::uint64_t place = nearest_step(static_cast<double>(column[i]), low, high, 21);
      for (std::size_t bit = 0; bit < 21; ++bit) code[i] |= (place >> bit & 1u) << (3 * bit + axis);
    }
  }
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return code[a] < code[b]; });
  return order;
}

}  // namespace detail

}  // namespace compmark
