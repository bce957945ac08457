// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Frequencies of the hyperprior's symbols as a file holds them, 31 a channel of z and one of the escape, of 2^16
// (docs/spec/compression.md, 4.2: not the network that they come from, factorised_prior.hpp), and tables of the same
// make as the Gaussian ones, so that one symbol coder serves both: SymbolModel::sigma_index is the channel, the mean
// has no meaning. Symbols beyond +-15 escape. Cost: 2 KB of tables a channel.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "compmark/codec/coder/gaussian_tables.hpp"
#include "compmark/codec/coder/slot_tables.hpp"
#include "compmark/core/result.hpp"

namespace compmark {

struct HyperpriorFormat {
  static constexpr int window = 15;  ///< symbols in +-15 have slots
  static constexpr std::size_t slots = 2 * window + 1;
  static constexpr std::size_t most_channels = 64;
  static constexpr std::uint32_t total = 1u << GaussianTables::precision;
  static constexpr std::int32_t greatest = 1'000'000;  ///< |z|
};

/// Frequencies of one channel from the probabilities of -15 … 15. None is 0, and the escape gets a rest.
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

class HyperpriorTables : private SlotTables {
 public:
  using SlotTables::interval, SlotTables::slot_of;

  HyperpriorTables() = default;
  /// `frequencies` [channels][31], each at least 1, each channel's sum below 2^16.
  explicit HyperpriorTables(std::span<const std::uint16_t> frequencies) {
    constexpr int search_bits = 8;
    for (std::size_t at = 0; at + HyperpriorFormat::slots <= frequencies.size(); at += HyperpriorFormat::slots) {
      std::array<std::uint32_t, HyperpriorFormat::slots + 1> bounds{};
      std::uint32_t reached = 0;
      for (std::size_t i = 0; i < HyperpriorFormat::slots; ++i) bounds[i] = (reached += frequencies[at + i]) - 1;
      bounds.back() = HyperpriorFormat::total - 1;
      append(bounds, HyperpriorFormat::window, search_bits);
    }
  }

  [[nodiscard]] std::size_t channels() const { return tables().size(); }
  [[nodiscard]] Place place(const SymbolModel& model) const {
    return {tables().data() + std::min<std::size_t>(model.sigma_index, tables().size() - 1), 0, 0};
  }
  [[nodiscard]] double slot_bits(const SymbolModel& model, std::int32_t symbol) const {
    const Place at = place(model);
    return precision - std::log2(static_cast<double>(interval(*at.table, slot_at(at, symbol)).frequency));
  }
};

}  // namespace compmark
