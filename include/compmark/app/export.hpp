// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// Export of a model of any recipe: the anchors as the Scaffold family has them, in a PLY, or explicit Gaussians in a
// format that viewers open (io/splat/write_splat.hpp) - baked for one camera (exact from there) or fitted with spherical
// harmonics over the training cameras - with what the bake and the format lose, in dB.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "compmark/app/any_model.hpp"
#include "compmark/app/compiled.hpp"
#include "compmark/core/result.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/splat/splat_rounding.hpp"
#include "compmark/splat/export/bake.hpp"
#include "compmark/splat/export/sh_fit.hpp"
#include "compmark/splat/export/splat_refine.hpp"

namespace compmark {

enum class ExportKind {
  splats,   ///< Gaussians, in the format that ExportSettings::file or the ending of the name says
  anchors,  ///< the Scaffold family's; the networks stay in the model
  page,     ///< Gaussians in a page that shows them (io/splat/viewer_page.hpp), from the model's cameras
};

/// Errors name these fields as the tool's options do ("--view").
struct ExportSettings {
  ExportKind kind = ExportKind::splats;
  SplatWriteSettings file;     ///< of splats; that a model was trained with the mip filter is added
  std::string view;            ///< bake for this stored view; empty: fit over all cameras of the training
  int degree = 3;              ///< of the fitted colour, 0 to 3
  std::int64_t refine = 500;   ///< iterations that move the fitted splats towards the model's own renders
  std::filesystem::path data;  ///< dataset, to measure against photographs too; may be empty
  double downscale = 1;        ///< of the training: the size of the photographs is divided by this
  std::size_t compare = 10;    ///< views to measure on, evenly spaced, at most; 0: none
};

struct ExportReport {
  std::vector<std::string>
      warnings;  ///< what the file cannot say, a sentence each: viewers show something else than the model
  std::size_t anchors = 0;
  std::size_t gaussians = 0;  ///< of the file; 0 for anchors
  int degree = 0;             ///< of the file's colours
  std::size_t cameras = 0;    ///< that were fitted over
  std::optional<ShFitReport> fit;
  std::optional<SplatRefineReport> refined;
  std::optional<BakeReport> compared;       ///< against the model's own renders and, with data, the photographs
  std::vector<std::string> compared_views;  ///< names of compared->views
  bool held_out = false;                    ///< nothing was fitted over those views
  std::optional<SplatWritten> written;  ///< of splats, but for a page: format, bytes and what the format could not hold
  std::optional<BakeReport> from_file;  ///< the file, read back, against the model's own renders of the same views;
                                        ///< none of a plain PLY, which rounds nothing, and of a pipe
};

/// Told what is done as soon as it is: fits take minutes. What is not overridden is not told.
struct ExportObserver {
  virtual ~ExportObserver() = default;
  virtual void on_begin(const ExportReport& /*report*/) {}    ///< warnings and anchors are known
  virtual void on_fitted(const ExportReport& /*report*/) {}   ///< fit and cameras
  virtual void on_refined(const ExportReport& /*report*/) {}  ///< refined
  virtual void on_written(const ExportReport& /*report*/) {}  ///< the file is there
};

/// Writes `out`. Nothing is written where an Error is found: no camera or not this view, an output that cannot be, a
/// degree beyond 3, a fisheye with data, data that lack a view. Photographs are read last: one that cannot be decoded is
/// an Error after the file was written. Lengths are in the dataset's unit (ModelInfo::unit). Cost: of a fit, a render and its backward
/// pass a camera and iteration.
[[nodiscard]] Result<ExportReport> export_model(AnyModel& model, const std::filesystem::path& out,
                                                const ExportSettings& settings, ThreadExecutor& executor,
                                                ExportObserver& observer);
[[nodiscard]] Result<ExportReport> export_model(AnyModel& model, const std::filesystem::path& out,
                                                const ExportSettings& settings, ThreadExecutor& executor);

}  // namespace compmark

#if !defined(COMPMARK_APP_COMPILED)
#include "compmark/app/detail/export.hpp"
#endif
