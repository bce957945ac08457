// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A small host with waves to read it by, for the cases of wave_probe.hpp and wave_statistics.hpp.
#pragma once

#include <vector>

#include "compmark/core/thread_executor.hpp"
#include "compmark/watermark/fit/wave_probe.hpp"
#include "compmark/watermark/pretrain/lattice_network.hpp"
#include "support/directional.hpp"
#include "support/small_scene.hpp"

namespace compmark::testing {

using WaveBenchProbe = detail::WaveProbe<SmallestSmoothRecipe, BlobViews, ThreadExecutor>;

inline DecoderFitSettings small_statistics() {
  DecoderFitSettings settings;
  settings.bits = 4;
  settings.waves = 6;
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
/// A host, its waves and a probe of them; some of its anchors alone where `anchors` says so.
struct WaveBench {
  explicit WaveBench(const DecoderFitSettings& chosen = small_statistics())
      : settings(chosen),
        host(random_model<SmallestSmoothRecipe>(7)) {
    lattice.measure = LatticeMeasure::colour;
    lattice.bits = settings.bits;
    lattice.features = settings.waves;
    lattice.sigma = {0.5};
    lattice.stride = 2;
    waves = random_lattice<double>(lattice, std::vector<double>{settings.period}, settings.seed, 1);
  }
  [[nodiscard]] WaveBenchProbe probe() { return {host, views, lattice, waves, settings, executor}; }

  DecoderFitSettings settings;
  Model<SmallestSmoothRecipe> host;
  BlobViews views{.count = 6, .width = 24, .height = 20};
  LatticeSettings lattice;
  LatticeWeights<double> waves;
  ThreadExecutor executor{2};
};

}  // namespace compmark::testing
