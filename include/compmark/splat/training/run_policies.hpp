// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Gives the numbers of a run to the policies of its recipe: each gets those that its Settings name, as the concepts ask
// for none of them. The entropy model's is in rate_phases.hpp. Cost: none.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>

#include "compmark/core/absent.hpp"
#include "compmark/core/result.hpp"
#include "compmark/splat/anchor/frequency_selector.hpp"
#include "compmark/splat/optim/phases.hpp"
#include "compmark/splat/training/coarse_to_fine.hpp"
#include "compmark/splat/training/recipe.hpp"
#include "compmark/splat/training/settings.hpp"

namespace compmark {

[[nodiscard]] inline DensityPhases density_phases(const TrainSettings& run) {
  return {open_window(run.statistics_after, run.grow_until, run.iterations),
          open_window(run.grow_after, run.grow_until, run.iterations),
          closed_window(run.pause_from, run.pause_until, run.iterations), run.grow_interval};
}

[[nodiscard]] inline Window frequency_window(const TrainSettings& run) {
  return closed_window(run.mark.frequency.grow_from, run.mark.frequency.grow_until, run.iterations);
}

/// `in_window`: of frequency-aware growing, where the recipe has it.
template <Recipe R>
[[nodiscard]] typename R::DensityControl density_control(const TrainSettings& run, bool in_window = false) {
  typename R::DensityControl::Settings settings;
  if constexpr (grows_by_frequency<typename R::DensityControl>) {
    settings.in_window = in_window;
    settings.band.lowest = run.mark.frequency.band_lowest;
    settings.band.highest = run.mark.frequency.band_highest;
    settings.band.mapping = run.mark.frequency.published_pixels ? PixelMapping::published : PixelMapping::correct;
  } else {
    static_cast<void>(in_window);
  }
  if constexpr (requires { settings.gradient_threshold; }) settings.gradient_threshold = run.gradient_threshold;
  if constexpr (requires { settings.success_threshold; }) settings.success_threshold = run.success_threshold;
  if constexpr (requires { settings.min_opacity; }) settings.min_opacity = run.min_opacity;
  if constexpr (requires { settings.init_factor; }) settings.init_factor = run.init_factor;
  if constexpr (requires { settings.interval; }) settings.interval = run.grow_interval;
  if constexpr (requires { settings.max_anchors; }) settings.max_anchors = run.max_anchors;
  if constexpr (requires { settings.offsets; }) settings.offsets = R::AnchorModel::shape.offsets;
  return typename R::DensityControl{settings};
}

/// The space of a run: that of the world has no numbers.
template <Recipe R>
[[nodiscard]] typename R::Space space_of_run([[maybe_unused]] const TrainSettings& run) {
  if constexpr (present<typename R::Space>) {
    return {run.effects.space_origin, run.effects.space_radius};
  } else {
    return {};
  }
}

/// An Error if the coarse levels of a run are none, or if its message would be read in coarse images: a decoder reads
/// pictures of the size that is shipped.
template <Recipe R>
[[nodiscard]] Result<Done> check_coarse_to_fine(const TrainSettings& run) {
  if (Result<Done> fits = check_coarse_to_fine(run.coarse_to_fine); !fits) return fits;
  if constexpr (present<typename R::MessageDecoder>) {
    const std::int64_t message = scale_iteration(run.mark.message.after, run.iterations);
    const std::int64_t coarse = run.coarse_to_fine.last_iteration(run.iterations);
    if (coarse > message) {
      return Error{ErrorKind::unsupported,
                   {},
                   "coarse_to_fine",
                   "looks at coarse images until iteration " + std::to_string(coarse) +
                       ", and the message is read after iteration " + std::to_string(message),
                   "end the last level before the message begins, or mark the finished model"};
    }
  }
  return Done{};
}

/// Of a recipe with an HsvLoss.
template <Recipe R>
[[nodiscard]] typename R::HsvLoss hsv_loss(const MarkNumbers& mark) {
  if constexpr (requires { R::HsvLoss::Settings::paper(); }) {
    auto settings = mark.hsv.as_written ? R::HsvLoss::Settings::paper() : typename R::HsvLoss::Settings();
    settings.source = mark.hsv.source;
    return typename R::HsvLoss(settings);
  } else {
    static_cast<void>(mark);
    return typename R::HsvLoss();
  }
}

/// Of a recipe with a FrequencyLoss.
template <Recipe R>
[[nodiscard]] typename R::FrequencyLoss frequency_loss(const MarkNumbers& mark) {
  if constexpr (requires { R::FrequencyLoss::Settings::intended(); }) {
    auto settings =
        mark.frequency.high_pass ? R::FrequencyLoss::Settings::intended() : typename R::FrequencyLoss::Settings();
    settings.side = mark.frequency.side;
    return typename R::FrequencyLoss(settings);
  } else {
    static_cast<void>(mark);
    return typename R::FrequencyLoss();
  }
}

/// Of a recipe with a DistortionLayer; one without Settings takes no numbers.
template <Recipe R>
[[nodiscard]] RecipeDistortion<R> distortion_layer(const MarkNumbers& mark) {
  if constexpr (requires { typename RecipeDistortion<R>::Settings; }) {
    typename RecipeDistortion<R>::Settings settings;
    if constexpr (requires { settings.base_step; }) settings.base_step = mark.distortion.feature_noise;
    if constexpr (requires { settings.least_step; }) settings.least_step = mark.distortion.least_step;
    if constexpr (requires { settings.rate_weight; }) settings.rate_weight = mark.distortion.rate_weight;
    return RecipeDistortion<R>(settings);
  } else {
    static_cast<void>(mark);
    return {};
  }
}

}  // namespace compmark
