// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Compresses a model that was not trained for a codec. The codec's part is fitted to the model: how finely each anchor
// is rounded, which offsets can be masked, and how probable each number is. The loss of the photographs measures the
// error of rounding.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "compmark/app/compiled.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/app/run/run_settings.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"

namespace compmark {

struct FitCodecSettings : RunSettings {
  std::filesystem::path model;  ///< model.safetensors of a training without a codec
  std::string codec = "hac";    ///< context_gs, or hac_plus, which is fitted as hac
  double rate_lambda = 0.001;   ///< loss of one bit more a scalar
  std::int64_t iterations = 3000;
  bool touch_up = false;  ///< attributes and networks train on at small rates; else they keep their bits
  MarkSettings
      mark;  ///< key, decoder and counterpart of a model that is marked: what is left of its message is measured
};

/// Writes model.cmk, model.safetensors, results.json and checkpoints into `out`. A mark of the model is rounded too;
/// one that is hidden in the fitted model instead (embed_message) is trained under the rounding of its file.
[[nodiscard]] Result<RunOutcome> fit_codec(const FitCodecSettings& settings, ThreadExecutor& executor,
                                           RunObserver& observer);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/fit_codec.hpp"
#endif
