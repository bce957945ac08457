// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Learning rates as functions of the iteration: lr(t) = exp((1 - u) ln initial + u ln final), u = clip(t / steps, 0,
// 1), t counted from 1 (docs/spec/method.md, 3.2). Always double: in float the rate drifts by 4e-4 over a run
// (docs/spec/numerics.md, OP5). Cost: two logs and an exp.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>

#include "compmark/core/config.hpp"

namespace compmark {

/// Anything that gives a rate for an iteration.
template <class S>
concept Schedule = requires(const S& schedule, std::int64_t iteration) {
  { schedule.value(iteration) } -> std::same_as<double>;
};

/// The same rate always.
struct Constant {
  double rate = 0;
  [[nodiscard]] constexpr double value(std::int64_t /*iteration*/) const { return rate; }
};

/// From `initial` to `final` on a straight line in log space over `steps` iterations, then `final` for ever. The ends
/// are exact, and equal ends give exactly that rate. Both rates must be positive, or both zero (a block that never
/// trains).
struct LogLinear {
  double initial = 0;
  double final = 0;
  std::int64_t steps = 30000;

  [[nodiscard]] double value(std::int64_t iteration) const {
    COMPMARK_ASSERT((initial > 0 && final > 0) || (initial == 0 && final == 0),
                    "LogLinear: rates must be positive, or both zero");
    if (initial == final || iteration <= 0) return initial;
    if (iteration >= steps) return final;
    const double u = static_cast<double>(iteration) / static_cast<double>(steps);
    return std::exp((1 - u) * std::log(initial) + u * std::log(final));
  }
};

}  // namespace compmark
