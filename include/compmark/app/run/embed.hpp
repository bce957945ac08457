// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Hides a message in a finished model. A residual of the features trains alone, and the source model is not changed.
// Without a decoder one is fitted to the scene first. With a fidelity of 0 the whole model trains on instead, with the
// photographs it was trained on: nothing grows, and the learning rates are small. By the method of a baseline it is
// hidden as others hide theirs, for comparison (docs/baselines.md).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "compmark/app/compiled.hpp"
#include "compmark/app/run/embed_method.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/app/run/run_settings.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"

namespace compmark {

/// How training replaces the quantizer of a codec before it reads the message.
enum class EmbedDistortion {
  round,  ///< as the file does
  noise,  ///< as wide as a step: the distortion layer of the paper
  none
};

struct EmbedSettings : RunSettings {
  /// Unmarked: model.safetensors of a recipe that can carry a message, or a splat file of any program, whose Gaussians
  /// are marked as they are. `data` may be empty for a splat file: cameras round it then (splat_capture.hpp).
  std::filesystem::path model;
  MarkSettings mark;
  std::int64_t iterations = 0;  ///< 0: 2000; for a codec 4000, or 8000 with a decoder that is not fitted to the scene
  EmbedDistortion distortion = EmbedDistortion::round;  ///< of models for a codec; others have `round` alone
  EmbedMethod method = EmbedMethod::compmark;           ///< baselines mark models of the recipe scaffold alone
  std::string codec = "trained";  ///< of the files of a model for a codec: its own, or hac_plus of one for hac
};

/// Writes the marked model.safetensors, results.json, verification.json and mark.json into `out`, a decoder where none
/// was given, model.cmk and unmarked.cmk for a codec, and marked.ply for a splat file; notes beside the key which decoder reads the mark. The model
/// is the same at any number of threads. ErrorKind::cancelled: the observer stopped it, a checkpoint is there.
[[nodiscard]] Result<RunOutcome> embed_message(const EmbedSettings& settings, ThreadExecutor& executor,
                                               RunObserver& observer);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/embed.hpp"
#endif
