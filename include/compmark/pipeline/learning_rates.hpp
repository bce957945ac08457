// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// How fast each block of a recipe's parameters trains, by its name (method sheet, 3.2; compression sheet, 1.11): log-linear from an initial to a
// final rate over the run, offsets and masks in units of the scene extent. A block that nobody names has the rate 0 and is left out of the
// optimiser's step. Cost: a few comparisons of text a block and iteration.
#pragma once

#include <cstdint>
#include <string_view>

#include "compmark/core/absent.hpp"
#include "compmark/optim/phases.hpp"
#include "compmark/optim/schedule.hpp"
#include "compmark/pipeline/recipe.hpp"
#include "compmark/pipeline/settings.hpp"

namespace compmark::inline v0 {

/// Learning rate of the block `name` in iteration t.
template <Recipe R>
[[nodiscard]] double learning_rate(std::string_view name, const TrainSettings& settings, double scene_extent,
                                   std::int64_t t) {
  const auto begins = [&](std::string_view prefix) { return name.starts_with(prefix); };
  const auto rate = [&](const LearningRate& r, double unit = 1) {
    return LogLinear{r.initial * unit, r.final * unit, settings.iterations}.value(t);
  };
  if (name == "anchor.offset") return rate(settings.offset, scene_extent);
  if (name == "anchor.feature") return rate(settings.feature);
  if (name == "anchor.scaling") return rate(settings.scaling);
  if (begins("mlp_opacity")) return rate(settings.mlp_opacity);
  if (begins("mlp_covariance")) return rate(settings.mlp_covariance);
  if (begins("mlp_color")) return rate(settings.mlp_color);
  if (begins("feature_bank")) return rate(settings.feature_bank);
  if (begins("appearance")) return rate(settings.appearance);
  if constexpr (present<typename R::Embedder>) {
    const std::int64_t after = scale_iteration(settings.mark.residual_after, settings.iterations);
    if (name == "anchor.residual" && t > after) {
      const double first = settings.mark.residual_rate;
      return LogLinear{first, first * settings.mark.residual_decay, settings.iterations - after}.value(t - after);
    }
  }
  if constexpr (present<typename R::DistortionLayer>) {
    if (begins("distortion")) return settings.mark.distortion_rate;
  }
  if constexpr (present<typename R::EntropyModel>) {
    if (name == "anchor.mask") return rate(settings.rate.mask, scene_extent);
    if (t > scale_iteration(settings.rate.context_after, settings.iterations)) {
      if (name == "hash_grid") return rate(settings.rate.grid);
      const bool network = name.ends_with(".weight") || name.ends_with(".bias");
      if (begins("context") && network) return rate(settings.rate.context);
      if (name == "anchor.hyperprior") return settings.rate.hyperprior;
      if (name == "context_gs.prior") return rate(settings.rate.context);
    }
  }
  if constexpr (present<typename R::Exposure>) {
    if (name == "exposure") return rate(settings.effects.exposure);
  }
  return 0;
}

}  // namespace compmark::inline v0
