// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A background of a new random colour in every iteration, behind the render and behind the transparent photograph
// alike: whatever the model paints where the photograph is transparent is wrong for most colours, so it learns to leave
// it empty. Evaluation and rendering use the constant background. Cost: none in the pixel loop; the photograph is
// composited again in every iteration.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "compmark/core/random.hpp"
#include "compmark/splat/effect/concept.hpp"

namespace compmark {

struct RandomBackground {
  static constexpr bool is_absent = false;
  struct Settings {};
  /// The colour of this iteration; `drawn` is false outside training.
  struct Context {
    std::array<double, 3> color{};
    bool drawn = false;
  };
  /// Uniform in [0, 1]^3, a function of (seed, iteration).
  [[nodiscard]] static std::array<double, 3> color(std::uint64_t seed, std::uint64_t iteration) {
    const Random random(seed, iteration, random_stage("background"));
    return {random.uniform(0), random.uniform(1), random.uniform(2)};
  }
};

}  // namespace compmark
