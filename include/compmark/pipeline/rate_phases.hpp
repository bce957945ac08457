// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// What the entropy model does in which iteration of a training for compression (compression sheet, 1.9): nothing, then the noise of fixed
// steps, then that of predicted ones with the rate as a loss. The windows of RateNumbers are written for a run of 30,000 iterations and scale
// with the run, as everywhere. Cost: none.
#pragma once

#include <cstdint>
#include <utility>

#include "compmark/optim/phases.hpp"
#include "compmark/pipeline/model.hpp"
#include "compmark/pipeline/recipe.hpp"
#include "compmark/pipeline/settings.hpp"

namespace compmark {

class RatePhases {
 public:
  RatePhases() = default;
  /// `grow_until` of a run of 30,000, as all of them.
  RatePhases(const RateNumbers& numbers, std::int64_t total, std::int64_t grow_until = 15000)
      : noise_after_(scale_iteration(numbers.noise_after, total)),
        context_after_(scale_iteration(numbers.context_after, total)),
        round_after_(scale_iteration(numbers.round_after, total)),
        grown_(scale_iteration(grow_until, total)) {}

  /// Whether the context is made up in this iteration, from the anchors as they are.
  [[nodiscard]] bool begins(std::int64_t t) const { return t == context_after_ + 1; }
  /// Whether anchors were born since, so that what was made up from them is looked at again.
  [[nodiscard]] bool renews(std::int64_t t) const { return t == grown_ && counts(t - 1); }
  /// Whether the rate counts.
  [[nodiscard]] bool counts(std::int64_t t) const { return t > context_after_; }

  template <class Phase>
  [[nodiscard]] Phase at(std::int64_t t, std::uint64_t seed) const {
    Phase phase;
    phase.seed = seed;
    phase.iteration = static_cast<std::uint64_t>(t);
    phase.context = counts(t);
    phase.noise = !phase.context && t > noise_after_;
    phase.round = phase.context && t > round_after_;
    return phase;
  }

 private:
  std::int64_t noise_after_ = 0, context_after_ = 0, round_after_ = 0, grown_ = 0;
};

/// What the entropy model makes up from all anchors, in the iterations in which it does: box and statistics, cells of levels.
template <Recipe R>
void prepare_context(Model<R>& model, const RatePhases& phases, std::int64_t t) {
  using Rate = typename R::EntropyModel;
  const auto columns = std::as_const(model).columns();
  if (phases.begins(t)) {
    if constexpr (requires { Rate::choose_cells(model.arena, model.road.rate, columns.position); }) {
      Rate::begin_context(model.arena, model.road.rate, columns.position, columns.feature, columns.scaling,
                          columns.offset, model.voxel_size);
    } else {
      Rate::begin_context(model.arena, model.road.rate, columns.position, columns.feature, columns.scaling,
                          columns.offset);
    }
  } else if (phases.renews(t)) {
    if constexpr (requires { Rate::choose_cells(model.arena, model.road.rate, columns.position); }) {
      Rate::choose_cells(model.arena, model.road.rate, columns.position);
    }
  }
}

/// The entropy model of a recipe with the numbers of a run: it is told those that its Settings name.
template <Recipe R>
[[nodiscard]] typename R::EntropyModel entropy_model(const RateNumbers& numbers) {
  typename R::EntropyModel::Settings settings;
  settings.lambda = numbers.lambda;
  if constexpr (requires { settings.mask_weight; }) settings.mask_weight = numbers.mask_weight;
  if constexpr (requires { settings.sample; }) {
    if (numbers.sample > 0) settings.sample = numbers.sample;
  }
  if constexpr (requires { settings.step_share; }) {
    if (numbers.step_share > 0) settings.step_share = numbers.step_share;
  }
  if constexpr (present<typename R::Embedder> && requires { settings.sample_all; }) {
    settings.sample_all = false;  // only visible anchors are embedded, and the rate is that of embedded ones
  }
  settings.feature_step = numbers.feature_step;
  settings.scaling_step = numbers.scaling_step;
  settings.offset_step = numbers.offset_step;
  return typename R::EntropyModel(settings);
}

}  // namespace compmark
