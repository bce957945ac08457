// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The capture of a model: its photographs opened as they were for the training, so that cameras and colours mean the
// same. A splat file is a capture of itself (splat_capture.hpp).
#pragma once

#include <filesystem>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/scene/dataset.hpp"
#include "compmark/splat/training/model_info.hpp"
#include "compmark/splat/training/view_row.hpp"

namespace compmark {

/// Name of the effect list of a model that was trained as if its lens were a pinhole.
inline constexpr const char* lens_ignored = "lens_ignored";

/// How the dataset of a model is opened: its lens as in training.
[[nodiscard]] DatasetSettings settings_of(const ModelInfo& info);
/// Opens a dataset, or a splat file as one; `executor` renders its pictures and outlives it.
[[nodiscard]] Result<Dataset> open_capture(const std::filesystem::path& data, const DatasetSettings& settings,
                                           ThreadExecutor& executor);
/// The same in the unit of the model and moved to where it lies (ModelInfo::origin).
[[nodiscard]] Result<Dataset> open_for(const ModelInfo& info, const std::filesystem::path& data,
                                       const DatasetSettings& settings, ThreadExecutor& executor);
/// A view of a dataset as a model stores it.
[[nodiscard]] StoredView stored_view(const View& view);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/capture.hpp"
#endif
