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
template <class Json>
void add_revival(Json& progress, const Revival& revival) {
  if (revival != Revival{}) progress["revival"] = {revival.empty, revival.revivals};
}
/// Reads the same. False: what is there is not two counts of so many iterations.
template <class Json>
[[nodiscard]] bool read_revival(const Json& progress, std::int64_t iteration, Revival& revival) {
  const Json counts = progress.value("revival", Json());
  if (counts.is_null()) return true;
  const auto is_count = [iteration](const Json& one) {
    return one.is_number_unsigned() && one.template get<std::uint64_t>() <= static_cast<std::uint64_t>(iteration);
  };
  if (!counts.is_array() || counts.size() != 2 || !is_count(counts[0]) || !is_count(counts[1])) return false;
  revival = {counts[0].template get<std::int64_t>(), counts[1].template get<std::int64_t>()};
  return true;
}

template <class Column, class Fits>
[[nodiscard]] bool all_of_column(const Column& column, const Fits& fits) {
  for (std::size_t i = 0; i < column.size(); ++i) {
    if (!fits(column[i])) return false;
  }
  return true;
}

/// Checks that the optimiser's moments and steps are possible after so many iterations.
template <class Moments>
[[nodiscard]] Result<Done> check_moments(const SafetensorsFile& file, const Moments& moments, std::int64_t iterations) {
  if (!all_of_column(moments.first_moment, [](auto x) { return std::isfinite(x); }))
    return no_state(file, "optimizer.first_moment", "holds a value that is not finite");
  if (!all_of_column(moments.second_moment, [](auto x) { return std::isfinite(x) && x >= 0; }))
    return no_state(file, "optimizer.second_moment", "holds a value that is no mean of squares");
  const std::uint64_t most = static_cast<std::uint64_t>(iterations);
  if (!all_of_column(moments.steps, [&](std::uint64_t steps) { return steps <= most; }))
    return no_state(file, "optimizer.steps", "has more steps than the run had iterations");
  return Done{};
}
/// The same of the growth statistics. Their sums may be NaN: growing drops such.
template <class Statistics>
[[nodiscard]] Result<Done> check_statistics(const SafetensorsFile& file, const Statistics& statistics,
                                            std::int64_t iterations) {
  const auto count = [&](auto x) { return x >= 0 && static_cast<double>(x) <= static_cast<double>(iterations); };
  const auto sum = [](auto x) { return !(x < 0); };
  if (!all_of_column(statistics.visits, count))
    return no_state(file, "growth.visits", "holds a number that is no count");
  if (!all_of_column(statistics.gradient_count, count))
    return no_state(file, "growth.gradient_count", "holds a number that is no count");
  if (!all_of_column(statistics.opacity_sum, sum)) return no_state(file, "growth.opacity_sum", "holds a negative sum");
  if (!all_of_column(statistics.gradient_sum, sum))
    return no_state(file, "growth.gradient_sum", "holds a negative sum");
  return Done{};
}

}  // namespace compmark::detail
