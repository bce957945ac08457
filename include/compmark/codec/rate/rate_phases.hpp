// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The schedule of the entropy model in a training for compression (docs/spec/compression.md, 1.6): first nothing, then
// the noise of fixed steps, then that of predicted steps with the rate as a loss. The windows of RateNumbers are
// written for a run of 30,000 iterations and scale with the run, as everywhere. Cost: none.
#pragma once

#include <cstdint>
#include <utility>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/optim/phases.hpp"
#include "compmark/splat/training/network_schedule.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/settings.hpp"

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

  /// Whether the context begins in this iteration, from the anchors as they are.
  [[nodiscard]] bool begins(std::int64_t t) const { return t == context_after_ + 1; }
  /// Whether anchors were added since the context began, so that it is renewed.
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

/// The numbers of a run for an entropy model whose handles are named as those of HAC and ContextGS.
template <class Scalar, class Handles>
void set_rate_schedules(ParameterArena<Scalar>& arena, const Handles& handles, const RateNumbers& rate) {
  const auto from_context = [&](const LearningRate& r) {
    return LearningSchedule{r.initial, r.final, RateUnit::one, rate.context_after};
  };
  if constexpr (requires { handles.mask; }) {
    arena.set_schedule(handles.mask, {rate.mask.initial, rate.mask.final, RateUnit::scene_extent});
  }
  if constexpr (requires { handles.grid; }) arena.set_schedule(handles.grid, from_context(rate.grid));
  if constexpr (requires { handles.weight1; }) {
    detail::set_network_schedule(arena, handles, from_context(rate.context));
  }
  if constexpr (requires { handles.network[0].weight1; }) {
    for (const auto& network : handles.network)
      detail::set_network_schedule(arena, network, from_context(rate.context));
  }
  if constexpr (requires { handles.hyperprior; }) {
    arena.set_schedule(handles.hyperprior, from_context({rate.hyperprior, rate.hyperprior}));
  }
  if constexpr (requires { handles.prior; }) arena.set_schedule(handles.prior, from_context(rate.context));
}

/// Box and statistics, and cells of levels, which the entropy model computes from all anchors in some iterations.
template <class Rate, class Model>
void prepare_context(Model& model, const typename Rate::Handles& blocks, const RatePhases& phases, std::int64_t t) {
  const auto columns = std::as_const(model).columns();
  if (phases.begins(t)) {
    if constexpr (requires { Rate::choose_cells(model.arena, blocks, columns.position); }) {
      Rate::begin_context(model.arena, blocks, columns.position, columns.feature, columns.scaling, columns.offset,
                          model.voxel_size);
    } else {
      Rate::begin_context(model.arena, blocks, columns.position, columns.feature, columns.scaling, columns.offset);
    }
  } else if (phases.renews(t)) {
    if constexpr (requires { Rate::choose_cells(model.arena, blocks, columns.position); }) {
      Rate::choose_cells(model.arena, blocks, columns.position);
    }
  }
}

/// The entropy model of a recipe with the numbers of a run: it is told those that its Settings name.
template <Recipe R>
[[nodiscard]] RecipeEntropyModel<R> entropy_model(const RateNumbers& numbers) {
  typename RecipeEntropyModel<R>::Settings settings;
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
  return RecipeEntropyModel<R>(settings);
}

}  // namespace compmark
