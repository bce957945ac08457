// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The stage of a Background (splat/effect/concept.hpp): the colour behind the scene in an iteration of training. Cost:
// none.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "compmark/splat/training/stage.hpp"

namespace compmark {

template <class Drawn>
struct BackgroundStage : Stage<BackgroundStage<Drawn>> {
  /// The colour of an iteration; outside of training nothing is drawn, and the model's own counts.
  using Phase = typename Drawn::Context;
  static constexpr bool needs_target_planes = true;

  static void set_phase(const StageIteration& iteration, Phase& phase) {
    phase.color = Drawn::color(iteration.seed, static_cast<std::uint64_t>(iteration.t));
    phase.drawn = true;
  }
  static void leave_photograph(Phase& phase) { phase = {}; }
  template <class T>
  static void background(const Phase& phase, std::array<T, 3>& color) {
    if (!phase.drawn) return;
    for (std::size_t c = 0; c < 3; ++c) color[c] = static_cast<T>(phase.color[c]);
  }
};

}  // namespace compmark
