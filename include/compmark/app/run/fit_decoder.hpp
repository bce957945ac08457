// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Fits a message decoder to one scene, from its unmarked model and its cameras, and writes it with figures of the fit
// (watermark/fit/decoder_fit.hpp is the fit itself). No message is hidden yet: embed_message does that.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "compmark/app/compiled.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/watermark/fit/decoder_fit_settings.hpp"

namespace compmark {

/// Errors name these fields as the tool's options do ("--features").
struct DecoderFileSettings {
  std::filesystem::path model;  ///< unmarked, of a recipe that can carry a message (is_markable_recipe)
  std::filesystem::path data;   ///< the dataset it was trained on; only its cameras are used
  std::filesystem::path out;    ///< decoder to write
  std::filesystem::path json;   ///< figures of the fit; empty: as `out`, with the ending .json
  /// Numbers of 0 are chosen from the bits and the size of the images; coordinates below 0 from the number of features.
  DecoderFitSettings fit{.features = 0, .stride = 0, .statistics_views = 0, .coordinates = -1};
  bool force = false;                             ///< move a decoder that is there aside
  double downscale = 1;                           ///< that of the training
  std::optional<std::array<double, 3>> splat_up;  ///< of splats that are the data (DatasetSettings::splat_up)
};

struct FittedDecoder {
  std::string sha256;                                            ///< of the file
  double feature_agreement = 0, agreement = 0, noise_ratio = 0;  ///< as DecoderFit has them
  double seconds = 0;                                            ///< by the observer's clock
};

/// Tells the observer warnings, notes and RunObserver::on_fit. Nothing is written before the fit is done, and the same
/// decoder comes out at any number of threads. Error: the model cannot carry a message, or the data are not its own.
/// Cost: a render of each of about eight views for each feature; minutes at 800 x 800.
[[nodiscard]] Result<FittedDecoder> fit_decoder_file(DecoderFileSettings settings, ThreadExecutor& executor,
                                                     RunObserver& observer);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/run/detail/fit_decoder.hpp"
#endif
