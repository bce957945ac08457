// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Frequencies of the hyperprior's symbols as a file holds them, 31 a channel of z and one of the escape, of 2^16 (compression sheet, 6.4: not the
// network that they come from, factorised_prior.hpp), and tables of the same make as the Gaussian ones, so that one symbol coder serves
// both: SymbolModel::sigma_index is the channel, the mean has no meaning. Symbols beyond +-15 escape. Cost: 2 KB of tables a channel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/core/result.hpp"
#include "compmark/entropy/gaussian_tables.hpp"

namespace compmark::inline v0 {

struct HyperpriorFormat {
  static constexpr int window = 15;  ///< symbols in +-15 have slots
  static constexpr std::size_t slots = 2 * window + 1;
  static constexpr std::size_t most_channels = 64;
  static constexpr std::uint32_t total = 1u << GaussianTables::precision;
  static constexpr std::int32_t greatest = 1'000'000;  ///< |z|
};

/// Frequencies of one channel from the probabilities of -15 … 15: none is 0, and something is left for the escape.
[[nodiscard]] inline Result<std::vector<std::uint16_t>> hyperprior_frequencies(std::span<const double> probability) {
  constexpr std::uint32_t spread = HyperpriorFormat::total - static_cast<std::uint32_t>(HyperpriorFormat::slots) - 1;
  const auto fail = [](const char* problem) {
    return Error{ErrorKind::invalid, "", "hyperprior", problem, "was the training stable?"};
  };
  if (probability.size() != HyperpriorFormat::slots) return fail("a channel's prior does not have 31 probabilities");
  std::vector<std::uint16_t> frequency;
  std::uint32_t sum = 0;
  for (const double p : probability) {
    if (!(p >= 0 && p <= 1 + 1e-6)) return fail("a probability of its prior is not in 0 to 1");
    const auto share = static_cast<std::uint32_t>(std::floor(std::min(p, 1.0) * spread));
    frequency.push_back(static_cast<std::uint16_t>(1 + share));
    sum += 1 + share;
  }
  if (sum >= HyperpriorFormat::total) return fail("the probabilities of its prior add up to more than 1");
  return frequency;
}

class HyperpriorTables {
 public:
  HyperpriorTables() = default;
  /// `frequencies` [channels][31], each at least 1, each channel's sum below 2^16.
  explicit HyperpriorTables(std::span<const std::uint16_t> frequencies) {
    for (std::size_t at = 0; at + HyperpriorFormat::slots <= frequencies.size(); at += HyperpriorFormat::slots) {
      add(frequencies.subspan(at, HyperpriorFormat::slots));
    }
  }

  [[nodiscard]] std::size_t channels() const { return tables_.size(); }
  [[nodiscard]] GaussianTables::Place place(const SymbolModel& model) const {
    return {tables_.data() + std::min<std::size_t>(model.sigma_index, tables_.size() - 1), 0, 0};
  }
  [[nodiscard]] GaussianTables::Interval interval(const GaussianTables::Table& table, std::uint32_t slot) const {
    const std::uint16_t* bounds = numbers_.data() + table.bounds;
    const auto start = static_cast<std::uint16_t>(bounds[static_cast<std::ptrdiff_t>(slot) - 1] + 1);
    return {start, static_cast<std::uint32_t>(bounds[slot] - start + 1)};
  }
  [[nodiscard]] std::uint32_t slot_of(const GaussianTables::Table& table, std::uint32_t number) const {
    const std::uint16_t* bounds = numbers_.data() + table.bounds;
    std::uint32_t slot = numbers_[table.first + (number >> table.shift)];
    while (bounds[slot] < number) ++slot;
    return slot;
  }
  [[nodiscard]] double slot_bits(const SymbolModel& model, std::int32_t symbol) const {
    const GaussianTables::Place at = place(model);
    return GaussianTables::precision -
           std::log2(static_cast<double>(interval(*at.table, GaussianTables::slot_at(at, symbol)).frequency));
  }

 private:
  static constexpr int search_bits = 8;

  void add(std::span<const std::uint16_t> frequency) {
    std::array<std::uint16_t, HyperpriorFormat::slots + 1> bounds{};
    std::uint32_t reached = 0;
    for (std::size_t i = 0; i < frequency.size(); ++i) {
      reached += frequency[i];
      bounds[i] = static_cast<std::uint16_t>(reached - 1);
    }
    bounds.back() = 0xffff;
    GaussianTables::Table table{};
    table.window = HyperpriorFormat::window;
    table.shift = GaussianTables::precision - search_bits;
    table.first = static_cast<std::uint32_t>(numbers_.size());
    std::uint16_t slot = 0;
    for (std::uint32_t bucket = 0; bucket < 1u << search_bits; ++bucket) {
      while (bounds[slot] < bucket << table.shift) ++slot;
      numbers_.push_back(slot);
    }
    numbers_.push_back(0xffff);
    table.bounds = static_cast<std::uint32_t>(numbers_.size());
    numbers_.insert(numbers_.end(), bounds.begin(), bounds.end());
    tables_.push_back(table);
  }

  std::vector<GaussianTables::Table> tables_;
  std::vector<std::uint16_t> numbers_;
};

}  // namespace compmark::inline v0
