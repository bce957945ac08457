// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// The data of a run: the photographs, opened and checked, and the description of the run in its files.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "compmark/app/capture.hpp"
#include "compmark/app/dataset_views.hpp"
#include "compmark/app/run/detail/in_file.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/app/run/detail/told.hpp"
#include "compmark/app/run/mark_record.hpp"
#include "compmark/app/run/run_folder.hpp"
#include "compmark/app/run/run_observer.hpp"
#include "compmark/core/buffer.hpp"
#include "compmark/scene/check_weights.hpp"
#include "compmark/scene/extent.hpp"
#include "compmark/scene/far_field.hpp"
#include "compmark/scene/image_store.hpp"
#include "compmark/scene/open.hpp"
#include "compmark/splat/training/checkpoint.hpp"
#include "compmark/splat/training/coarse_to_fine.hpp"
#include "compmark/splat/training/model_info.hpp"
#include "compmark/splat/training/settings.hpp"
#include "compmark/splat/training/training_memory.hpp"

namespace compmark::detail {

/// Parts of the data that a recipe needs.
struct RunNeeds {
  bool ball = false;   ///< the ball of the cameras, beyond which cells grow
  bool alpha = false;  ///< the images' fourth channel
};

/// The finished model that a run starts from.
struct SourceModel {
  const ModelInfo* info = nullptr;  ///< null: a run from the data alone
  std::size_t train_views = 0;
  bool splats = false;  ///< of another program, which says nothing of its photographs: any capture of it will do
};

/// An opened dataset and the run's description of it.
struct RunData {
  Dataset dataset;
  DatasetSettings data_settings;
  std::unique_ptr<ImageStore> store;  ///< of `dataset`
  DatasetViews train, test;
  ModelInfo info;
  SceneExtent extent;
  TrainSettings settings;
  std::filesystem::path model, checkpoint;  ///< files of the run
  std::shared_ptr<const void> folder;       ///< as RunPlan::folder, where nobody held it before
};

/// Opens the data and makes the folder of the run; `settings` become those of these data.
[[nodiscard]] inline Result<std::unique_ptr<RunData>> open_run(const RunPlan& plan, TrainSettings settings,
                                                               const RunNeeds& needs, const SourceModel& source) {
  if (plan.checkpoint_every < 1) {
    return Error{ErrorKind::invalid,
                 {},
                 "--checkpoint-every",
                 "is " + std::to_string(plan.checkpoint_every) + ", and is a number of iterations from 1",
                 "leave it out for the default"};
  }
  auto run = std::make_unique<RunData>();
  run->model = plan.out / "model.safetensors";
  run->checkpoint = plan.out / "checkpoint.safetensors";
  DatasetSettings& data_settings = run->data_settings;
  data_settings.downscale = plan.downscale;
  data_settings.splat_up = plan.splat_up;
  data_settings.background = settings.background;
  data_settings.seed = settings.seed;
  data_settings.lens = source.info != nullptr ? settings_of(*source.info).lens : plan.lens;
  Result<Dataset> opened = source.info != nullptr ? open_for(*source.info, plan.data, data_settings, *plan.executor)
                                                  : open_capture(plan.data, data_settings, *plan.executor);
  if (!opened) return opened.error();
  run->dataset = std::move(*opened);
  const Dataset& dataset = run->dataset;
  if (plan.voxel_size && settings.voxel_size > 0) settings.voxel_size /= dataset.unit;
  // Splat files have any unit of length, and the default is that of a scene of a known size.
  if (dataset.kind == "splats" && !plan.voxel_size) settings.voxel_size = 0;
  if (needs.ball) {
    const CameraBall ball = camera_ball(dataset);
    settings.effects.space_origin = ball.origin;
    settings.effects.space_radius = ball.radius;
  }
  for (const std::string& warning : dataset.warnings) plan.observer->on_warning(warning);
  if (dataset.kind == "blender")
    settings.init_factor = 4;  // as all published scripts do for these scenes (docs/spec/method.md, 3.5)
  run->folder = plan.folder;
  if (!run->folder) {
    Result<std::shared_ptr<const void>> held = hold_folder(plan.out);
    if (!held) return held.error();
    run->folder = std::move(*held);
  }
  if (Result<Done> free = check_unfinished(plan.out, plan.resume || plan.force); !free) return free.error();

  ImageStoreSettings store_settings;
  store_settings.keep_alpha = needs.alpha;
  if (plan.memory_budget_mb != 0) store_settings.memory_budget_bytes = plan.memory_budget_mb << 20;
  run->store = std::make_unique<ImageStore>(dataset, data_settings, store_settings);
  run->train = {&dataset, run->store.get(), dataset.indices(Split::train)};
  run->test = {&dataset, run->store.get(), dataset.indices(Split::test)};
  run->extent = scene_extent(dataset);

  ModelInfo& info = run->info;
  info.recipe = plan.recipe;
  info.effects = source.info != nullptr ? source.info->effects : plan.simulated;
  info.profile = settings.profile;
  info.iterations = settings.iterations;
  info.seed = settings.seed;
  info.origin = dataset.origin;
  info.unit = dataset.unit;
  info.base_step = {settings.rate.feature_step, settings.rate.scaling_step, settings.rate.offset_step};
  info.around_splats = dataset.kind == "splats";
  if (info.around_splats) info.up = dataset.splat_up;
  for (const View& view : dataset.views) info.views.push_back(stored_view(view));
  run->settings = std::move(settings);
  return run;
}

/// The views that are trained on, then those that are measured.
[[nodiscard]] inline std::vector<std::pair<DatasetViews*, std::size_t>> all_views(RunData& run) {
  std::vector<std::pair<DatasetViews*, std::size_t>> result;
  for (DatasetViews* views : {&run.train, &run.test}) {
    for (std::size_t i = 0; i < views->size(); ++i) result.emplace_back(views, i);
  }
  return result;
}

/// Decodes every image once, those that are measured in the end too, so that a bad one is named before hours of work,
/// and compares the data with the source model's. A side below `smallest_side` pixels, which the decoder does not
/// read, is an error.
[[nodiscard]] inline Result<Done> check_run(const RunPlan& plan, RunData& run, const SourceModel& source,
                                            const RunMark* mark, int smallest_side) {
  if (mark != nullptr && !mark->read_only) warn_of_record(mark->key_file, plan.out, warnings_of(*plan.observer));
  if (run.train.size() == 0) {
    return Error{ErrorKind::invalid, plan.data.string(), "train split", "holds no view",
                 "give at least one training image"};
  }
  for (const auto& [views, i] : all_views(run)) {
    const Camera<double> camera = views->camera(i);
    const std::string& name = run.dataset.views[views->index[i]].name;
    if (std::min(camera.width, camera.height) < smallest_side) {
      return Error{ErrorKind::invalid, plan.data.string(), "image size",
                   "of view " + name + " is " + std::to_string(camera.width) + " x " + std::to_string(camera.height),
                   "the decoder reads images of at least " + std::to_string(smallest_side) + " pixels a side"};
    }
    const int factor = views == &run.train ? run.settings.coarse_to_fine.largest() : 1;  // what is measured is whole
    if (Result<Done> fits = check_coarse_size(factor, camera, name); !fits)
      return in_option(fits.error(), "--coarse-to-fine");
    Buffer<float> scratch(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    if (Result<Done> loaded = views->load(i, {scratch.data(), 3, camera.height, camera.width}); !loaded)
      return loaded.error();
  }
  if (Result<Done> counted = check_weights(run.dataset, *run.store); !counted) return counted.error();
  if (mark != nullptr && !mark->unmarked.empty() &&
      (mark->unmarked_unit != run.dataset.unit || mark->unmarked_origin != run.dataset.origin)) {
    return Error{ErrorKind::invalid, mark->unmarked.string(), "--unmarked",
                 "has another unit of length or another origin than these data have in this version",
                 "train the unmarked counterpart again"};
  }
  if (source.info == nullptr || source.splats) return Done{};
  const auto foreign = [&](std::string field, std::string problem) {
    return Error{ErrorKind::invalid, plan.model.string(), std::move(field), std::move(problem),
                 "give the data that it was trained on, with the same --downscale"};
  };
  if (source.info->views.size() != run.info.views.size() || source.train_views != run.train.size()) {
    return foreign("views", "are " + std::to_string(source.info->views.size()) + ", of them " +
                                std::to_string(source.train_views) + " trained with; the data have " +
                                std::to_string(run.info.views.size()) + " and " + std::to_string(run.train.size()));
  }
  if (const std::optional<OtherView> other = other_view(source.info->views, run.info.views))
    return foreign(other->field, "of view " + other->name + " differs in the data");
  if (source.info->origin != run.dataset.origin) return foreign("origin", "of the scene differs in the data");
  if (source.info->unit != run.dataset.unit) return foreign("unit", "of the scene differs in the data");
  return Done{};
}

/// The memory that a training of these views may take beside the decoded images.
[[nodiscard]] inline MemoryBudget memory_budget(const RunData& run, const RunObserver& observer) {
  MemoryBudget budget;
  budget.bytes = observer.free_memory_bytes();
  budget.views = run.train.size();
  for (std::size_t i = 0; i < run.train.size(); ++i) {
    const Camera<double> camera = run.train.camera(i);
    budget.pixels =
        std::max(budget.pixels, static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  }
  return budget;
}

}  // namespace compmark::detail
