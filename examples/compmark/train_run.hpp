// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
//
// One training run of the tool, from options to files, for any recipe. Include it where recipes are compiled: every one that `run` is called
// with is compiled there, which takes a compiler about ten seconds each.
#pragma once

#include <algorithm>
#include <chrono>
#include <compmark/core/thread_executor.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/metric/psnr.hpp>
#include <compmark/pipeline/checkpoint.hpp>
#include <compmark/pipeline/coded_model.hpp>
#include <compmark/pipeline/model_file.hpp>
#include <compmark/pipeline/trainer.hpp>
#include <compmark/recipes/marked.hpp>
#include <compmark/scene/extent.hpp>
#include <compmark/scene/far_field.hpp>
#include <compmark/scene/open.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "any_model.hpp"
#include "coded_run.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "evaluation.hpp"
#include "mark_input.hpp"
#include "progress.hpp"
#include "report.hpp"
#include "results.hpp"

namespace tool {

using namespace compmark;  // who includes this page does nothing but train

struct TrainOptions {
  std::filesystem::path data;
  std::filesystem::path out;
  std::string recipe;
  std::string profile = "scaffold";
  std::int64_t iterations = 30000;
  double downscale = 1;
  std::optional<std::uint64_t> seed;
  std::size_t threads = 0;
  std::size_t max_anchors = 0;
  std::size_t memory_budget_mb = 0;
  std::int64_t checkpoint_every = 1000;
  double voxel_size = 0;
  bool voxel_size_given = false;
  std::string background;
  std::string lens = "undistort";
  std::string effects = "auto";
  std::vector<std::string> simulated;  ///< effects of the chosen recipe
  std::vector<std::string> notes;      ///< why it was chosen, to be shown when the run starts
  bool resume = false;
  std::filesystem::path json_log;
  LpipsFiles lpips;
  MarkOptions mark;
  std::filesystem::path model;  ///< embed: the finished model that is marked
  std::string codec = "none";   ///< that the model is trained for
  double rate_lambda = 0.001;   ///< loss of one bit more a scalar
};

inline std::string base_name(const std::filesystem::path& path) {
  std::filesystem::path clean = path.lexically_normal();
  if (!clean.has_filename()) clean = clean.parent_path();
  return clean.filename().string();
}

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

