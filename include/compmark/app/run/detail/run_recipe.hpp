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
#include "compmark/app/run/detail/run_steps.hpp"
#include "compmark/codec/model/adopt_networks.hpp"
#include "compmark/codec/model/coded_model.hpp"
#include "compmark/codec/model/grid_anchors.hpp"
#include "compmark/core/config.hpp"
#include "compmark/core/thread_executor.hpp"
#include "compmark/io/file_exists.hpp"
#include "compmark/io/splat_ply.hpp"
#include "compmark/recipes/marked_codecs.hpp"
#include "compmark/splat/export/explicit_splats.hpp"
#include "compmark/splat/training/checkpoint.hpp"
#include "compmark/splat/training/model_file.hpp"
#include "compmark/splat/training/run_policies.hpp"
#include "compmark/splat/training/trainer.hpp"
#include "compmark/watermark/baselines/unmarked_views.hpp"
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
COMPMARK_ONCE Result<LensViews<L>> lens_views(DatasetViews views) {
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

/// Loads the checkpoint of a resumed run and returns what it had told so far; nothing if the run begins.
template <class Loop>
COMPMARK_ONCE Result<std::optional<EarlierPart>> take_up(const RunPlan& plan, const RunData& data, Loop& loop) {
  if (!detail::file_exists(data.checkpoint)) return std::optional<EarlierPart>();
  if (!plan.resume) return unfinished_run(data.checkpoint);
  Result<Checkpoint<Loop>> restored = read_checkpoint<Loop>(data.checkpoint, data.settings, data.info);
  if (!restored) return restored.error();
  loop.restore(std::move(restored->state));
  return std::optional(EarlierPart{restored->seconds, std::move(restored->figures)});
}

/// The files of a finished model, in which the mark, if there is one, is a part of its features. Sets `end.coded` of a
/// recipe that is `coded`.
template <class Source, bool coded, class M>
[[nodiscard]] COMPMARK_ONCE Result<Done> keep_model(const RunInputs& inputs, const M& model, RunEnd& end) {
  const RunPlan& plan = *inputs.plan;
  const RunData& data = *inputs.data;
  if (Result<Done> written = write_model(data.model, model, data.info); !written) return written;
  if constexpr (ExplicitModelRecipe<Source>) {  // as it came: for every viewer
    std::vector<std::string> comments;
    if (data.dataset.splat_up) comments.push_back(splat_up_comment(*data.dataset.splat_up));
    SplatTable table = explicit_splats(model);
    table.limit_degree(plan.harmonics);
    if (Result<Done> written = write_splat_ply(plan.out / splat_file_name, table, comments); !written) return written;
  }
  if constexpr (coded) {
    Result<CodecModel> file = coded_model(model, data.info, {.intra = plan.intra});
    if (!file) return in_file(file.error(), data.model);
    // The steps of the training, not those that would suit the marked symbols a little better.
    if (*inputs.unmarked_file) keep_context(**inputs.unmarked_file, *file);
    end.coded = std::move(*file);
  }
  return Done{};
}

/// The iterations of a run that was begun or taken up, its files and its figures.
template <class R, class Loop, class Views>
COMPMARK_ONCE Result<RunOutcome> run_iterations(Loop& loop, Views& train, const RunInputs& inputs,
                                                const std::optional<EarlierPart>& earlier) {
  using Source = typename SourceRecipe<R>::Type;
  Result<TrainObserver> observer = begin_iterations(inputs, loop.state().iteration, earlier);
  if (!observer) return observer.error();
  const Result<Done> done = loop.run(train, *observer);
  Result<RunEnd> end = end_iterations(*inputs.plan, *observer, done, loop.finished(), loop.state().iteration);
  if (!end) return end.error();
  end->anchors = loop.model().anchor_count();
  end->voxel_size = loop.model().voxel_size;
  if constexpr (requires { loop.state().revival; })
    end->revivals = static_cast<std::uint64_t>(loop.state().revival.revivals);
  constexpr bool coded = present<typename R::EntropyModel>;
  const Result<Done> kept = [&] {
    if constexpr (present<typename R::MessageDecoder>)
      return keep_model<Source, coded>(inputs, baked_model(loop.model()), *end);
    if constexpr (!present<typename R::MessageDecoder>) return keep_model<Source, coded>(inputs, loop.model(), *end);
  }();
  if (!kept) return kept.error();
  return finish_run(*inputs.plan, *inputs.data, *end, inputs.mark);
}

/// Reads the finished model that a mark is hidden in or a codec is fitted to; nothing for a training from the start.
/// Gives the settings its background and, if what is trained is rounded as its file is, its steps.
template <class Source>
[[nodiscard]] COMPMARK_ONCE Result<std::optional<LoadedModel<Source>>> load_source(const RunPlan& plan, bool rounded,
                                                                                   TrainSettings& wanted) {
  if (plan.model.empty()) return std::optional<LoadedModel<Source>>();
  Result<LoadedModel<Source>> loaded =
      read_source<Source>(plan.with_spread.empty() ? plan.model : plan.with_spread, *plan.executor);
  if (!loaded) return loaded.error();
  for (std::size_t c = 0; c < 3; ++c) wanted.background[c] = static_cast<float>(loaded->model.render.background[c]);
  if (rounded) {
    const std::array<double, 3>& step = loaded->info.base_step;
    wanted.rate.feature_step = step[0];
    wanted.rate.scaling_step = step[1];
    wanted.rate.offset_step = step[2];
  }
  return std::optional(std::move(*loaded));
}
/// What a file of the source model says.
template <class Source>
[[nodiscard]] COMPMARK_ONCE Result<CodecModel> file_of_source(const RunPlan& plan, const LoadedModel<Source>& loaded,
                                                              bool room_for_steps) {
  const Result<CodecModel> coded = coded_model(loaded.model, loaded.info, {.intra = plan.intra});
  if (!coded) return in_file(coded.error(), plan.model);
  Result<CodecEncoded> file = encode_model(*coded, *plan.executor);
  if (!file) return in_file(file.error(), plan.model);
  if (room_for_steps) leave_room_for_steps(file->model);
  return std::move(file->model);
}

/// Trains and measures. `mark` is for recipes with a message decoder; for the others null, or that of a model which
/// holds one already.
template <class R>
COMPMARK_ONCE Result<RunOutcome> run_recipe(const RunPlan& plan, const TrainSettings& settings,
                                            const RunMark* mark = nullptr) {
  using Source = typename SourceRecipe<R>::Type;
  constexpr bool is_marked = present<typename R::MessageDecoder>;
  constexpr bool is_fitted = requires { R::is_fitted; };
  constexpr bool is_rounded = is_marked && present<typename R::EntropyModel>;
  constexpr bool on_unmarked = requires { R::targets_unmarked; };
  ThreadExecutor& executor = *plan.executor;

  if (Result<Done> fits = check_coarse_to_fine<R>(settings); !fits) return in_option(fits.error(), "--coarse-to-fine");
  TrainSettings wanted = settings;
  Result<std::optional<LoadedModel<Source>>> read = load_source<Source>(plan, is_rounded, wanted);
  if (!read) return read.error();
  std::optional<LoadedModel<Source>>& loaded = *read;  // of embed and fit-codec
  SourceModel source;
  if (loaded) source = {&loaded->info, loaded->model.train_views, ExplicitModelRecipe<Source>};
  constexpr RunNeeds needs{present<typename R::Space>,
                           present<typename R::Background> || present<typename R::AlphaLoss>};
  Result<std::unique_ptr<RunData>> opened = open_run(plan, std::move(wanted), needs, source);
  if (!opened) return opened.error();
  RunData& data = **opened;
  Result<LensViews<RecipeLens<R>>> train = lens_views<RecipeLens<R>>(data.train);
  if (!train) return train.error();
  if (plan.resume) {
    Result<std::optional<RunOutcome>> finished = finished_outcome(plan, data);
    if (!finished) return finished.error();
    if (*finished) return std::move(**finished);
  }
  int smallest_side = mark != nullptr ? mark->decoder.minimum_size() : 0;
  if constexpr (is_marked)
    smallest_side = marking_decoder<typename R::MessageDecoder>(*mark, data.settings.mark.message).minimum_size();
  if (Result<Done> usable = check_run(plan, data, source, mark, smallest_side); !usable) return usable.error();
  std::optional<CodecModel> unmarked_file;  // what a file of the model says that a mark is hidden in
  if constexpr (is_rounded) {
    if (loaded) {
      Result<CodecModel> file = file_of_source(plan, *loaded, data.settings.mark.posthoc.calibrate_steps_every > 0);
      if (!file) return file.error();
      unmarked_file = std::move(*file);
    }
  }
  if constexpr (is_fitted) {  // said now, and not when the file is written
    if (loaded) {
      const Result<GridMoves> moves = move_onto_grid(loaded->model);
      if (!moves) return in_file(moves.error(), plan.model);
      if (moves->anchors > 0) plan.observer->on_note(told_moves(*moves, loaded->model.anchor_count()));
    }
  }

  const MemoryBudget memory = memory_budget(data, *plan.observer);
  const RunInputs inputs{&plan, &data, mark, &unmarked_file, memory, memory_shape<R>(memory.views)};
  // The finished source model, prepared for this run.
  const auto begin_from = [&](auto& loop) -> Result<Done> {
    if (Result<Done> room = check_training_memory(inputs.memory_shape, loaded->model.anchor_count(), memory); !room)
      return room;
    if constexpr (is_rounded) {  // what is trained is rounded as its file is
      if (Result<Done> adopted = adopt_networks(*unmarked_file, loaded->model); !adopted)
        return in_file(adopted.error(), plan.model);
    }
    if constexpr (requires { R::prepares_host; }) {  // a baseline that adds anchors, or removes some, before it begins
      auto prepared = R::begin(loaded->model, *train, data.settings.seed, executor);
      if (!prepared) return in_file(prepared.error(), plan.data);
      if (Result<Done> room = check_training_memory(inputs.memory_shape, prepared->anchor_count(), memory); !room)
        return room;
      loop.start_from(std::move(*prepared));
    } else if constexpr (is_marked || is_fitted) {
      loop.start_from(with_room_for_stages<R>(loaded->model, data.settings.seed));
    }
    return Done{};
  };
  if constexpr (is_marked && present<typename R::Embedder> && !on_unmarked) {
    if (data.settings.mark.posthoc.fidelity > 0) {
      PosthocEmbedding<R, ThreadExecutor> embedding(data.settings, executor);
      set_watermark(embedding, marking_decoder(*mark, data.settings.mark.message), mark->bits);
      const Result<std::optional<EarlierPart>> before = take_up(plan, data, embedding);
      if (!before) return before.error();
      if (!*before) {
        if (Result<Done> begun = begin_from(embedding); !begun) return begun.error();
      }
      return run_iterations<R>(embedding, *train, inputs, *before);
    }
  }
  // Without photographs of its training, or of an effect that no message trains together with.
  if constexpr (ExplicitModelRecipe<Source> || requires { R::is_of_finished_models; }) {
    return no_message_in(plan.recipe);
  } else {
    Trainer<R, ThreadExecutor> trainer(data.settings, train->size(), data.extent.radius, executor);
    if constexpr (is_marked) {
      using Reading = typename R::MessageDecoder;
      set_watermark(trainer, marking_decoder<Reading>(*mark, data.settings.mark.message), mark->bits);
    }
    const Result<std::optional<EarlierPart>> before = take_up(plan, data, trainer);
    if (!before) return before.error();
    if (!*before && loaded) {
      if constexpr (is_marked || is_fitted) {
        if (Result<Done> begun = begin_from(trainer); !begun) return begun.error();
      }
    } else if (!*before) {
      if (Result<Done> ready = trainer.initialise(data.dataset.points.position, memory); !ready)
        return in_file(ready.error(), plan.data);
      warn_of_far_points(plan, trainer.far_points(), data.dataset.points.size());
    }
    if constexpr (on_unmarked) {
      COMPMARK_ASSERT(loaded.has_value(), "run_recipe: this mark is hidden in a finished model");
      UnmarkedViews<Source, LensViews<RecipeLens<R>>, ThreadExecutor> unmarked(loaded->model, *train, executor);
      return run_iterations<R>(trainer, unmarked, inputs, *before);
    } else {
      return run_iterations<R>(trainer, *train, inputs, *before);
    }
  }
}

}  // namespace compmark::detail
