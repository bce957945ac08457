// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One training run of the tool, from options to files: the part that does not depend on the recipe's type and is
// compiled once. The rest is in train_recipe.hpp.
#pragma once

#include <compmark/app/dataset_views.hpp>
#include <compmark/app/lpips_nets.hpp>
#include <compmark/codec/container/codec_model.hpp>
#include <compmark/core/result.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/scene/dataset.hpp>
#include <compmark/scene/extent.hpp>
#include <compmark/scene/image_store.hpp>
#include <compmark/splat/training/model_info.hpp>
#include <compmark/splat/training/settings.hpp>
#include <compmark/splat/training/training_memory.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common.hpp"
#include "evaluation.hpp"
#include "mark_input.hpp"
#include "options.hpp"
#include "progress.hpp"

namespace tool {

struct TrainOptions {
  std::filesystem::path data;
  std::filesystem::path out;
  std::string recipe;
  std::string profile = "scaffold";
  std::string preset;  ///< of presets.hpp, or none
  std::int64_t iterations = 30000;
  double downscale = 1;
  std::optional<std::uint64_t> seed;
  std::size_t threads = 0;
  std::size_t max_anchors = 0;
  std::size_t memory_budget_mb = 0;
  std::int64_t checkpoint_every = 1000;
  double voxel_size = 0;
  bool voxel_size_given = false;
  std::string background;                                  ///< from --background; empty: black, or the measured one
  std::optional<std::array<double, 3>> probed_background;  ///< one colour around opaque photographs, in [0, 1]
  std::string lens = "undistort";
  std::string effects = "auto";
  std::vector<std::string> simulated;  ///< effects of the chosen recipe
  std::vector<std::string> notes;      ///< why it was chosen, to be shown when the run starts
  bool resume = false;
  bool force = false;                  ///< over a finished run
  std::shared_ptr<const void> folder;  ///< holds `out` against other runs (run_folder.hpp)
  std::filesystem::path json_log;
  compmark::LpipsFiles lpips;
  MarkOptions mark;
  std::filesystem::path model;       ///< the finished model that embed marks, or that fit-codec compresses
  std::int64_t mark_iterations = 0;  ///< of a mark that is hidden after the training; 0: what suits the recipe
  std::string codec = "none";        ///< that the model is trained for
  bool for_fit_codec = false;        ///< without effects that fit-codec does not support
  double rate_lambda = 0.001;        ///< loss of one bit more a scalar
};

/// Options of a run that starts from a finished model, for any purpose.
void add_finished_model_options(Options& app, TrainOptions& options);

/// What a run leaves in its folder, whatever it trains, and what of the run of the model that it starts from it looks
/// at.
void add_run_files(FileUse& use, const TrainOptions& options, const std::filesystem::path& out);

/// The error of a run without --resume that would overwrite a checkpoint.
[[nodiscard]] compmark::Error unfinished_run(const std::filesystem::path& checkpoint);

/// The treatment of the lens that --lens names.
compmark::LensTreatment lens_treatment(const TrainOptions& options);

/// Parts of the data that a recipe needs.
struct RunNeeds {
  bool ball = false;   ///< the ball of the cameras, beyond which cells grow
  bool alpha = false;  ///< the images' fourth channel
};

/// The finished model that a run starts from.
struct SourceModel {
  const compmark::ModelInfo* info = nullptr;  ///< null: a run from the data alone
  std::size_t train_views = 0;
};

/// An opened dataset and the run's description of it.
struct RunData {
  compmark::Dataset dataset;
  compmark::DatasetSettings data_settings;
  std::unique_ptr<compmark::ImageStore> store;  ///< of `dataset`
  compmark::DatasetViews train, test;
  compmark::ModelInfo info;
  compmark::SceneExtent extent;
  compmark::TrainSettings settings;
  std::filesystem::path model, checkpoint, json_log;  ///< files of the run
  std::shared_ptr<const void> folder;                 ///< as TrainOptions::folder, where nobody held it before
};

/// Opens the data and makes the run's folder; `settings` become those of these data.
compmark::Result<std::unique_ptr<RunData>> open_run(const TrainOptions& options, compmark::TrainSettings settings,
                                                    const RunNeeds& needs, const SourceModel& source);
/// Decodes every image once, so that a bad one is named before hours of work, and compares the data with the source
/// model's.
compmark::Result<compmark::Done> check_run(const TrainOptions& options, RunData& run, const SourceModel& source,
                                           const MarkInput* mark);

/// The memory that a training of these views may take beside the decoded images.
compmark::MemoryBudget memory_budget(const RunData& run);

/// The result of a training.
struct RunEnd {
  std::size_t anchors = 0;
  double voxel_size = 0;
  double train_seconds = 0;
  double peak_memory_mb = 0;
  std::vector<ProgressLine> curve;            ///< of this run, its sessions before included
  std::optional<compmark::CodecModel> coded;  ///< of a run for compression
};
/// Measures the model that was written, compresses it where `end` says so, reads the mark, writes results and report.
/// Returns the exit code.
int finish_run(const TrainOptions& options, RunData& run, const RunEnd& end, const MarkInput* mark,
               compmark::ThreadExecutor& executor);

}  // namespace tool