  [[nodiscard]] double seconds() const {
    return seconds_before + std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

  template <class TrainerType>
  bool on_iteration(const TrainerType& trainer, const IterationReport& report) {
    // The PSNR of a training view costs a pass over the image: measured for every tenth iteration, the rate of the log.
    if (report.iteration % 10 == 1 || report.iteration == report.total)
      last_psnr = counted_psnr(trainer.image(), trainer.target(), trainer.weight());
    ProgressLine line;
    line.iteration = report.iteration;
    line.total = report.total;
    line.loss = report.loss.total;
    line.l1 = report.loss.l1;
    line.ssim = report.loss.ssim;
    line.psnr = last_psnr;
    line.anchors = report.anchors;
    line.gaussians = report.forward.gaussians;
    if constexpr (requires { trainer.rate_report(); }) {
      if (const auto& rate = trainer.rate_report(); rate.sampled != 0) line.bits_per_scalar = rate.bits_per_scalar;
    }
    if constexpr (requires { trainer.between_report(); }) {
      if (const MarkReport& mark = trainer.mark_report(); mark.bits != 0)
        line.bit_accuracy = static_cast<double>(mark.matches) / static_cast<double>(mark.bits);
    }
    progress->show(line);
    if (report.skipped_blocks != 0) {
      progress->note("iteration " + std::to_string(report.iteration) + ": " + std::to_string(report.skipped_blocks) +
                     " parameter blocks had a gradient that is not finite; their step was skipped");
    }
    const bool stop = interrupted();
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

inline LensTreatment lens_treatment(const TrainOptions& options) {
  if (options.lens == "ignore") return LensTreatment::ignore;
  return options.lens == "project" ? LensTreatment::keep : LensTreatment::undistort;
}

/// The views of a dataset with cameras as the recipe wants them, lenses included.
template <class R>
struct RecipeViews : DatasetViews {
  std::vector<ViewCamera<R>> cameras;
  [[nodiscard]] ViewCamera<R> camera(std::size_t i) const { return cameras[i]; }
};
template <class R>
Result<RecipeViews<R>> recipe_views(DatasetViews views) {
  RecipeViews<R> result{std::move(views), {}};
  Lens last;
  std::optional<RecipeLens<R>> policy = lens_policy<RecipeLens<R>>(last);
  for (std::size_t i = 0; i < result.size(); ++i) {
    const Lens lens = result.lens(i);
    if (!(lens == last)) {  // finding where a lens ends takes half a millisecond
      last = lens;
      policy = lens_policy<RecipeLens<R>>(lens);
    }
    if (!is_pinhole(lens) && !policy) {
      return Error{ErrorKind::unsupported, result.dataset->root.string(), "lens",
                   "of view \"" + result.dataset->views[result.index[i]].name + "\" is not of the " +
                       lens_family<RecipeLens<R>> + " family, which is what this recipe projects through",
                   "take the lens out of the images with --lens undistort"};
    }
    ViewCamera<R> camera(result.dataset->views[result.index[i]].camera);
    if constexpr (!std::is_same_v<RecipeLens<R>, PinholeLens>) {
      if (!is_pinhole(lens)) camera.lens = *policy;
    }
    result.cameras.push_back(camera);
  }
  return result;
}

inline std::string rounded(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

/// The recipe of the model that is written: the mark is baked in.
template <class R>
struct StoredRecipe {
  using Type = R;
};
template <class R>
  requires present<typename R::MessageDecoder>
struct StoredRecipe<R> {
  using Type = typename R::Host;
};

/// Trains and measures. `mark` is for recipes with a message decoder, null for all others.
template <class R>
int run(const TrainOptions& options, TrainSettings settings, const MarkInput* mark = nullptr) {
  using Stored = typename StoredRecipe<R>::Type;
  constexpr bool is_marked = present<typename R::MessageDecoder>;
  const std::size_t threads =
      options.threads != 0 ? options.threads : std::max(1u, std::thread::hardware_concurrency());
  ThreadExecutor executor(threads);

  std::optional<LoadedModel<Stored>> source;  // of embed
  if (!options.model.empty()) {
    Result<LoadedModel<Stored>> loaded = read_model<Stored>(options.model);
    if (!loaded) return fail(loaded.error());
    source = std::move(*loaded);
    for (std::size_t c = 0; c < 3; ++c) settings.background[c] = static_cast<float>(source->model.render.background[c]);
  }
  const std::filesystem::path model_path = options.out / "model.safetensors";
  if (std::error_code none; mark != nullptr && std::filesystem::equivalent(mark->twin, model_path, none)) {
    return fail({ErrorKind::invalid, mark->twin.string(), "--twin", "would be replaced by the marked model",
                 "choose another --out, the unmarked model is worth keeping"});
  }
  DatasetSettings data_settings;
  data_settings.downscale = options.downscale;
  data_settings.background = settings.background;
  data_settings.seed = settings.seed;
  data_settings.lens = source ? settings_of(source->info).lens : lens_treatment(options);
  Result<Dataset> opened = open_dataset(options.data, data_settings);
  if (!opened) return fail(opened.error());
  const Dataset& dataset = *opened;
  if constexpr (present<typename R::Space>) {  // the ball of the cameras, beyond which cells grow
    const CameraBall ball = camera_ball(dataset);
    settings.effects.space_origin = ball.origin;
    settings.effects.space_radius = ball.radius;
  }
  for (const std::string& warning : dataset.warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  if (dataset.kind == "blender")
    settings.init_factor = 4;  // as all published scripts do for these scenes (method sheet, section 3.5)
  if (Result<Done> folder = make_folder(options.out); !folder) return fail(folder.error());

  ImageStoreSettings store_settings;
  store_settings.keep_alpha = present<typename R::Background> || present<typename R::AlphaLoss>;
  if (options.memory_budget_mb != 0) store_settings.memory_budget_bytes = options.memory_budget_mb << 20;
  ImageStore store(dataset, data_settings, store_settings);
  Result<RecipeViews<R>> with_cameras = recipe_views<R>({&dataset, &store, dataset.indices(Split::train)});
  if (!with_cameras) return fail(with_cameras.error());
  RecipeViews<R>& train = *with_cameras;
  DatasetViews test{&dataset, &store, dataset.indices(Split::test)};
  if (train.size() == 0) {
    return fail({ErrorKind::invalid, options.data.string(), "train split", "holds no view",
                 "give at least one training image"});
  }
  for (std::size_t i = 0; i < train.size();
       ++i) {  // every image is decoded once now: a bad one is named before hours of work
    const Camera<double> camera = train.camera(i);
    if (mark != nullptr && std::min(camera.width, camera.height) < mark->decoder.minimum_size()) {
      return fail(
          {ErrorKind::invalid, options.data.string(), "image size",
           "of view " + dataset.views[train.index[i]].name + " is " + std::to_string(camera.width) + " x " +
               std::to_string(camera.height),
           "the decoder reads images of at least " + std::to_string(mark->decoder.minimum_size()) + " pixels a side"});
    }
    Buffer<float> scratch(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    if (Result<Done> loaded = train.load(i, {scratch.data(), 3, camera.height, camera.width}); !loaded)
      return fail(loaded.error());
  }

  ModelInfo info;
  info.recipe = options.recipe;
  info.effects = source ? source->info.effects : options.simulated;
  info.profile = settings.profile;
  info.iterations = settings.iterations;
  info.seed = settings.seed;
  info.origin = dataset.origin;
  info.base_step = {settings.rate.feature_step, settings.rate.scaling_step, settings.rate.offset_step};
  for (const View& view : dataset.views) info.views.push_back(stored_view(view));

  const SceneExtent extent = scene_extent(dataset);
  if (source) {
    const auto foreign = [&](std::string field, std::string problem) {
      return fail({ErrorKind::invalid, options.model.string(), std::move(field), std::move(problem),
                   "give the data that it was trained on, as large as then (--downscale)"});
    };
    if (source->info.views.size() != info.views.size() || source->model.train_views != train.size()) {
      return foreign("views", "are " + std::to_string(source->info.views.size()) + ", of them " +
                                  std::to_string(source->model.train_views) + " trained with; the data have " +
                                  std::to_string(info.views.size()) + " and " + std::to_string(train.size()));
    }
    if (const std::optional<OtherView> other = other_view(source->info.views, info.views))
      return foreign(other->field, "of view " + other->name + " is another one in the data");
    if (source->info.origin != dataset.origin) return foreign("origin", "of the scene is another one in the data");
  }
  Trainer<R, ThreadExecutor> trainer(settings, train.size(), extent.radius, executor);
  if constexpr (is_marked) trainer.set_watermark(mark->decoder, mark->bits);
  const std::filesystem::path checkpoint = options.out / "checkpoint.safetensors";
  double seconds_before = 0;
  if (options.resume && std::filesystem::exists(checkpoint)) {
    Result<Checkpoint<R, ThreadExecutor>> restored = read_checkpoint<R, ThreadExecutor>(checkpoint, settings, info);
    if (!restored) return fail(restored.error());
    seconds_before = restored->seconds;
    trainer.restore(std::move(restored->state));
    std::fprintf(stderr, "compmark: resuming after iteration %lld\n",
                 static_cast<long long>(trainer.state().iteration));
  } else {
    if (!options.resume && std::filesystem::exists(checkpoint)) {
      return fail({ErrorKind::invalid,
                   checkpoint.string(),
                   {},
                   "an unfinished run is in this folder",
                   "continue it with --resume, or remove the file to start over"});
    }
    if (source) {
      if constexpr (is_marked) trainer.start_from(with_room_for_mark<R>(source->model, settings.seed));
    } else if (Result<Done> ready = trainer.initialise(dataset.points.position); !ready) {
      return fail(ready.error());
    }
  }

  ProgressSettings progress_settings;
  progress_settings.json_log = options.json_log.empty() ? options.out / "log.jsonl" : options.json_log;
  progress_settings.append = options.resume;
  Result<Progress> progress = Progress::open(progress_settings);
  if (!progress) return fail(progress.error());
  for (const std::string& note : options.notes) std::fprintf(stderr, "compmark: %s\n", note.c_str());
  watch_interrupt();
  TrainObserver observer;
  observer.progress = &*progress;
  observer.info = &info;
  observer.checkpoint_every = options.checkpoint_every;
  observer.checkpoint = checkpoint;
  observer.seconds_before = seconds_before;
  const Result<Done> done = trainer.run(train, observer);
  progress->finish();
  if (!done) return fail(done.error());
  if (observer.failure) return fail(*observer.failure);
  if (!trainer.finished()) {
    std::fprintf(stderr, "compmark: interrupted after iteration %lld; continue with --resume\n",
                 static_cast<long long>(trainer.state().iteration));
    return interrupted_exit;
  }
  const double train_seconds = observer.seconds();
  const double peak_mb = peak_memory_mb();

  if constexpr (is_marked) {
    if (Result<Done> written = write_model(model_path, unmarked_host(trainer.model()), info); !written)
      return fail(written.error());
  } else {
    if (Result<Done> written = write_model(model_path, trainer.model(), info); !written) return fail(written.error());
  }
  Result<std::string> digest = file_sha256(model_path);
  if (!digest) return fail(digest.error());

  const bool has_test = test.size() != 0;
  const DatasetViews measured = has_test ? test : static_cast<const DatasetViews&>(train);
  const std::size_t shown = std::min<std::size_t>(3, measured.size());
  ReportInput report;
  Result<std::unique_ptr<AnyModel>> model = load_model(model_path);  // what was written is what is measured
  if (!model) return fail(model.error());
  Result<Evaluation> evaluation = evaluate_views(
      **model, measured, options.lpips, executor,
      [&](std::size_t i, const ViewResult& view, ImageView<const float> render, ImageView<const float> truth) {
        for (std::size_t s = 0; s < shown; ++s) {
          if (i != s * measured.size() / shown) continue;
          report.views.push_back(
              {view.name, make_report_image(truth), make_report_image(render), view.psnr, view.ssim, view.lpips_alex});
        }
      });
  if (!evaluation) return fail(evaluation.error());
  const double mean_psnr = evaluation->mean([](const ViewResult& v) { return v.psnr; });
  const double mean_ssim = evaluation->mean([](const ViewResult& v) { return v.ssim; });
  const double milliseconds = evaluation->mean([](const ViewResult& v) { return v.milliseconds; });

  std::optional<CodedRun> coded;
  if constexpr (present<typename R::EntropyModel>) {
    const Result<CodecModel> small = [&] {
      if constexpr (is_marked) return coded_model(unmarked_host(trainer.model()), info);
      if constexpr (!is_marked) return coded_model(trainer.model(), info);
    }();
    if (!small) return fail(small.error());
    Result<CodedRun> written =
        write_and_measure(*small, options.out / "model.cmk", measured, options.lpips, mark, executor);
    if (!written) return fail(written.error());
    coded = std::move(*written);
  }

  std::optional<MarkMeasurement> measured_mark;
  if (mark != nullptr) {
    Result<MarkMeasurement> found = measure_mark(**model, *mark, measured, executor);
    if (!found) return fail(found.error());
    measured_mark = std::move(*found);
    measured_mark->report.sources.model = model_path.filename().string();
    measured_mark->report.sources.model_sha256 = *digest;
  }

  Results results;
  results.dataset = base_name(options.data);
  results.recipe = options.recipe;
  results.profile = settings.profile;
  results.iterations = settings.iterations;
  results.seed = settings.seed;
  results.threads = static_cast<int>(threads);
  results.anchors = trainer.model().anchor_count();
  results.gaussians_per_view = evaluation->mean([](const ViewResult& v) { return static_cast<double>(v.gaussians); });
  results.train_seconds = train_seconds;
  results.peak_memory_mb = peak_mb;
  if (has_test) {
    TestMetrics metrics{mean_psnr, mean_ssim, {}, static_cast<int>(measured.size())};
    if (!options.lpips.alex.empty())
      metrics.lpips_alex = evaluation->mean([](const ViewResult& v) { return *v.lpips_alex; });
    results.test = metrics;
  }
  results.model_sha256 = *digest;
  results.effects = info.effects;
  if (coded) results.compressed = coded->metrics;
  if (measured_mark) {
    WatermarkMetrics metrics = watermark_metrics(measured_mark->report.verification);
    if (measured_mark->unmarked_psnr) metrics.psnr_cost_vs_unmarked = *measured_mark->unmarked_psnr - mean_psnr;
    metrics.psnr_marked_vs_unmarked = measured_mark->psnr_marked_vs_unmarked;
    results.watermark = metrics;
    nlohmann::ordered_json json = report_json<nlohmann::ordered_json>(measured_mark->report);
    if (mark->key.corrects != 0)
      json["payload"] = payload_text(mark->key, measured_mark->report.verification.read).json;
    if (Result<Done> written = write_json(options.out / "verification.json", json); !written)
      return fail(written.error());
  }
  if (Result<Done> written = write_results(options.out / "results.json", results); !written)
    return fail(written.error());

  const char* split = has_test ? "test" : "training";
  report.title = results.dataset;
  report.subtitle = "recipe " + options.recipe + ", profile " + settings.profile + ", " +
                    std::to_string(settings.iterations) + " iterations";
  report.headline = {{rounded(mean_psnr, 2) + " dB", std::string("PSNR, mean over the ") + split + " views"},
                     {rounded(mean_ssim, 4), "SSIM"},
                     {std::to_string(results.anchors), "anchors"},
                     {format_duration(train_seconds), "training time"},
                     {rounded(milliseconds, 1) + " ms", "render of a view"}};
  if (Result<std::vector<ProgressLine>> log = read_progress_log(progress_settings.json_log); log)
    report.curve = std::move(*log);
  report.tables = {machine_table(static_cast<int>(threads)),
                   {"Settings",
                    {{"seed", std::to_string(settings.seed)},
                     {"lambda (1 - SSIM)", rounded(settings.lambda_dssim, 3)},
                     {"voxel size", rounded(trainer.model().voxel_size, 6)},
                     {"growing threshold", rounded(settings.gradient_threshold, 6)},
                     {"scene extent", rounded(extent.radius, 4)},
                     {"background", options.background.empty() ? "black" : options.background},
                     {"model sha256", *digest}}}};
  if (coded) {
    report.headline.push_back({rounded(static_cast<double>(coded->metrics.bytes) / 1024, 0) + " KiB", "compressed"});
    report.headline.push_back({rounded(coded->metrics.test.psnr, 2) + " dB", "PSNR of the compressed file"});
    report.tables.push_back(coded->table);
  }
  if (results.watermark) {
    const WatermarkMetrics& m = *results.watermark;
    report.headline.push_back(
        {rounded(100 * m.mean, 1) + " %", "of " + std::to_string(mark->bits.size()) + " bits read"});
    ReportTable table{"Watermark",
                      {{"key id", mark->sources.key_id},
                       {"decoder sha256", mark->sources.decoder_sha256},
                       {"bits", std::to_string(mark->bits.size())},
                       {"bit accuracy, mean and worst view", rounded(m.mean, 4) + ", " + rounded(m.min, 4)},
                       {"p-value of all views together", detail::short_number(m.p_value)},
                       {"p-value of the worst view", detail::short_number(m.largest_view_p_value)}}};
    if (m.psnr_cost_vs_unmarked)
      table.rows.push_back({"PSNR lost to the twin", rounded(*m.psnr_cost_vs_unmarked, 2) + " dB"});
    if (m.psnr_marked_vs_unmarked)
      table.rows.push_back({"PSNR of marked against unmarked", rounded(*m.psnr_marked_vs_unmarked, 2) + " dB"});
    report.tables.push_back(std::move(table));
  }
  ReportGrid grid{std::string("Every ") + split + " view", {"view", "PSNR dB", "SSIM", "ms", "Gaussians"}, {}};
  for (const ViewResult& view : evaluation->views) {
    grid.rows.push_back({view.name, rounded(view.psnr, 2), rounded(view.ssim, 4), rounded(view.milliseconds, 1),
                         std::to_string(view.gaussians)});
  }
  report.grids.push_back(std::move(grid));
  if (Result<Done> written = write_report(options.out / "report.html", report); !written) return fail(written.error());
  std::error_code ignored;
  std::filesystem::remove(checkpoint, ignored);

  std::printf(
      "%s: %lld iterations in %.0f s, %zu anchors, %s PSNR %.2f dB, SSIM %.4f over %zu views\nmodel %s\nsha256 "
      "%s\nreport %s\n",
      results.dataset.c_str(), static_cast<long long>(settings.iterations), train_seconds,
      trainer.model().anchor_count(), split, mean_psnr, mean_ssim, measured.size(), model_path.string().c_str(),
      digest->c_str(), (options.out / "report.html").string().c_str());
  if (coded) {
    std::printf("compressed %s: %llu bytes, PSNR %.2f dB, SSIM %.4f\n", (options.out / "model.cmk").string().c_str(),
                static_cast<unsigned long long>(coded->metrics.bytes), coded->metrics.test.psnr,
                coded->metrics.test.ssim);
  }
  if (measured_mark) {
    std::printf("bits read: %.1f %% in the mean, %.1f %% in the worst view\n%s", 100 * results.watermark->mean,
                100 * results.watermark->min, report_text(measured_mark->report.verification).c_str());
    if (results.watermark->psnr_marked_vs_unmarked) {
      std::printf("against the unmarked twin: %.2f dB lost, %.2f dB between the renders\n",
                  *results.watermark->psnr_cost_vs_unmarked, *results.watermark->psnr_marked_vs_unmarked);
    }
  }
  return success;
}

/// A run of a recipe for compression, with a message or without.
template <class R>
int run_coded(const TrainOptions& options, const TrainSettings& settings, const MarkInput* mark) {
  if (mark == nullptr) return run<R>(options, settings);
  if constexpr (present<typename R::Exposure>) {
    return fail({ErrorKind::unsupported,
                 {},
                 "--recipe",
                 "\"" + options.recipe + "\" is not built with a message",
                 "choose " + options.codec + ", " + options.codec + "+mask or " + options.codec + "+alpha"});
  } else {
    return run<recipes::Marked<R, Decoder>>(options, settings, mark);
  }
}

}  // namespace tool
