// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The gradient law: an analytic gradient against central differences in double. The step is h = cbrt(eps) (1 + |x|),
// where the truncation and the rounding of a central difference balance; an error well above 1e-7 of the gradient's
// size is then a defect, not noise.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "compmark/core/random.hpp"
#include "compmark/testing/violations.hpp"

namespace compmark {
namespace testing {

/// d loss / d x[i] by a central difference; x is restored.
template <class Loss>
[[nodiscard]] double central_difference(const Loss& loss, double& x) {
  const double kept = x;
  const double h = std::cbrt(std::numeric_limits<double>::epsilon()) * (1 + std::abs(kept));
  x = kept + h;
  const double up = x;
  const double above = loss();
  x = kept - h;
  const double down = x;
  const double below = loss();
  x = kept;
  return (above - below) / (up - down);
}

/// Checks `samples` randomly chosen entries (all of them when samples >= x.size()) of `gradient` against differences of
/// loss() with respect to x, which loss() must read. `tolerance` is relative to the largest gradient met. Empty text
/// when the law holds.
template <class Loss>
[[nodiscard]] std::string gradient_law(const Loss& loss, std::span<double> x, std::span<const double> gradient,
                                       double tolerance = 1e-6, std::size_t samples = 64, std::uint64_t seed = 1) {
  Violations violations;
  violations.expect(x.size() == gradient.size(), "gradient", "the gradient has not the shape of its variable");
  if (x.size() != gradient.size() || x.empty()) return violations.text();
  double size = 0;
  for (const double g : gradient) size = std::max(size, std::abs(g));
  const Random random(seed, 0, random_stage("testing/gradient_law"));
  const bool all = samples >= x.size();
  for (std::size_t s = 0; s < (all ? x.size() : samples); ++s) {
    const std::size_t i = all ? s : static_cast<std::size_t>(random.below(s, x.size()));
    const double expected = central_difference(loss, x[i]);
    const double error = std::abs(gradient[i] - expected);
    if (error <= tolerance * std::max(size, std::abs(expected))) continue;  // false for NaN
    violations.expect(false, "gradient",
                      "entry " + std::to_string(i) + ": analytic " + std::to_string(gradient[i]) + ", difference " +
                          std::to_string(expected) + ", error " + std::to_string(error));
  }
  return violations.text();
}

/// The derivative of loss() along a random direction through all variables at once, against the sum of gradient times
/// direction: one number for a whole pipeline. Variable k is x[k] with gradients gradient[k]; entries move in
/// proportion to (1 + |x|). Two step sizes are combined so that the truncation is of fourth order. Returns |analytic -
/// difference| / max(|analytic|, |difference|); x is restored.
template <class Loss>
[[nodiscard]] double directional_error(const Loss& loss, std::span<const std::span<double>> x,
                                       std::span<const std::span<const double>> gradient, double step = 1e-4,
                                       std::uint64_t seed = 1) {
  const Random random(seed, 0, random_stage("testing/directional_error"));
  std::vector<double> kept, direction;
  double analytic = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    for (std::size_t i = 0; i < x[k].size(); ++i) {
      kept.push_back(x[k][i]);
      direction.push_back(static_cast<double>(random.centered(direction.size())) * (1 + std::abs(x[k][i])));
      analytic += gradient[k][i] * direction.back();
    }
  }
  const auto at = [&](double t) {
    std::size_t n = 0;
    for (const std::span<double>& variable : x) {
      for (double& value : variable) {
        value = kept[n] + t * direction[n];
        ++n;
      }
    }
    return loss();
  };
  const double wide = (at(step) - at(-step)) / (2 * step), narrow = (at(step / 2) - at(-step / 2)) / step;
  at(0);
  const double difference = narrow + (narrow - wide) / 3;
  return std::abs(analytic - difference) / std::max({std::abs(analytic), std::abs(difference), 1e-300});
}

}  // namespace testing
}  // namespace compmark
