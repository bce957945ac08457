// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Observers: the trainer calls one after every iteration. An observer reads and never changes the model. The library
// itself prints nothing and has no clock: progress bars, logs and Ctrl-C are observers of the program that embeds it.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

#include "compmark/splat/training/pipeline.hpp"

namespace compmark {

struct IterationReport {
  std::int64_t iteration = 0;  ///< 1-based, the one just finished
  std::int64_t total = 0;
  std::size_t view = 0;  ///< which training view was rendered
  bool rendered =
      true;  ///< false: no view was looked at, and nothing was learned (post-hoc embedding that reads now and then)
  LossReport loss;
  ForwardReport forward;
  std::size_t anchors = 0;  ///< after growing and pruning
  std::size_t grown = 0;    ///< anchors born in this iteration
  std::size_t pruned = 0;   ///< anchors removed in this iteration
  bool adjusted = false;    ///< growing and pruning ran
  bool revived = false;     ///< the training had died: no Gaussian was drawn, and opacities were set anew
  std::size_t skipped_blocks =
      0;  ///< parameter blocks whose gradient was not finite and whose step was therefore skipped
};

/// on_iteration returns false to stop after this iteration; `trainer` gives access to the current image and model.
template <class O, class TrainerType>
concept Observer = requires(O& observer, const TrainerType& trainer, const IterationReport& report) {
  { observer.on_iteration(trainer, report) } -> std::convertible_to<bool>;
};

/// An observer that does nothing.
struct NoObserver {
  template <class TrainerType>
  constexpr bool on_iteration(const TrainerType& /*trainer*/, const IterationReport& /*report*/) const {
    return true;
  }
};

}  // namespace compmark
