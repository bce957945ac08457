// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What is read of copies that their recipients mixed: bits in which the copies are equal are as they are, the others as
// the mixing has them, and every logit has noise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/watermark/proof/message.hpp"

namespace compmark::testing {

enum class Mixing {
  average,      ///< of the models: a logit is the mean of the copies'
  majority,     ///< the bit that more copies have
  minority,     ///< the bit that fewer copies have, where some differ
  all_one,      ///< 1 where any copy has it
  interleaved,  ///< the bit of a copy that is drawn for each
};
inline constexpr Mixing all_mixings[]{Mixing::average, Mixing::majority, Mixing::minority, Mixing::all_one,
                                      Mixing::interleaved};

/// One logit a bit; a copy's are +-1, the noise has deviation `noise`.
[[nodiscard]] inline std::vector<double> colluded_logits(const std::vector<Message>& copies, Mixing mixing,
                                                         double noise, const Random& random) {
  std::vector<double> logits;
  const std::size_t bits = copies.front().size(), count = copies.size();
  for (std::size_t i = 0; i < bits; ++i) {
    std::size_t ones = 0;
    for (const Message& copy : copies) ones += copy[i] ? 1 : 0;
    const std::size_t drawn = static_cast<std::size_t>(random.bits(2 * i + 1000) % count);
    double z = (2 * static_cast<double>(ones) - static_cast<double>(count)) / static_cast<double>(count);
    if (mixing == Mixing::majority) z = 2 * ones > count || (2 * ones == count && copies[drawn][i]) ? 1 : -1;
    if (mixing == Mixing::minority) {
      const bool same = ones == 0 || ones == count, more = 2 * ones > count || (2 * ones == count && copies[drawn][i]);
      z = (same ? ones != 0 : !more) ? 1 : -1;
    }
    if (mixing == Mixing::all_one) z = ones != 0 ? 1 : -1;
    if (mixing == Mixing::interleaved) z = copies[drawn][i] ? 1 : -1;
    logits.push_back(z + noise * random.normal(i));
  }
  return logits;
}

}  // namespace compmark::testing
