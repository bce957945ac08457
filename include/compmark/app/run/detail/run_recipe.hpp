// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A run of one recipe: the part of a run that is compiled for each, about ten seconds of a compiler each.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "compmark/app/compress.hpp"
#include "compmark/app/run/detail/finish_run.hpp"
#include "compmark/app/run/detail/finished_run.hpp"
#include "compmark/app/run/detail/in_file.hpp"
#include "compmark/app/run/detail/read_source.hpp"
#include "compmark/app/run/detail/run_data.hpp"
#include "compmark/app/run/detail/run_loop_observer.hpp"
#include "compmark/app/run/detail/run_plan.hpp"
#include "compmark/codec/model/adopt_networks.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/splat_ply.hpp"
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/splat/export/explicit_splats.hpp"
#include "compmark/splat/training/checkpoint.hpp"
#include "compmark/splat/training/model_file.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "compmark/watermark/embed/base_model.hpp"
#include "compmark/watermark/embed/posthoc_embedding.hpp"

namespace compmark::detail {

/// The views of a dataset with cameras that project through lens L.
template <class L>
struct LensViews : DatasetViews {
  std::vector<CameraOf<L>> cameras;
  [[nodiscard]] CameraOf<L> camera(std::size_t i) const { return cameras[i]; }
};
template <class L>
Result<LensViews<L>> lens_views(DatasetViews views) {
  LensViews<L> result{std::move(views), {}};
  Lens last;
  std::optional<L> policy = lens_policy<L>(last);
  for (std::size_t i = 0; i < result.size(); ++i) {
    const Lens lens = result.lens(i);
    if (!(lens == last)) {  // finding where a lens ends takes half a millisecond
      last = lens;
      policy = lens_policy<L>(lens);
    }
    if (!is_pinhole(lens) && !policy) {
      return Error{ErrorKind::unsupported, result.dataset->root.string(), "lens",
                   "of view \"" + result.dataset->views[result.index[i]].name + "\" is not of the " + lens_family<L> +
                       " family that this recipe projects through",
                   "remove the distortion with --lens undistort"};
    }
    CameraOf<L> camera(result.dataset->views[result.index[i]].camera);
    if constexpr (!std::is_same_v<L, PinholeLens>) {
      if (!is_pinhole(lens)) camera.lens = *policy;
    }
    result.cameras.push_back(camera);
  }
  return result;
}

/// The recipe of the finished source model of a run (RunPlan::model), when a mark is hidden in it or a codec is
/// fitted to it.
template <class R>
struct SourceRecipe {
  using Type = R;
};
template <class R>
  requires(present<typename R::MessageDecoder> || requires { R::is_fitted; })
struct SourceRecipe<R> {
  using Type = typename R::Base;
};

/// Inputs of a run of recipe R when its iterations begin.
template <class R>
struct RunParts {
  const RunPlan* plan;
  RunData* data;
  LensViews<RecipeLens<R>>* train;
  const RunMark* mark;                       ///< null without a message
  std::optional<CodecModel>* unmarked_file;  ///< what a file of the model says that a mark is hidden in
  MemoryBudget memory;
};

/// Loads the checkpoint of a resumed run and returns its seconds so far; nothing if the run begins.
template <class Loop>
Result<std::optional<double>> take_up(const RunPlan& plan, const RunData& data, Loop& loop) {
  if (!std::filesystem::exists(data.checkpoint)) return std::optional<double>();
  if (!plan.resume) return unfinished_run(data.checkpoint);
  Result<Checkpoint<Loop>> restored = read_checkpoint<Loop>(data.checkpoint, data.settings, data.info);
  if (!restored) return restored.error();
  loop.restore(std::move(restored->state));
  return std::optional(restored->seconds);
}

/// The iterations of a run that was begun or taken up after `seconds_before`, its files and its figures.
template <class Loop, class R>
Result<RunOutcome> run_iterations(Loop& loop, const RunParts<R>& parts, const std::optional<double>& seconds_before) {
  constexpr bool is_marked = present<typename R::MessageDecoder>;
  const RunPlan& plan = *parts.plan;
  RunObserver& told = *plan.observer;
  RunData& data = *parts.data;
  const RunBeginning beginning{plan.out, loop.state().iteration, data.settings.iterations, seconds_before.has_value()};
  if (Result<Done> begun = told.on_begin(beginning); !begun) return begun.error();
  for (const std::string& note : plan.notes) told.on_note(note);
  TrainObserver observer;
  observer.told = &told;
  observer.begin = told.seconds();
  observer.info = &data.info;
  observer.growth = [&told, budget = parts.memory](std::size_t anchors, std::size_t grown) mutable {
    budget.bytes = told.free_memory_bytes();
    return check_growth_memory<R>(anchors, grown, budget);
  };
  observer.checkpoint_every = plan.checkpoint_every;
  observer.checkpoint = data.checkpoint;
  observer.seconds_before = seconds_before.value_or(0);
  observer.patience = std::max<std::int64_t>(100, 2 * static_cast<std::int64_t>(parts.train->size()));
  const Result<Done> done = loop.run(*parts.train, observer);
  told.on_iterations_end();
  if (!done) return done.error();
  if (observer.failure) return *observer.failure;
  if (!loop.finished() || observer.stopped) {  // in the last iteration too: a checkpoint is there either way
    return Error{ErrorKind::cancelled,
                 plan.out.string(),
                 {},
                 "interrupted after iteration " + std::to_string(loop.state().iteration),
                 "continue with --resume"};
  }
  RunEnd end;
  end.train_seconds = observer.seconds();
  end.peak_memory_mb = told.peak_memory_mb();
  end.anchors = loop.model().anchor_count();
  end.voxel_size = loop.model().voxel_size;
  if constexpr (requires { loop.context(); } && has_stage<typename Loop::Stages, DistortionStage>) {
    end.distortion_step =
        loop.pipeline().template stage<DistortionStage>().step_summary(loop.context().template of<DistortionStage>());
  }
  if constexpr (requires { loop.state().revival; })
    end.revivals = static_cast<std::uint64_t>(loop.state().revival.revivals);
  const auto keep = [&](const auto& model) -> Result<Done> {
    if (Result<Done> written = write_model(data.model, model, data.info); !written) return written;
    if constexpr (ExplicitModelRecipe<typename SourceRecipe<R>::Type>) {  // as it came: for every viewer
      std::vector<std::string> comments;
      if (data.dataset.splat_up) comments.push_back(splat_up_comment(*data.dataset.splat_up));
      if (Result<Done> written = write_splat_ply(plan.out / splat_file_name, explicit_splats(model), comments);
          !written)
        return written;
    }
    if constexpr (present<typename R::EntropyModel>) {
      Result<CodecModel> coded = coded_model(model, data.info);
      if (!coded) return coded.error();
      // The steps of the training, not those that would suit the marked symbols a little better.
      if (*parts.unmarked_file) keep_context(**parts.unmarked_file, *coded);
      end.coded = std::move(*coded);
    }
    return Done{};
  };
  const Result<Done> kept = [&] {
    if constexpr (is_marked) return keep(baked_model(loop.model()));
    if constexpr (!is_marked) return keep(loop.model());
  }();
  if (!kept) return kept.error();
  return finish_run(plan, data, end, parts.mark);
}

/// Trains and measures. `mark` is for recipes with a message decoder; for the others null, or that of a model which
/// holds one already.
template <class R>
Result<RunOutcome> run_recipe(const RunPlan& plan, const TrainSettings& settings, const RunMark* mark = nullptr) {
  using Source = typename SourceRecipe<R>::Type;
  constexpr bool is_marked = present<typename R::MessageDecoder>;
  constexpr bool is_fitted = requires { R::is_fitted; };
  ThreadExecutor& executor = *plan.executor;

  TrainSettings wanted = settings;
  std::optional<LoadedModel<Source>> loaded;  // of embed and fit-codec
  SourceModel source;
  if (!plan.model.empty()) {
    Result<LoadedModel<Source>> read = read_source<Source>(plan.model, executor);
    if (!read) return read.error();
    loaded = std::move(*read);
    source = {&loaded->info, loaded->model.train_views, ExplicitModelRecipe<Source>};
    for (std::size_t c = 0; c < 3; ++c) wanted.background[c] = static_cast<float>(loaded->model.render.background[c]);
    if constexpr (is_marked && present<typename R::EntropyModel>) {
      const std::array<double, 3>& step = loaded->info.base_step;
      wanted.rate.feature_step = step[0];
      wanted.rate.scaling_step = step[1];
      wanted.rate.offset_step = step[2];
    }
  }
  constexpr RunNeeds needs{present<typename R::Space>,
                           present<typename R::Background> || present<typename R::AlphaLoss>};
  Result<std::unique_ptr<RunData>> opened = open_run(plan, std::move(wanted), needs, source);
  if (!opened) return opened.error();
  RunData& data = **opened;
  Result<LensViews<RecipeLens<R>>> with_cameras = lens_views<RecipeLens<R>>(data.train);
  if (!with_cameras) return with_cameras.error();
  LensViews<RecipeLens<R>>& train = *with_cameras;
  if (plan.resume) {
    const Result<bool> finished = is_finished(plan, data);
    if (!finished) return finished.error();
    if (*finished) {
      plan.observer->on_note("the run in " + plan.out.string() +
                             " is finished, with these options: nothing is left to do");
      RunOutcome outcome;
      outcome.was_finished = true;
      outcome.model = data.model;
      Result<RunResults> results = read_results(plan.out / "results.json");
      if (!results) return results.error();
      outcome.results = std::move(*results);
      return outcome;
    }
  }
  if (Result<Done> usable = check_run(plan, data, source, mark); !usable) return usable.error();
  std::optional<CodecModel> unmarked_file;  // what a file of the model says that a mark is hidden in
  if constexpr (is_marked && present<typename R::EntropyModel>) {
    if (loaded) {
      const Result<CodecModel> coded = coded_model(loaded->model, loaded->info);
      if (!coded) return in_file(coded.error(), plan.model);
      Result<CodecEncoded> file = encode_model(*coded, executor);
      if (!file) return in_file(file.error(), plan.model);
      unmarked_file = std::move(file->model);
      if (data.settings.mark.posthoc.calibrate_steps_every > 0) leave_room_for_steps(*unmarked_file);
    }
  }

  if constexpr (is_fitted) {  // said now, and not when the file is written
    if (loaded) {
      if (const auto voxels = anchor_voxels(loaded->model); !voxels) return in_file(voxels.error(), plan.model);
    }
  }

  const MemoryBudget memory = memory_budget(data, *plan.observer);
  const RunParts<R> parts{&plan, &data, &train, mark, &unmarked_file, memory};
  // The finished source model, prepared for this run.
  const auto begin_from = [&](auto& loop) -> Result<Done> {
    if (Result<Done> room = check_training_memory<R>(loaded->model.anchor_count(), memory); !room) return room;
    if constexpr (is_marked && present<typename R::EntropyModel>) {  // what is trained is rounded as its file is
      if (Result<Done> adopted = adopt_networks(*unmarked_file, loaded->model); !adopted) return adopted;
    }
    if constexpr (is_marked || is_fitted) loop.start_from(with_room_for_stages<R>(loaded->model, data.settings.seed));
    return Done{};
  };
  if constexpr (is_marked) {
    if (data.settings.mark.posthoc.fidelity > 0) {
      PosthocEmbedding<R, ThreadExecutor> embedding(data.settings, executor);
      set_watermark(embedding, marking_decoder(*mark, data.settings.mark.message), mark->bits);
      const Result<std::optional<double>> before = take_up(plan, data, embedding);
      if (!before) return before.error();
      if (!*before) {
        if (Result<Done> begun = begin_from(embedding); !begun) return begun.error();
      }
      return run_iterations(embedding, parts, *before);
    }
  }
  if constexpr (ExplicitModelRecipe<Source>) {  // has no photographs of its training to train on with
    return no_message_in(plan.recipe);
  } else {
    Trainer<R, ThreadExecutor> trainer(data.settings, train.size(), data.extent.radius, executor);
    if constexpr (is_marked) set_watermark(trainer, marking_decoder(*mark, data.settings.mark.message), mark->bits);
    const Result<std::optional<double>> before = take_up(plan, data, trainer);
    if (!before) return before.error();
    if (!*before && loaded) {
      if constexpr (is_marked || is_fitted) {
        if (Result<Done> begun = begin_from(trainer); !begun) return begun.error();
      }
    } else if (!*before) {
      if (Result<Done> ready = trainer.initialise(data.dataset.points.position, memory); !ready) return ready.error();
      if (trainer.far_points() != 0) {
        plan.observer->on_warning(std::to_string(trainer.far_points()) + " of " +
                                  std::to_string(data.dataset.points.size()) +
                                  " points are outliers, far from the others, and are left out");
      }
    }
    return run_iterations(trainer, parts, *before);
  }
}

}  // namespace compmark::detail
