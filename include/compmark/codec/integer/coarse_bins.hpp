// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A symbol in two parts: a coarse bin of 1, 3, 9 or 27 bins, which is coded first, and which of its bins it is, when
// more of the file is there. A Gaussian of the coarse bins is one of the tables again, with the mean and the deviation
// divided; the bins within get their shares of the table of the fine ones. Both are whole numbers, and one symbol costs
// in two parts what it costs in one, to a thousandth of a bit. Cost: a look-up a bin, ~20 ns for nine.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "compmark/codec/coder/adaptive_binary.hpp"
#include "compmark/codec/coder/gaussian_tables.hpp"
#include "compmark/codec/integer/intra_context.hpp"

namespace compmark {

/// How coarse the first level of a file is: 3^thirds bins a coarse bin, of features, scales, offsets.
struct CoarseSteps {
  static constexpr std::uint8_t most_thirds = 3;
  std::array<std::uint8_t, 3> thirds{2, 2, 2};

  [[nodiscard]] static constexpr std::int32_t width_of(std::uint8_t thirds) {
    constexpr std::array<std::int32_t, most_thirds + 1> widths{1, 3, 9, 27};
    return widths[thirds];
  }
  [[nodiscard]] std::int32_t width(std::size_t group) const { return width_of(thirds[group]); }
  [[nodiscard]] bool valid() const {
    return *std::max_element(thirds.begin(), thirds.end()) <= most_thirds && *this != CoarseSteps{{0, 0, 0}};
  }
  friend bool operator==(const CoarseSteps&, const CoarseSteps&) = default;
};

namespace detail {

/// floor(a / b) for b > 0.
[[nodiscard]] constexpr std::int64_t floor_quotient(std::int64_t a, std::int64_t b) {
  return a / b - (a % b < 0 ? 1 : 0);
}

/// The coarse bin of a symbol: the widths are odd, so that every bin lies in one of them.
[[nodiscard]] constexpr std::int32_t coarse_symbol(std::int32_t symbol, std::int32_t width) {
  return static_cast<std::int32_t>(floor_quotient(std::int64_t{symbol} + width / 2, width));
}

/// The model of a coarse bin: a mean in 1/32 bin and a level of HashPrediction, both of the bins.
[[nodiscard]] inline SymbolModel coarse_model(std::int32_t mean, std::int32_t level, std::uint8_t thirds) {
  constexpr std::int32_t level_of_3 = 3246;  // 2048 log2 3
  const std::int32_t width = CoarseSteps::width_of(thirds);
  return {static_cast<std::uint16_t>(
              HashPrediction::table(std::max(level - level_of_3 * thirds, HashPrediction::least_level))),
          static_cast<std::int32_t>(floor_quotient(std::int64_t{mean} + width / 2, width))};
}

/// The bins of one coarse bin with their shares under a model.
class CoarseBin {
 public:
  /// `coarse` * `width` must be a symbol. `least`: the bins below it have no share; one bin at least must have one.
  CoarseBin(const GaussianTables& tables, const SymbolModel& model, std::int32_t coarse, std::int32_t width,
            std::int32_t least)
      : first_(coarse * width - width / 2),
        width_(width) {
    const GaussianTables::Place at = tables.place(model);
    for (std::int32_t i = 0; i < width; ++i) {
      const std::uint32_t slot = GaussianTables::slot_at(at, first_ + i);
      const bool outside = slot > static_cast<std::uint32_t>(2 * at.table->window);
      const std::uint32_t share = first_ + i < least ? 0 : outside ? 1 : tables.interval(*at.table, slot).frequency;
      below_[static_cast<std::size_t>(i + 1)] = below_[static_cast<std::size_t>(i)] + share;
    }
  }

  /// Where the symbol is to be expected, in 1/32 bin.
  [[nodiscard]] std::int64_t middle() const {
    std::int64_t sum = 0;
    for (std::int32_t i = 0; i < width_; ++i) sum += std::int64_t{i} * share(i, i + 1);
    const std::int64_t all = share(0, width_);
    return 32 * std::int64_t{first_} + floor_quotient(64 * sum + all, 2 * all);
  }
  /// Which of the bins a symbol is, a third of a third first, the middle one before the outer two: writes the symbol it
  /// is given, or reads one (bits.hpp).
  template <class Bits>
  [[nodiscard]] std::int32_t code(Bits& bits, std::int32_t symbol) const {
    std::int32_t begin = 0, end = width_;
    const std::int32_t at = symbol - first_;
    while (end - begin > 1) {
      const std::int32_t third = (end - begin) / 3, low = begin + third, high = end - third;
      const std::uint32_t inner = share(low, high), outer = share(begin, low) + share(high, end);
      if (decide(bits, at >= low && at < high, inner, outer)) {
        begin = low;
        end = high;
      } else if (decide(bits, at >= high, share(high, end), share(begin, low))) {
        begin = high;
      } else {
        end = low;
      }
    }
    return first_ + begin;
  }
  /// Share of a symbol of the coarse bin, in (0, 1]: what log2 makes the bits of.
  [[nodiscard]] double probability(std::int32_t symbol) const {
    const std::int32_t i = symbol - first_;
    return static_cast<double>(share(i, i + 1)) / static_cast<double>(share(0, width_));
  }

 private:
  [[nodiscard]] std::uint32_t share(std::int32_t begin, std::int32_t end) const {
    return below_[static_cast<std::size_t>(end)] - below_[static_cast<std::size_t>(begin)];
  }
  /// A bit with the shares of one and of zero; what has no share is not asked for.
  template <class Bits>
  [[nodiscard]] static bool decide(Bits& bits, bool bit, std::uint32_t one, std::uint32_t zero) {
    if (one == 0 || zero == 0) return one != 0;
    BinaryContext context{static_cast<std::uint32_t>((std::uint64_t{one} << 32) / (std::uint64_t{one} + zero)), 0};
    return bits(context, bit);
  }

  std::int32_t first_, width_;
  std::array<std::uint32_t, 28> below_{};  // sums of the shares
};

}  // namespace detail

}  // namespace compmark
