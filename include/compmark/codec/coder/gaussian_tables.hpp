// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The coding tables of Gaussians on whole numbers: cumulative frequencies of 16 bits for every standard deviation 2^(s
// / 8) bins, s = -25..56 (0.115 to 128), and every position of the mean within its bin: in 1/32 bin below a deviation
// of 1, then coarser, to 1/4 from 4 on. The grids cost 0.0008 to 0.0009 bits a symbol, the frequencies 0.0001 to 0.0006
// (entropy_coder.bench). Slots are the window of +-(ceil(5 sigma) + 1) bins around the mean's, each with a frequency of
// (2^16 - slots) p + 1 (docs/spec/numerics.md, EN4), and a last one of frequency 1, the escape (EN5); their sum is
// exactly 2^16 (EN7). Built from whole numbers (normal_integral.hpp), hence equal everywhere; 1 ms, 0.27 MB, handed
// around.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/coder/normal_integral.hpp"
#include "compmark/codec/coder/slot_tables.hpp"
#include "compmark/core/random.hpp"

namespace compmark {

/// Where a symbol is expected: a deviation of 2^((sigma_index + GaussianTables::least_level) / 8) bins and a mean in
/// 1/32 bin.
struct SymbolModel {
  std::uint16_t sigma_index = 0;  ///< held at the widest table
  std::int32_t mean = 0;
};

namespace detail {

/// 2^(-j / 16) in units of 2^-62.
inline constexpr std::array<std::int64_t, 16> sixteenth_octaves{
    4611686018427387904, 4416165660797809419, 4228934724888366668, 4049641766413219908,
    3877950241171266237, 3713537873331429433, 3556096050500581047, 3405329244438597040,
    3260954456333195553, 3122700685593301682, 2990308421163830843, 2863529154407056491,
    2742124912636209756, 2625867812425724110, 2514539631859660218, 2407931400915394245};

/// z = a / (32 sigma) in units of 2^-48 for sigma = 2^(sixteenths / 16).
[[nodiscard]] inline std::int64_t standardised(std::int64_t a, int sixteenths) {
  __extension__ using Wide = __int128;
  const int octave = sixteenths >> 4;
  const auto inverse = static_cast<Wide>(sixteenth_octaves[static_cast<std::size_t>(sixteenths & 15)]);
  const Wide z = static_cast<Wide>(a) * inverse >> (62 - NormalIntegral::bits + 5 + octave);
  constexpr Wide limit = Wide{8} << NormalIntegral::bits;  // beyond the integral's own ends
  return static_cast<std::int64_t>(std::clamp(z, -limit, limit));
}

/// ceil(5 sigma) + 1: only 6e-7 of the symbols are outside.
[[nodiscard]] inline int window_of(int sixteenths) {
  int window =
      1;  // the smallest window + 1 - 1 >= 5 sigma, by its inverse: 1 >= 5 / (window - 1) sigma has no root to round
  while (standardised(32 * window, sixteenths) < (std::int64_t{5} << NormalIntegral::bits)) ++window;
  return window + 1;
}

/// Upper bounds less one of the slots: value i belongs to the bin i - window from the mean's bin, the last to the
/// escape. The mean lies `phase` / 32 above the centre of its bin. `bits` is the precision, 16 in files.
inline void gaussian_bounds(const NormalIntegral& phi, int sixteenths, int phase, int window, int bits,
                            std::span<std::uint32_t> bounds) {
  __extension__ using Wide = __int128;
  const std::int64_t spread = (std::int64_t{1} << bits) - (2 * window + 2);
  for (int i = 0; i < 2 * window; ++i) {
    const std::int64_t edge = 32 * static_cast<std::int64_t>(i - window) + 16 - phase;
    const auto share = static_cast<Wide>(phi(standardised(edge, sixteenths)));
    const auto rounded = static_cast<std::int64_t>((share * spread + NormalIntegral::one / 2) >> NormalIntegral::bits);
    bounds[static_cast<std::size_t>(i)] = static_cast<std::uint32_t>(i + rounded);
  }
  bounds[static_cast<std::size_t>(2 * window)] = static_cast<std::uint32_t>(2 * window + spread);
  bounds[static_cast<std::size_t>(2 * window + 1)] = static_cast<std::uint32_t>(2 * window + 1 + spread);
}

}  // namespace detail

class GaussianTables : private SlotTables {
 public:
  using SlotTables::Interval, SlotTables::Place, SlotTables::Table;
  using SlotTables::interval, SlotTables::precision, SlotTables::slot_at, SlotTables::slot_of, SlotTables::tables;
  static constexpr int levels_per_octave = 8;  ///< of the standard deviation
  static constexpr int least_level = -25;      ///< 2^(-25 / 8) = 0.1146 bins, the first above the floor of 0.11
  static constexpr int levels = 82;
  static constexpr int phases = 32;  ///< positions of a mean in its bin, in the unit of SymbolModel::mean

