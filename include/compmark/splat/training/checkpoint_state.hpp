// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Checks that the moments and counts of a checkpoint are possible. Right shapes are no proof: a checkpoint may have a
// repaired checksum, or come from a version that wrote none. Cost: one read of the columns.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include "compmark/core/result.hpp"
#include "compmark/io/safetensors.hpp"
#include "compmark/splat/training/revival.hpp"

namespace compmark::detail {

[[nodiscard]] inline Error no_state(const SafetensorsFile& file, std::string field, std::string problem) {
  return Error{ErrorKind::malformed, file.path, std::move(field), std::move(problem),
               "the file is damaged: resume from a copy of it, or remove it to start over"};
}

/// Names how near to death a training is in the progress of a checkpoint; nothing where it is alive and well.
template <class Json, class State>
void add_revival(Json& progress, const State& state) {
  if constexpr (requires { state.revival; }) {
    if (state.revival != Revival{}) progress["revival"] = {state.revival.empty, state.revival.revivals};
  }
}
/// Reads the same. False: what is there is no two counts.
template <class Json>
[[nodiscard]] bool read_revival(const Json& progress, Revival& revival) {
  const Json counts = progress.value("revival", Json());
  if (counts.is_null()) return true;
  if (!counts.is_array() || counts.size() != 2 || !counts[0].is_number_unsigned() || !counts[1].is_number_unsigned())
    return false;
  revival = {counts[0].template get<std::int64_t>(), counts[1].template get<std::int64_t>()};
  return true;
}

/// Checks that moments and counts are possible in a run of so many iterations. Sums of the growth statistics may be
/// NaN: growing drops such.
template <class State>
[[nodiscard]] Result<Done> check_state(const SafetensorsFile& file, const State& state) {
  const auto all = [](const auto& column, const auto& fits) {
    for (std::size_t i = 0; i < column.size(); ++i) {
      if (!fits(column[i])) return false;
    }
    return true;
  };
  if (!all(state.optimizer.first_moment, [](auto x) { return std::isfinite(x); }))
    return no_state(file, "optimizer.first_moment", "holds a value that is not finite");
  if (!all(state.optimizer.second_moment, [](auto x) { return std::isfinite(x) && x >= 0; }))
    return no_state(file, "optimizer.second_moment", "holds a value that is no mean of squares");
  const std::uint64_t most = static_cast<std::uint64_t>(state.iteration);
  if (!all(state.optimizer.steps, [&](std::uint64_t steps) { return steps <= most; }))
    return no_state(file, "optimizer.steps", "has more steps than the run had iterations");
  if constexpr (requires { state.growth.statistics; }) {
    const auto& statistics = state.growth.statistics;
    const auto count = [&](auto x) { return x >= 0 && static_cast<double>(x) <= static_cast<double>(state.iteration); };
    const auto sum = [](auto x) { return !(x < 0); };
    if (!all(statistics.visits, count)) return no_state(file, "growth.visits", "holds a number that is no count");
    if (!all(statistics.gradient_count, count))
      return no_state(file, "growth.gradient_count", "holds a number that is no count");
    if (!all(statistics.opacity_sum, sum)) return no_state(file, "growth.opacity_sum", "holds a negative sum");
    if (!all(statistics.gradient_sum, sum)) return no_state(file, "growth.gradient_sum", "holds a negative sum");
  }
  return Done{};
}

}  // namespace compmark::detail
