// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// For tests that hide eight bits in a small finished model: the model, the numbers of the mark, and whether two models are equal.
#pragma once

#include <algorithm>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/splat/training/settings.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <cstdint>
#include <vector>

#include "support/small_scene.hpp"

namespace compmark::testing {

inline const std::vector<std::uint8_t> eight_bits{1, 0, 0, 1, 1, 1, 0, 1};

/// Post-hoc embedding that reads a sampled view in every iteration.
inline TrainSettings short_embedding(std::int64_t iterations) {
  TrainSettings settings;
  settings.iterations = iterations;
  settings.seed = 4;
  settings.mark.message.after = settings.mark.residual.after = 0;
  settings.mark.message.ramp = 0;
  settings.mark.message.logit_scale = 1;
  settings.mark.message.hinge_margin = 0.2;
  settings.mark.message.novel_view_every = 1;
  settings.mark.message.lambda = 1;
  settings.mark.residual.learning_rate = 0.02;
  settings.mark.posthoc.fidelity = 60;
  return settings;
}

/// A model of the blob's views after twenty iterations; an Error is returned as it came.
template <class R, class Views>
Result<Model<R>> briefly_trained(const Views& views, ThreadExecutor& executor) {
  TrainSettings settings;
  settings.iterations = 20;
  settings.voxel_size = 0.05;
  Trainer<R, ThreadExecutor> trainer(settings, views.size(), 1.0, executor);
  if (Result<Done> ready = trainer.initialise(cloud(300, 7)); !ready) return ready.error();
  if (Result<Done> trained = trainer.run(views); !trained) return trained.error();
  return trainer.model();
}

/// Every parameter, to the bit.
template <class M>
bool same_values(const M& a, const M& b) {
  const auto one = a.arena.all_values(), other = b.arena.all_values();
  return std::equal(one.begin(), one.end(), other.begin(), other.end());
}

}  // namespace compmark::testing
