// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Concept Optimizer: turns the gradients of an arena into new values.
//
//   expression                                 meaning                                                         cost
//   typename O::Scalar, O::Settings, O::State  number type, run-time numbers, what lives across steps (goes
//                                              to checkpoints)
//   o.prepare(layout, state)                   fresh state for an arena of this layout                         O(arena)
//   o.step(arena, rates, state, executor)      one update of every block b with rates[b] > 0; returns an       O(arena)
//                                              OptimizerReport
//   o.edit_rows(edit, old, now, state)         follows a row edit of the arena: rows kept move, new rows       O(arena)
//                                              start fresh
//
// Laws: O1 a block with rate 0 changes no bit of its values and of its state; O2 a block whose gradient is not finite
// is left as it was, and counted (docs/spec/numerics.md, OP6); O3 rows that never had a gradient keep their bits; O4
// edit_rows moves the state of a kept row bit for bit; O5 same bits at any thread count.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>

#include "compmark/core/executor.hpp"
#include "compmark/core/parameters.hpp"

namespace compmark {

/// What one step did.
struct OptimizerReport {
  std::size_t stepped_blocks = 0;  ///< updated
  std::size_t skipped_blocks = 0;  ///< left as they were because their gradient was not finite
  BlockHandle first_skipped;       ///< the first of these; invalid if there is none
};

/// What a caller may ask of one step.
struct StepOptions {
  bool skip_anchor_blocks =
      false;  ///< treat anchor blocks as of rate 0: iterations in which growing rebuilt them have no gradient
  bool zero_gradients_after = false;  ///< leave all gradients zero, those of skipped blocks too; saves a pass over them
};

template <class O>
concept Optimizer = requires(const O& optimizer, ParameterArena<typename O::Scalar>& arena,
                             std::span<const double> rates, typename O::State& state, SerialExecutor& executor,
                             StepOptions options, const ArenaLayout& layout, const RowEdit& edit) {
  typename O::Settings;
  optimizer.prepare(layout, state);
  { optimizer.step(arena, rates, state, executor, options) } -> std::same_as<OptimizerReport>;
  optimizer.edit_rows(edit, layout, layout, state);
};

}  // namespace compmark
