// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Anchors that are lost while a mark is learned, so that it survives that a model is pruned: in one reading of
// `one_in`, a share of the visible anchors, drawn anew up to PosthocSettings::lost_anchors, is not decoded, neither in
// the marked render nor in the unmarked one that it is compared with (in place of a photograph). A stage of recipes that hide a message in a
// finished model (recipes::WithLostAnchors). Cost: a random number a visible anchor in such a reading.
#pragma once

#include <cstddef>
#include <cstdint>

#include "compmark/core/buffer.hpp"
#include "compmark/core/random.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/stage.hpp"

namespace compmark {

class LostAnchorsStage : public Stage<LostAnchorsStage> {
 public:
  static constexpr double one_in = 3;
  struct Phase {
    double share = 0;  ///< of the visible anchors
    StageIteration iteration;
  };

  template <class R>
  void configure(const TrainSettings& settings) {
    const PosthocSettings& posthoc = settings.mark.posthoc;
    most_ = posthoc.fidelity > 0 ? posthoc.lost_anchors : 0;  // a photograph is rendered with all of them
  }
  void set_phase(const StageIteration& iteration, Phase& phase) const {
    phase = {};
    if (!(most_ > 0)) return;
    const Random random = numbers(iteration);
    if (random.uniform(0) * one_in >= 1) return;
    phase.share = most_ * random.uniform(1);
    phase.iteration = iteration;
  }
  static void choose_visible(const Phase& phase, Buffer<std::uint32_t>& visible) {
    if (!(phase.share > 0)) return;
    const Random random = numbers(phase.iteration);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < visible.size(); ++i) {
      const std::uint32_t row = visible[i];
      if (random.uniform(2 + std::uint64_t(row)) >= phase.share) visible[kept++] = row;
    }
    visible.resize(kept);
  }

 private:
  [[nodiscard]] static Random numbers(const StageIteration& iteration) {
    return {iteration.seed, static_cast<std::uint64_t>(iteration.t), random_stage("lost anchors")};
  }

  double most_ = 0;
};

}  // namespace compmark
