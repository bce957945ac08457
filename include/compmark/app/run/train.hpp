// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Trains a scene: a dataset becomes a model with its measurements. With a codec its compressed file is written too;
// with a key a message is hidden in it, while it trains or afterwards.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "compmark/app/compiled.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/app/run/run_settings.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/scene/dataset.hpp"

namespace compmark {

/// Errors name these fields as the tool's options do ("--recipe").
struct TrainSceneSettings : RunSettings {
  std::string recipe;                ///< a name of with_recipe or of a codec's recipe; empty: chosen from the data
  std::string profile = "scaffold";  ///< hyper-parameters (profile_settings); with a codec "hac" takes its place
  std::string codec = "none";        ///< of the file: none, hac, context_gs, or hac_plus, which trains for hac
  bool for_fit_codec = false;        ///< without effects that fit_codec does not support
  double rate_lambda = 0.001;        ///< with a codec: loss of one bit more a scalar
  std::int64_t iterations = 30000;
  std::string coarse_to_fine;   ///< levels at which coarse photographs train first (coarse_to_fine_of); empty: none
  std::size_t max_anchors = 0;  ///< 0: no limit
  std::optional<double> voxel_size;  ///< in units of the dataset; 0 or less: measured; not set: the profile's
  std::optional<std::array<float, 3>> background;  ///< behind transparent photographs; not set: black, or as measured
  std::string effects = "auto";                    ///< scene effects to model: auto, none, or names with commas
  LensTreatment lens = LensTreatment::undistort;
  MarkSettings mark;                 ///< with a key: what is hidden
  std::int64_t mark_iterations = 0;  ///< of a mark that is hidden afterwards; 0: as EmbedSettings::iterations
};

/// Whether these settings train an unmarked model first, in the folder out/unmarked, and then hide the message in it.
[[nodiscard]] bool marks_afterwards(const TrainSceneSettings& settings);

/// Writes model.safetensors, results.json and checkpoints into `out`; verification.json and mark.json with a message, a
/// decoder where none was given, and model.cmk for a codec. The model is the same at any number of threads, and in a
/// run that was stopped and resumed. Errors come before the first iteration where that is possible;
/// ErrorKind::cancelled: the observer stopped it, a checkpoint is there. Cost: docs/accuracy_vs_time.md.
[[nodiscard]] Result<RunOutcome> train_scene(const TrainSceneSettings& settings, ThreadExecutor& executor,
                                             RunObserver& observer);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/train.hpp"
#endif
