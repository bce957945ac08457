// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// A training run of one recipe: the part of train_run.hpp that is compiled for each, about ten seconds of a compiler
// each. Include it where recipes are compiled.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <compmark/app/compress.hpp>
#include <compmark/codec/model/adopt_networks.hpp>
#include <compmark/codec/model/coded_model.hpp>
#include <compmark/core/thread_executor.hpp>
#include <compmark/recipes/marked_codecs.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <compmark/splat/training/model_file.hpp>
#include <compmark/splat/training/trainer.hpp>
#include <compmark/watermark/embed/finished_host.hpp>
#include <compmark/watermark/embed/posthoc_embedding.hpp>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common.hpp"
#include "evaluation.hpp"
#include "finished_run.hpp"
#include "machine_memory.hpp"
#include "mark_input.hpp"
#include "progress.hpp"
#include "train_marked.hpp"
#include "train_run.hpp"

namespace tool {

using namespace compmark;  // files that include this one do nothing but train

/// Shows progress, writes checkpoints, listens to Ctrl-C.
struct TrainObserver {
  Progress* progress = nullptr;
  const ModelInfo* info = nullptr;
  std::int64_t checkpoint_every = 1000;
  std::filesystem::path checkpoint;
  double seconds_before = 0;
  std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
  std::optional<Error> failure;
  double last_psnr = 0;
  std::int64_t patience = 0;       ///< iterations in a row that may render nothing: two rounds of the training views
  std::int64_t empty_renders = 0;  ///< as many were there in a row
  std::function<Result<Done>(std::size_t anchors, std::size_t grown)> growth;  ///< checks that there is memory for more