  GaussianTables() {
    const NormalIntegral phi;
    std::vector<std::uint32_t> bounds;
    for (int index = 0; index < levels; ++index) {
      const int sixteenths = 2 * (index + least_level), window = detail::window_of(sixteenths);
      Level& level = levels_[static_cast<std::size_t>(index)];
      level.table = static_cast<std::uint32_t>(tables().size());
      level.shift = phase_shift(sixteenths);
      bounds.resize(static_cast<std::size_t>(2 * window + 2));
      const int search_bits = std::max(4, static_cast<int>(std::bit_width(static_cast<unsigned>(window))) + 1);
      for (int phase = 0; phase <= phases / 2; phase += 1 << level.shift) {
        detail::gaussian_bounds(phi, sixteenths, phase, window, precision, bounds);
        append(bounds, window, search_bits);
      }
    }
  }

  [[nodiscard]] Place place(const SymbolModel& model) const {
    const std::size_t index = model.sigma_index;
    const Level level = levels_[index < levels ? index : levels - 1];
    const std::int64_t mean = model.mean, centre = (mean + phases / 2) >> 5, above = mean - centre * phases;
    const std::int64_t mirror = above >> 63;
    const auto distance = static_cast<std::uint32_t>((above ^ mirror) - mirror);
    const std::uint32_t phase = (distance + ((1u << level.shift) >> 1)) >> level.shift;
    return {tables().data() + level.table + phase, centre, mirror};
  }

  /// What the slot of a symbol costs, in bits; an escaped symbol's own bytes are not in it.
  [[nodiscard]] double slot_bits(const SymbolModel& model, std::int32_t symbol) const {
    const Place at = place(model);
    return precision - std::log2(static_cast<double>(interval(*at.table, slot_at(at, symbol)).frequency));
  }

  /// The step between two tables of one deviation, in the unit of SymbolModel::mean.
  [[nodiscard]] std::uint32_t phase_step(int index) const {
    return 1u << levels_[static_cast<std::size_t>(index)].shift;
  }

  /// A fingerprint of all tables. Decoders of the same specification have the same one (the container stores it).
  [[nodiscard]] std::uint64_t fingerprint() const {
    std::uint64_t hash = tables().size();
    for (const Table& table : tables()) {
      for (int i = 0; i < 2 * table.window + 2; ++i) {
        hash = mix_bits(hash ^ bound(table, static_cast<std::uint32_t>(i)));
      }
    }
    return hash;
  }

 private:
  struct Level {
    std::uint32_t table = 0;  // of phase 0
    std::uint32_t shift = 0;  // phases are multiples of 2^shift / 32
  };

  /// A step of 1/32 below a deviation of one bin, and doubled with it; of 1/4 at most.
  [[nodiscard]] static std::uint32_t phase_shift(int sixteenths) {
    return static_cast<std::uint32_t>(std::clamp((sixteenths >> 4) + 1, 0, 3));
  }

  std::array<Level, levels> levels_{};
};

}  // namespace compmark
