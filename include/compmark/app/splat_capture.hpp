// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A splat file as a capture of itself: cameras round it (scene/capture_around.hpp), its own renders as the photographs,
// its places as the points to begin with. So a model of another program is marked, compared and trained after without
// one photograph, by the same functions that take a capture.
//   const Result<Dataset> dataset = open_splat_capture("scene.ply", {}, threads);
#pragma once

#include <cstddef>
#include <filesystem>

#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/scene/dataset.hpp"

namespace compmark {

/// Pixels on a side of the pictures of a splat file, before DatasetSettings::downscale.
inline constexpr int splat_picture_size = 800;
/// Cameras round a splat file; every DatasetSettings::test_every-th is a test view.
inline constexpr std::size_t splat_views = 128;

/// The pictures are rendered when they are asked for, over black and in 8 bits, by `executor`, which outlives the
/// dataset. Places keep the coordinates of the file. Error: one of AnyModel::open, or another background. Cost: reads
/// the file; memory: its model.
[[nodiscard]] Result<Dataset> open_splat_capture(const std::filesystem::path& file, const DatasetSettings& settings,
                                                 ThreadExecutor& executor);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/splat_capture.hpp"
#endif
