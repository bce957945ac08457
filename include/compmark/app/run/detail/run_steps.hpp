// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The steps of a run that are the same for every recipe, compiled once: its beginning, its end, what it tells.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "compmark/app/run/detail/finish_run.hpp"
#include "compmark/app/run/detail/finished_run.hpp"
#include "compmark/app/run/detail/run_data.hpp"
#include "compmark/app/run/detail/run_loop_observer.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/splat/training/training_memory.hpp"

namespace compmark::detail {

/// What a run of any recipe has when its iterations begin.
struct RunInputs {
  const RunPlan* plan;
  RunData* data;
  const RunMark* mark;                       ///< null without a message
  std::optional<CodecModel>* unmarked_file;  ///< what a file of the model says that a mark is hidden in
  MemoryBudget memory;
  MemoryShape memory_shape;
};

/// The outcome of a run that is finished, with these options, if it is one.
[[nodiscard]] inline Result<std::optional<RunOutcome>> finished_outcome(const RunPlan& plan, const RunData& data) {
  const Result<bool> finished = is_finished(plan, data);
  if (!finished) return finished.error();
  if (!*finished) return std::optional<RunOutcome>();
  plan.observer->on_note("the run in " + plan.out.string() + " is finished, with these options: nothing is left to do");
  std::optional<RunOutcome> outcome(std::in_place);
  outcome->was_finished = true;
  outcome->model = data.model;
  Result<RunResults> results = read_results(plan.out / "results.json");
  if (!results) return results.error();
  outcome->results = std::move(*results);
  return outcome;
}

inline void warn_of_far_points(const RunPlan& plan, std::size_t far, std::size_t all) {
  if (far == 0) return;
  plan.observer->on_warning(std::to_string(far) + " of " + std::to_string(all) +
                            " points are outliers, far from the others, and are left out");
}

/// What a run that is taken up had told when it was stopped.
struct EarlierPart {
  double seconds = 0;
  std::vector<double> figures;  ///< TrainObserver::figures
};

/// Tells that the iterations begin and returns what will observe them.
[[nodiscard]] inline Result<TrainObserver> begin_iterations(const RunInputs& inputs, std::int64_t iteration,
                                                            const std::optional<EarlierPart>& earlier) {
  const RunPlan& plan = *inputs.plan;
  RunObserver& told = *plan.observer;
  const RunData& data = *inputs.data;
  const RunBeginning beginning{plan.out, iteration, data.settings.iterations, earlier.has_value()};
  if (Result<Done> begun = told.on_begin(beginning); !begun) return begun.error();
  for (const std::string& note : plan.notes) told.on_note(note);
  TrainObserver observer;
  observer.told = &told;
  observer.begin = told.seconds();
  observer.info = &data.info;
  observer.growth = [&told, shape = inputs.memory_shape, budget = inputs.memory](std::size_t anchors,
                                                                                 std::size_t grown) mutable {
    budget.bytes = told.free_memory_bytes();
    return check_growth_memory(shape, anchors, grown, budget);
  };
  observer.checkpoint_every = plan.checkpoint_every;
  observer.checkpoint = data.checkpoint;
  if (earlier) observer.take_up(earlier->seconds, earlier->figures);
  observer.patience = std::max<std::int64_t>(100, 2 * static_cast<std::int64_t>(data.train.size()));
  return observer;
}

/// Whether they came to their end; the figures of the training, if so.
[[nodiscard]] inline Result<RunEnd> end_iterations(const RunPlan& plan, const TrainObserver& observer,
                                                   const Result<Done>& done, bool finished, std::int64_t iteration) {
  plan.observer->on_iterations_end();
  if (!done) return done.error();
  if (observer.failure) return *observer.failure;
  if (!finished || observer.stopped) {  // in the last iteration too: a checkpoint is there either way
    return Error{ErrorKind::cancelled,
                 plan.out.string(),
                 {},
                 "interrupted after iteration " + std::to_string(iteration),
                 "continue with --resume"};
  }
  RunEnd end;
  end.train_seconds = observer.seconds();
  end.distortion_step = observer.distortion_step;
  end.peak_memory_mb = observer.peak_memory_mb();
  return end;
}

}  // namespace compmark::detail
