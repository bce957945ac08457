// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A run in which growing and pruning happen many times: the windows of 30,000 iterations are there, and close together.
#pragma once

#include <compmark/splat/training/settings.hpp>
#include <cstdint>

namespace compmark::testing {

inline TrainSettings growing_run(std::int64_t iterations) {
  TrainSettings settings;
  settings.iterations = iterations;
  settings.seed = 5;
  settings.grow_interval = 10;
  settings.statistics_after = 1000;
  settings.grow_after = 2000;
  settings.grow_until = 25000;
  settings.gradient_threshold = 1e-5;
  settings.voxel_size = 0.05;
  settings.init_factor = 4;
  return settings;
}

}  // namespace compmark::testing
