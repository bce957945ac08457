// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A small model with Fourier features to read it by, for the cases of fourier_probe.hpp and fourier_statistics.hpp.
#pragma once

#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/watermark/fit/fourier_probe.hpp"
#include "compmark/watermark/pretrain/lattice_network.hpp"
#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace compmark::testing {

using FourierBenchProbe = detail::FourierProbe<SmallestSmoothRecipe, BlobViews, ThreadExecutor>;

inline DecoderFitSettings small_statistics() {
  DecoderFitSettings settings;
  settings.bits = 4;
  settings.features = 6;
  settings.period = 0.4;
  settings.statistics_views = 20;
  settings.gradient_views = 3;
  settings.reach = 1;
  settings.stride = 2;
  settings.edits_per_view = 0;
  settings.tone = 0;
  settings.ridge = 0.01;
  return settings;
}
/// A model, its Fourier features and a probe of them; some of its anchors alone where `anchors` says so.
struct FourierBench {
  explicit FourierBench(const DecoderFitSettings& chosen = small_statistics())
      : settings(chosen),
        unmarked(random_model<SmallestSmoothRecipe>(7)) {
    lattice.measure = LatticeMeasure::colour;
    lattice.bits = settings.bits;
    lattice.features = settings.features;
    lattice.sigma = {0.5};
    lattice.stride = 2;
    weights = random_lattice<double>(lattice, std::vector<double>{settings.period}, settings.seed, 1);
  }
  [[nodiscard]] FourierBenchProbe probe() { return {unmarked, views, lattice, weights, settings, executor}; }

  DecoderFitSettings settings;
  Model<SmallestSmoothRecipe> unmarked;
  BlobViews views{.count = 6, .width = 24, .height = 20};
  LatticeSettings lattice;
  LatticeWeights<double> weights;
  ThreadExecutor executor{2};
};

}  // namespace compmark::testing
