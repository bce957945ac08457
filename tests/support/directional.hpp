// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The whole pass against central differences: a small model in double whose every parameter carries gradient, and the check of its
// directional derivative.
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <compmark/recipes/scaffold.hpp>
#include <compmark/splat/training/pipeline.hpp>
#include <string>
#include <vector>

#include "support/small_scene.hpp"

namespace compmark::testing {

/// Smooth everywhere: the cut-off is a ramp, nothing stops, nothing is clamped (docs/spec/numerics.md, BF4).
inline constexpr Accuracy smooth_accuracy{
    .exp_degree = 0, .alpha_max = 1.0f, .transmittance_stop = 0.0f, .cutoff = CutoffRule::smooth};

struct SmoothRecipe : DefaultRecipe<double, small_shape, smooth_accuracy> {};
/// Half of that, for what is rendered many times.
struct SmallestSmoothRecipe : DefaultRecipe<double, DecoderShape{.feature_dim = 4, .offsets = 2}, smooth_accuracy> {};

/// A model with every parameter away from zero, so that every path carries gradient.
template <class R>
Model<R> random_model(std::size_t anchors) {
  Model<R> model;
  model.create(anchors, 2);
  R::GaussianDecoder::initialise(model.arena, model.decoder, 3);
  const AnchorColumns<double> columns = anchor_values(model.arena, model.anchors);
  const Random random(11, 0, random_stage("test model"));
  for (std::size_t i = 0; i < columns.position.size(); ++i) columns.position.data[i] = 1.2 * random.uniform(i) - 0.6;
  for (std::size_t i = 0; i < columns.offset.size(); ++i) columns.offset.data[i] = random.normal(i + 1000);
  for (std::size_t i = 0; i < columns.scaling.size(); ++i)
    columns.scaling.data[i] = -1.8 + 0.3 * random.normal(i + 2000);
  for (std::size_t i = 0; i < columns.feature.size(); ++i) columns.feature.data[i] = random.normal(i + 3000);
  model.render.background = {0.2, 0.4, 0.1};
  return model;
}

/// `loss(context)` renders model and returns the loss; `backward(context)` then leaves the gradient in the arena. Four random directions
/// over all parameters but the positions and the blocks of `left_out`, each to 1e-6.
template <class R, class Loss, class Backward>
void check_directional_derivative(Model<R>& model, const Loss& loss, const Backward& backward,
                                  const std::vector<std::string>& left_out = {}) {
  typename Pipeline<R>::Context context;
  CHECK(std::isfinite(loss(context)));
  backward(context);
  const ArenaLayout& layout = model.arena.layout();
  const std::vector<double> start(model.arena.all_values().begin(), model.arena.all_values().end());
  for (int trial = 0; trial < 4; ++trial) {
    std::vector<double> direction(start.size(), 0.0);
    const Random pick(17, static_cast<std::uint64_t>(trial), random_stage("test direction"));
    for (const ArenaLayout::Block& block : layout.blocks()) {
      if (block.name == "anchor.position") continue;  // never trained: its gradient is not computed
      if (std::find(left_out.begin(), left_out.end(), block.name) != left_out.end()) continue;
      for (std::size_t i = 0; i < block.size(); ++i) direction[block.offset + i] = pick.normal(block.offset + i);
    }
    double analytic = 0;
    for (std::size_t i = 0; i < start.size(); ++i) analytic += direction[i] * model.arena.all_gradients()[i];
    double best = 1;
    for (const double h : {3e-5, 1e-5, 3e-6, 1e-6}) {  // best of a sweep: truncation against rounding
      const auto at = [&](double step) {
        for (std::size_t i = 0; i < start.size(); ++i) model.arena.all_values()[i] = start[i] + step * direction[i];
        typename Pipeline<R>::Context fresh;
        return loss(fresh);
      };
      const double numeric = (at(h) - at(-h)) / (2 * h);
      best = std::min(best, std::abs(numeric - analytic) / std::max(1e-12, std::abs(numeric)));
    }
    std::copy(start.begin(), start.end(), model.arena.all_values().begin());
    INFO("trial ", trial, ": relative error ", best, " of derivative ", analytic);
    CHECK(std::abs(analytic) > 1e-6);
    CHECK(best <= 1e-6);
  }
}

}  // namespace compmark::testing
