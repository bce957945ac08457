// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The laws of a Quantizer (splat/quantizer/concept.hpp) as a function a plug-in's own tests can call. Empty text means
// that they hold.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>

#include "compmark/core/random.hpp"
#include "compmark/splat/quantizer/concept.hpp"
#include "compmark/testing/violations.hpp"

namespace compmark {
namespace testing {

/// Q1 to Q4, at `samples` random values and steps. `Q` computes in double.
template <Quantizer Q>
[[nodiscard]] std::string quantizer_laws(std::size_t samples = 2000) {
  using T = typename Q::Scalar;
  static_assert(std::is_same_v<T, double>, "central differences need double");
  Violations violations;
  const Random random(5, 0, random_stage("testing/quantizer_laws"));
  for (std::uint64_t i = 0; i < samples; ++i) {
    const T r = 3 * random.normal(4 * i), q0 = std::exp(random.normal(4 * i + 1));
    const T least = 0.01 * q0 * random.uniform(4 * i + 2), x = 20 * q0 * random.normal(4 * i + 3);
    const std::string at = " at r = " + std::to_string(r) + ", q0 = " + std::to_string(q0);
    const T q = Q::step(r, q0, least);
    violations.expect(q >= least && q > 0 && q <= 2 * q0, "Q1", "step " + std::to_string(q) + at);
    const T h = 1e-5, high = Q::step(r + h, q0, least), low = Q::step(r - h, q0, least);
    const bool held = q <= least || high <= least || low <= least;  // the step has a kink where it begins to be held
    const T slope = (high - low) / (2 * h);
    violations.expect(held || std::abs(Q::step_slope(r, q0, least) - slope) <= 1e-6 * q0, "Q2",
                      "step_slope is not the derivative of step" + at);
    const T log_slope = (std::log(high) - std::log(low)) / (2 * h);
    violations.expect(held || std::abs(Q::step_log_slope(r) - log_slope) <= 1e-6, "Q2",
                      "step_log_slope is not the derivative of ln step" + at);
    const T symbol = Q::symbol(x, q), value = Q::value(x, q), error = Q::error(x, q);
    violations.expect(symbol == std::nearbyint(symbol), "Q3", "symbol is no integer" + at);
    violations.expect(std::abs(value - q * symbol) <= 1e-15 * std::abs(value), "Q3", "value is not q symbol" + at);
    violations.expect(std::abs(error) <= 0.5 + 1e-12, "Q3", "error " + std::to_string(error) + at);
    violations.expect(std::abs(x + q * error - value) <= 1e-12 * (std::abs(x) + q), "Q3",
                      "x + q error is not value" + at);
    violations.expect(std::abs(Q::value(value, q) - value) <= 1e-15 * std::abs(value), "Q3",
                      "value of a value is another" + at);
    violations.expect(Q::symbol(-x, q) == -symbol, "Q4", "symbol(-x) is not -symbol(x)" + at);
  }
  return violations.text();
}

}  // namespace testing
}  // namespace compmark