  [[nodiscard]] double seconds() const {
    return seconds_before + std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

  template <class TrainerType>
  bool on_iteration(const TrainerType& trainer, const IterationReport& report) {
    // The PSNR of a training view costs a pass over the image: measured for every tenth iteration, the rate of the log.
    if (report.iteration % 10 == 1 || report.iteration == report.total) {
      const double psnr = counted_psnr(trainer.image(), trainer.target(), trainer.weight());
      if (!std::isnan(psnr)) last_psnr = psnr;  // of a view of which nothing counts there is none
    }
    ProgressLine line;
    line.iteration = report.iteration;
    line.total = report.total;
    line.loss = report.loss.total;
    line.l1 = report.loss.l1;
    line.ssim = report.loss.ssim;
    line.psnr = last_psnr;
    line.anchors = report.anchors;
    line.gaussians = report.forward.gaussians;
    if constexpr (requires { trainer.context(); } && has_stage<typename TrainerType::Stages, RateStage>) {
      const auto& rate = trainer.context().template of<RateStage>().report;
      if (rate.sampled != 0) line.bits_per_scalar = rate.bits_per_scalar;
    }
    const MarkReport mark = mark_report(trainer);
    if (mark.bits != 0) line.bit_accuracy = static_cast<double>(mark.matches) / static_cast<double>(mark.bits);
    progress->show(line);
    if (report.skipped_blocks != 0) {
      progress->note("iteration " + std::to_string(report.iteration) + ": " + std::to_string(report.skipped_blocks) +
                     " parameter blocks had a gradient that is not finite and were not updated");
    }
    // Opacities of zero or less get no gradient, so that such a scene can never change: the remaining hours would train
    // nothing.
    if (report.rendered) empty_renders = report.forward.gaussians == 0 ? empty_renders + 1 : 0;
    if (empty_renders > patience) {
      failure = Error{ErrorKind::invalid,
                      {},
                      "iteration " + std::to_string(report.iteration),
                      "the training has failed: in " + std::to_string(empty_renders) +
                          " iterations no Gaussian had an opacity above 0, so that none can learn any more",
                      "give another --seed; if most pixels are background, use a recipe that trains on "
                      "alpha (leave out --recipe and --profile); if the photographs are black, replace them"};
      return false;
    }
    if (report.adjusted && report.grown > 0 && report.iteration < report.total) {
      if (const Result<Done> room = growth(report.anchors, report.grown); !room) failure = room.error();
    }
    const bool stop = interrupted() || failure;
    if (stop || (report.iteration % checkpoint_every == 0 && report.iteration < report.total)) {
      if (Result<Done> written = write_checkpoint(checkpoint, trainer.state(), trainer.settings(), *info, seconds());
          !written) {
        failure = written.error();
        return false;
      }
    }
    return !stop;
  }
};

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

/// The recipe of the finished source model of a run (TrainOptions::model), when a mark is hidden in it or a codec is
/// fitted to it.
template <class R>
struct SourceRecipe {
  using Type = R;
};
template <class R>
  requires(present<typename R::MessageDecoder> || requires { R::is_fitted; })
struct SourceRecipe<R> {
  using Type = typename R::Host;
};

/// The exit code of a run that ended with `code`. An incomplete log is reported last, after everything else was
/// written.
inline int with_log(const Progress& progress, int code) {
  return code == success && progress.log_failure() ? fail(*progress.log_failure()) : code;
}

/// Inputs of a run of recipe R when its iterations begin.
template <class R>
struct RunParts {
  const TrainOptions* options;
  RunData* data;
  LensViews<RecipeLens<R>>* train;
  const MarkInput* mark;                 ///< null without a message
  std::optional<CodecModel>* host_file;  ///< what a file of the model says that a mark is hidden in
  MemoryBudget memory;
  ThreadExecutor* executor;
};

/// Loads the checkpoint of a resumed run and returns its seconds so far; nothing if the run begins.
template <class Loop>
Result<std::optional<double>> take_up(const TrainOptions& options, const RunData& data, Loop& loop) {
  if (!std::filesystem::exists(data.checkpoint)) return std::optional<double>();
  if (!options.resume) return unfinished_run(data.checkpoint);
  Result<Checkpoint<Loop>> restored = read_checkpoint<Loop>(data.checkpoint, data.settings, data.info);
  if (!restored) return restored.error();
  loop.restore(std::move(restored->state));
  std::fprintf(stderr, "compmark: resuming after iteration %lld\n", static_cast<long long>(loop.state().iteration));
  return std::optional(restored->seconds);
}

/// The iterations of a run that was begun or taken up after `seconds_before`, its files and its figures.
template <class Loop, class R>
int run_iterations(Loop& loop, const RunParts<R>& parts, double seconds_before) {
  constexpr bool is_marked = present<typename R::MessageDecoder>;
  const TrainOptions& options = *parts.options;
  RunData& data = *parts.data;
  ProgressSettings progress_settings;
  progress_settings.json_log = data.json_log;
  progress_settings.append = options.resume;
  Result<Progress> progress = Progress::open(progress_settings);
  if (!progress) return fail(progress.error());
  for (const std::string& note : options.notes) std::fprintf(stderr, "compmark: %s\n", note.c_str());
  TrainObserver observer;
  observer.progress = &*progress;
  observer.info = &data.info;
  observer.growth = [budget = parts.memory](std::size_t anchors, std::size_t grown) mutable {
    budget.bytes = free_memory_bytes();
    return check_growth_memory<R>(anchors, grown, budget);
  };
  observer.checkpoint_every = options.checkpoint_every;
  observer.checkpoint = data.checkpoint;
  observer.seconds_before = seconds_before;
  observer.patience = std::max<std::int64_t>(100, 2 * static_cast<std::int64_t>(parts.train->size()));
  const Result<Done> done = [&] {
    const InterruptWatch watch;
    return loop.run(*parts.train, observer);
  }();
  progress->finish();
  if (!done) return fail(done.error());
  if (observer.failure) return fail(*observer.failure);
  if (!loop.finished() || interrupted()) {  // in the last iteration too: a checkpoint is there either way
    std::fprintf(stderr, "compmark: interrupted after iteration %lld; continue with --resume\n",
                 static_cast<long long>(loop.state().iteration));
    return interrupted_exit;
  }
  RunEnd end;
  end.train_seconds = observer.seconds();
  end.peak_memory_mb = peak_memory_mb();
  end.anchors = loop.model().anchor_count();
  end.curve = progress->curve();
  end.voxel_size = loop.model().voxel_size;
  const auto keep = [&](const auto& model) -> Result<Done> {
    if (Result<Done> written = write_model(data.model, model, data.info); !written) return written;
    if constexpr (present<typename R::EntropyModel>) {
      Result<CodecModel> coded = coded_model(model, data.info);
      if (!coded) return coded.error();
      // The steps of the training, not those that would suit the marked symbols a little better.
      if (*parts.host_file) keep_context(**parts.host_file, *coded);
      end.coded = std::move(*coded);
    }
    return Done{};
  };
  const Result<Done> kept = [&] {
    if constexpr (is_marked) return keep(baked_host(loop.model()));
    if constexpr (!is_marked) return keep(loop.model());
  }();
  if (!kept) return fail(kept.error());
  return with_log(*progress, finish_run(options, data, end, parts.mark, *parts.executor));
}

/// Trains and measures. `mark` is for recipes with a message decoder; for the others null, or that of a model which
/// holds one already.
template <class R>
int run(const TrainOptions& options, const TrainSettings& settings, const MarkInput* mark = nullptr) {
  using Source = typename SourceRecipe<R>::Type;
  constexpr bool is_marked = present<typename R::MessageDecoder>;
  constexpr bool is_fitted = requires { R::is_fitted; };
  ThreadExecutor executor(options.threads);
  tell_threads(executor, options.threads);

  TrainSettings wanted = settings;
  std::optional<LoadedModel<Source>> loaded;  // of embed and fit-codec
  SourceModel source;
  if (!options.model.empty()) {
    Result<LoadedModel<Source>> read = read_model<Source>(options.model);
    if (!read) return fail(read.error());
    loaded = std::move(*read);
    source = {&loaded->info, loaded->model.train_views};
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
  Result<std::unique_ptr<RunData>> opened = open_run(options, std::move(wanted), needs, source);
  if (!opened) return fail(opened.error());
  RunData& data = **opened;
  Result<LensViews<RecipeLens<R>>> with_cameras = lens_views<RecipeLens<R>>(data.train);
  if (!with_cameras) return fail(with_cameras.error());
  LensViews<RecipeLens<R>>& train = *with_cameras;
  if (options.resume) {
    const Result<bool> finished = is_finished(options, data);
    if (!finished) return fail(finished.error());
    if (*finished) {
      std::fprintf(stderr, "compmark: the run in %s is finished, with these options: nothing is left to do\n",
                   options.out.string().c_str());
      return success;
    }
  }
  if (Result<Done> usable = check_run(options, data, source, mark); !usable) return fail(usable.error());
  std::optional<CodecModel> host_file;  // what a file of the model says that a mark is hidden in
  if constexpr (is_marked && present<typename R::EntropyModel>) {
    if (loaded) {
      const Result<CodecModel> coded = coded_model(loaded->model, loaded->info);
      if (!coded) return fail(in_file(coded.error(), options.model));
      Result<CodecEncoded> file = encode_model(*coded, executor);
      if (!file) return fail(in_file(file.error(), options.model));
      host_file = std::move(file->model);
      if (data.settings.mark.posthoc.hold_steps_every > 0) leave_room_for_steps(*host_file);
    }
  }

  if constexpr (is_fitted) {  // said now, and not when the file is written
    if (loaded) {
      if (const auto voxels = anchor_voxels(loaded->model); !voxels)
        return fail(in_file(voxels.error(), options.model));
    }
  }

  const MemoryBudget memory = memory_budget(data);
  const RunParts<R> parts{&options, &data, &train, mark, &host_file, memory, &executor};
  // The finished source model, prepared for this run.
  const auto begin_from = [&](auto& loop) -> Result<Done> {
    if (Result<Done> room = check_training_memory<R>(loaded->model.anchor_count(), memory); !room) return room;
    if constexpr (is_marked && present<typename R::EntropyModel>) {  // what is trained is rounded as its file is
      if (Result<Done> adopted = adopt_networks(*host_file, loaded->model); !adopted) return adopted;
    }
    if constexpr (is_marked || is_fitted) loop.start_from(with_room_for_stages<R>(loaded->model, data.settings.seed));
    return Done{};
  };
  if constexpr (is_marked) {
    if (data.settings.mark.posthoc.fidelity > 0) {
      PosthocEmbedding<R, ThreadExecutor> embedding(data.settings, executor);
      set_watermark(embedding, mark->decoder, mark->bits);
      const Result<std::optional<double>> before = take_up(options, data, embedding);
      if (!before) return fail(before.error());
      if (!*before) {
        if (Result<Done> begun = begin_from(embedding); !begun) return fail(begun.error());
      }
      return run_iterations(embedding, parts, before->value_or(0));
    }
  }
  Trainer<R, ThreadExecutor> trainer(data.settings, train.size(), data.extent.radius, executor);
  if constexpr (is_marked) set_watermark(trainer, mark->decoder, mark->bits);
  const Result<std::optional<double>> before = take_up(options, data, trainer);
  if (!before) return fail(before.error());
  if (!*before && loaded) {
    if constexpr (is_marked || is_fitted) {
      if (Result<Done> begun = begin_from(trainer); !begun) return fail(begun.error());
    }
  } else if (!*before) {
    if (Result<Done> ready = trainer.initialise(data.dataset.points.position, memory); !ready)
      return fail(ready.error());
    if (trainer.far_points() != 0) {
      std::fprintf(stderr,
                   "compmark: warning: %zu of %zu points are outliers, far from the others, and are left"
                   " out\n",
                   trainer.far_points(), data.dataset.points.size());
    }
  }
  return run_iterations(trainer, parts, before->value_or(0));
}

/// A run of a recipe for compression, with a message or without.
template <class R>
int run_coded(const TrainOptions& options, const TrainSettings& settings, const MarkInput* mark) {
  if (mark == nullptr || mark->read_only) return run<R>(options, settings, mark);
  if constexpr (present<typename R::Exposure>) {
    return fail(no_message_in(options.recipe));
  } else {
    if (!is_published_profile(settings.profile)) return run<recipes::Marked<R, Decoder>>(options, settings, mark);
    // The published captures have no effects, and each recipe is ten seconds of a compiler.
    if constexpr (present<typename R::AlphaLoss> || present<typename R::PixelWeights> || requires { R::is_fitted; }) {
      return fail({ErrorKind::unsupported,
                   {},
                   "--profile",
                   "\"" + settings.profile + "\" marks hac and context_gs only, not " + options.recipe,
                   "leave out --recipe, or --profile"});
    } else {
      return run<recipes::WithFrequency<recipes::Marked<R, Decoder>>>(options, settings, mark);
    }
  }
}

}  // namespace tool
