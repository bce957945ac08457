// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Learning rates of the blocks of a recipe's parameters. A stage declares a schedule with each of its blocks; a run's
// settings replace the schedules of the stages that they have numbers for. Other stages keep their declared schedules.
// No name decides anything. Cost: a logarithm and an exponential a block and iteration.
#pragma once

#include <cstdint>
#include <vector>

#include "compmark/core/parameters.hpp"
#include "compmark/splat/optim/phases.hpp"
#include "compmark/splat/optim/schedule.hpp"
#include "compmark/splat/training/model.hpp"
#include "compmark/splat/training/network_schedule.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/settings.hpp"

namespace compmark {

/// Learning rate of a block of this schedule in iteration t (from 1) of a run of `iterations`.
[[nodiscard]] inline double learning_rate(const LearningSchedule& schedule, std::int64_t iterations,
                                          double scene_extent, std::int64_t t) {
  if (t <= scale_iteration(schedule.starts_after, iterations)) return 0;
  const double unit = schedule.unit == RateUnit::scene_extent ? scene_extent : 1;
  const std::int64_t from = scale_iteration(schedule.decays_from, iterations);
  return LogLinear{schedule.initial * unit, schedule.final * unit, iterations - from}.value(t - from);
}

/// Those of all blocks.
inline void learning_rates(const ArenaLayout& layout, std::int64_t iterations, double scene_extent, std::int64_t t,
                           std::vector<double>& rates) {
  rates.clear();
  for (const auto& block : layout.blocks()) rates.push_back(learning_rate(block.schedule, iterations, scene_extent, t));
}

/// Replaces the schedules that the stages of `model` declared by those of a run, where `settings` has numbers for the
/// stage.
template <Recipe R>
void set_schedules(Model<R>& model, const TrainSettings& settings) {
  auto& arena = model.arena;
  const auto schedule = [](const LearningRate& r, RateUnit unit = RateUnit::one) {
    return LearningSchedule{r.initial, r.final, unit};
  };
  arena.set_schedule(model.anchors.offset, schedule(settings.offset, RateUnit::scene_extent));
  arena.set_schedule(model.anchors.feature, schedule(settings.feature));
  arena.set_schedule(model.anchors.scaling, schedule(settings.scaling));
  [[maybe_unused]] const auto& heads = model.decoder;
  if constexpr (requires { heads.opacity.weight1, heads.covariance.weight1, heads.color.weight1; }) {
    detail::set_network_schedule(arena, heads.opacity, schedule(settings.mlp_opacity));
    detail::set_network_schedule(arena, heads.covariance, schedule(settings.mlp_covariance));
    detail::set_network_schedule(arena, heads.color, schedule(settings.mlp_color));
  }
  if constexpr (requires { heads.feature_bank.weight1; }) {
    detail::set_network_schedule(arena, heads.feature_bank, schedule(settings.feature_bank));
  }
  if constexpr (requires { heads.appearance.index; }) {
    arena.set_schedule(heads.appearance, schedule(settings.appearance));
  }
  Model<R>::Stages::forward([&]<class S>() { S::set_schedules(arena, model.template blocks<S>(), settings); });
}

}  // namespace compmark
