// SPDX-FileCopyrightText: 2026 The CompMark authors
// SPDX-License-Identifier: Apache-2.0
#include "train_run.hpp"

#include <algorithm>
#include <compmark/app/capture.hpp>
#include <compmark/app/files.hpp>
#include <compmark/core/buffer.hpp>
#include <compmark/io/json_file.hpp>
#include <compmark/scene/check_weights.hpp>
#include <compmark/scene/far_field.hpp>
#include <compmark/scene/open.hpp>
#include <compmark/splat/training/checkpoint.hpp>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "coded_run.hpp"
#include "common.hpp"
#include "effects.hpp"
#include "finished_run.hpp"
#include "machine_memory.hpp"
#include "mark_record.hpp"
#include "report.hpp"
#include "results.hpp"
#include "run_folder.hpp"
#include "train_page.hpp"

namespace tool {

using namespace compmark;

void add_finished_model_options(Options& app, TrainOptions& options) {
  app.number("--downscale", options.downscale, downscale_range,
             "divide the size of the images by this; use the value of the training")
      ->capture_default_str();
  app.number("--seed", options.seed, any_seed, "seed of every random number (default: 0)");
  app.number("--threads", options.threads, thread_range, "0: all; the result is the same for any number")
      ->capture_default_str();
  app.number("--checkpoint-every", options.checkpoint_every, run_length, "iterations between checkpoints")
      ->capture_default_str();
  app.flag("--resume", options.resume, "continue the run in --out from its checkpoint");
  app.flag("--force", options.force, "replace a finished run in --out");
  app.writes("--json-log", options.json_log, OutputKind::words,
             "write progress to this file, one JSON object a line (default: log.jsonl in --out)");
  app.reads("--lpips-alex", options.lpips.alex, InputKind::weights, "LPIPS weights (safetensors) to report lpips_alex");
}

void add_run_files(FileUse& use, const TrainOptions& options, const std::filesystem::path& out) {
  use.write_in(out, {"model.safetensors", "model.cmk", "checkpoint.safetensors", "results.json", "report.html"},
               "--out");
  if (options.json_log.empty() || out != options.out) use.write(out / "log.jsonl", "--out");
  if (options.mark.wanted() && out == options.out) use.write_in(out, {"verification.json", "mark.json"}, "--out");
  if (options.model.empty()) return;
  const std::filesystem::path host = options.model.parent_path();  // its page's curves are shown again
  for (const char* name : {"results.json", "log.jsonl"}) use.read(host / name, "--model (the run that it is of)");
}

Error unfinished_run(const std::filesystem::path& checkpoint) {
  return {ErrorKind::invalid,
          checkpoint.string(),
          {},
          "an unfinished run is in this folder",
          "continue it with --resume, or remove the file to start over"};
}

LensTreatment lens_treatment(const TrainOptions& options) {
  if (options.lens == "ignore") return LensTreatment::ignore;
  return options.lens == "project" ? LensTreatment::keep : LensTreatment::undistort;
}

Result<std::unique_ptr<RunData>> open_run(const TrainOptions& options, TrainSettings settings, const RunNeeds& needs,
                                          const SourceModel& source) {
  auto run = std::make_unique<RunData>();
  run->model = options.out / "model.safetensors";
  run->checkpoint = options.out / "checkpoint.safetensors";
  run->json_log = options.json_log.empty() ? options.out / "log.jsonl" : options.json_log;
  DatasetSettings& data_settings = run->data_settings;
  data_settings.downscale = options.downscale;
  data_settings.background = settings.background;
  data_settings.seed = settings.seed;
  data_settings.lens = source.info != nullptr ? settings_of(*source.info).lens : lens_treatment(options);
  Result<Dataset> opened = source.info != nullptr ? open_for(*source.info, options.data, data_settings)
                                                  : open_dataset(options.data, data_settings);
  if (!opened) return opened.error();
  run->dataset = std::move(*opened);
  const Dataset& dataset = run->dataset;
  if (options.voxel_size_given && settings.voxel_size > 0) settings.voxel_size /= dataset.unit;
  if (needs.ball) {
    const CameraBall ball = camera_ball(dataset);
    settings.effects.space_origin = ball.origin;
    settings.effects.space_radius = ball.radius;
  }
  for (const std::string& warning : dataset.warnings) std::fprintf(stderr, "compmark: warning: %s\n", warning.c_str());
  if (dataset.kind == "blender")
    settings.init_factor = 4;  // as all published scripts do for these scenes (docs/spec/method.md, 3.5)
  run->folder = options.folder;
  if (!run->folder) {
    Result<std::shared_ptr<const void>> held = hold_folder(options.out);
    if (!held) return held.error();
    run->folder = std::move(*held);
  }
  if (Result<Done> free = check_unfinished(options.out, options.resume || options.force); !free) return free.error();

  ImageStoreSettings store_settings;
  store_settings.keep_alpha = needs.alpha;
  if (options.memory_budget_mb != 0) store_settings.memory_budget_bytes = options.memory_budget_mb << 20;
  run->store = std::make_unique<ImageStore>(dataset, data_settings, store_settings);
  run->train = {&dataset, run->store.get(), dataset.indices(Split::train)};
  run->test = {&dataset, run->store.get(), dataset.indices(Split::test)};
  run->extent = scene_extent(dataset);

  ModelInfo& info = run->info;
  info.recipe = options.recipe;
  info.effects = source.info != nullptr ? source.info->effects : options.simulated;
  info.profile = settings.profile;
  info.iterations = settings.iterations;
  info.seed = settings.seed;
  info.origin = dataset.origin;
  info.unit = dataset.unit;
  info.base_step = {settings.rate.feature_step, settings.rate.scaling_step, settings.rate.offset_step};
  for (const View& view : dataset.views) info.views.push_back(stored_view(view));
  run->settings = std::move(settings);
  return run;
}

Result<Done> check_run(const TrainOptions& options, RunData& run, const SourceModel& source, const MarkInput* mark) {
  if (mark != nullptr && !mark->read_only) warn_of_record(mark->key_file, options.out);
  if (run.train.size() == 0) {
    return Error{ErrorKind::invalid, options.data.string(), "train split", "holds no view",
                 "give at least one training image"};
  }
  for (std::size_t i = 0; i < run.train.size(); ++i) {
    const Camera<double> camera = run.train.camera(i);
    if (mark != nullptr && std::min(camera.width, camera.height) < mark->decoder.minimum_size()) {
      return Error{
          ErrorKind::invalid, options.data.string(), "image size",
          "of view " + run.dataset.views[run.train.index[i]].name + " is " + std::to_string(camera.width) + " x " +
              std::to_string(camera.height),
          "the decoder reads images of at least " + std::to_string(mark->decoder.minimum_size()) + " pixels a side"};
    }
    Buffer<float> scratch(3 * static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
    if (Result<Done> loaded = run.train.load(i, {scratch.data(), 3, camera.height, camera.width}); !loaded)
      return loaded.error();
  }
  if (Result<Done> counted = check_weights(run.dataset, *run.store); !counted) return counted.error();
  if (mark != nullptr && !mark->twin.empty() &&
      (mark->twin_unit != run.dataset.unit || mark->twin_origin != run.dataset.origin)) {
    return Error{ErrorKind::invalid, mark->twin.string(), "--twin",
                 "has another unit of length or another origin than these data have in this version",
                 "train the unmarked counterpart again"};
  }
  if (source.info == nullptr) return Done{};
  const auto foreign = [&](std::string field, std::string problem) {
    return Error{ErrorKind::invalid, options.model.string(), std::move(field), std::move(problem),
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

namespace {

/// Notes which decoder reads the mark of what this run wrote.
Result<Done> keep_mark(const TrainOptions& options, const MarkInput& mark, const std::filesystem::path& model,
                       const std::string& digest, bool coded) {
  MarkRecord record;
  record.key_id = mark.sources.key_id;
  record.key_commitment = mark.sources.key_commitment;
  record.decoder = {mark.sources.decoder, mark.sources.decoder_sha256};
  record.decoder_tensors = mark.decoder_tensors;
  record.models.push_back({model.filename().string(), digest});
  if (coded) {
    const Result<std::string> small = file_sha256(options.out / "model.cmk");
    if (!small) return small.error();
    record.models.push_back({"model.cmk", *small});
  }
  return keep_record(record, mark.key_file, options.out);
}

}  // namespace

MemoryBudget memory_budget(const RunData& run) {
  MemoryBudget budget;
  budget.bytes = free_memory_bytes();
  budget.views = run.train.size();
  for (std::size_t i = 0; i < run.train.size(); ++i) {
    const Camera<double> camera = run.train.camera(i);
    budget.pixels =
        std::max(budget.pixels, static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
  }
  return budget;
}

int finish_run(const TrainOptions& options, RunData& run, const RunEnd& end, const MarkInput* mark,
               ThreadExecutor& executor) {
  const TrainSettings& settings = run.settings;
  Result<std::string> digest = file_sha256(run.model);
  if (!digest) return fail(digest.error());

  const bool has_test = run.test.size() != 0;
  const DatasetViews& measured = has_test ? run.test : run.train;
  ShownViews shown(measured);
  // Pictures are renders of the file that others get: the compressed one if there is one.
  const SeenViewObserver keep = shown.keep();
  Result<AnyModel> model = load_model(run.model);  // what was written is what is measured
  if (!model) return fail(model.error());
  Result<Evaluation> evaluation = evaluate_views(*model, measured, evaluation_settings(options.lpips), executor,
                                                 end.coded ? SeenViewObserver() : keep);
  if (!evaluation) return fail(evaluation.error());
  const double mean_psnr = evaluation->mean([](const ViewResult& v) { return v.psnr; });
  const double mean_ssim = evaluation->mean([](const ViewResult& v) { return v.ssim; });

  std::optional<CodedRun> coded;
  if (end.coded) {
    Result<CodedRun> written =
        write_and_measure(*end.coded, options.out / "model.cmk", measured, options.lpips, mark, keep, executor);
    if (!written) return fail(written.error());
    coded = std::move(*written);
  }
  if (mark != nullptr) {
    const std::filesystem::path& twin = coded && !mark->coded_twin.empty() ? mark->coded_twin : mark->twin;
    if (!twin.empty()) {
      if (Result<Done> added = shown.add_unmarked(twin, executor); !added) return fail(added.error());
    }
  }

  std::optional<MarkMeasurement> measured_mark;
  if (mark != nullptr) {
    Result<MarkMeasurement> found = measure_mark(*model, *mark, measured, executor);
    if (!found) return fail(found.error());
    measured_mark = std::move(*found);
    measured_mark->report.sources.model = run.model.filename().string();
    measured_mark->report.sources.model_sha256 = *digest;
  }

  Results results;
  results.dataset = base_name(options.data);
  results.recipe = options.recipe;
  results.profile = settings.profile;
  results.iterations = settings.iterations;
  results.seed = settings.seed;
  results.threads = static_cast<int>(executor.concurrency());
  results.anchors = end.anchors;
  results.gaussians_per_view = evaluation->mean([](const ViewResult& v) { return static_cast<double>(v.gaussians); });
  results.train_seconds = end.train_seconds;
  results.peak_memory_mb = end.peak_memory_mb;
  if (has_test) {
    TestMetrics metrics{mean_psnr, mean_ssim, {}, static_cast<int>(measured.size()), {}};
    if (!options.lpips.alex.empty())
      metrics.lpips_alex = evaluation->mean([](const ViewResult& v) { return *v.lpips_alex; });
    metrics.psnr_colour_fitted = evaluation->colour_fitted();
    results.test = metrics;
  }
  results.model_sha256 = *digest;
  Result<std::string> identity = run_identity(options, settings);
  if (!identity) return fail(identity.error());
  results.identity = std::move(*identity);
  results.effects = run.info.effects;
  // Post-hoc embedding has no rate in its loss, so no lambda is recorded.
  const bool rates = mark == nullptr || mark->read_only || options.model.empty();
  if (coded && rates) results.rate_lambda = settings.rate.lambda;
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
  if (mark != nullptr && !mark->read_only) {
    if (Result<Done> kept = keep_mark(options, *mark, run.model, *digest, coded.has_value()); !kept)
      return fail(kept.error());
  }
  const ReportInput page =
      run_page({options, run, end, results, *evaluation, mark, measured_mark, coded, has_test}, shown.pictures);
  if (Result<Done> written = write_report(options.out / "report.html", page); !written) return fail(written.error());
  // Written last: a run with this file counts as finished.
  if (Result<Done> written = write_results(options.out / "results.json", results); !written)
    return fail(written.error());
  std::error_code ignored;
  std::filesystem::remove(run.checkpoint, ignored);

  std::printf(
      "%s: %lld iterations in %.0f s, %zu anchors, %s PSNR %.2f dB, SSIM %.4f over %zu views\nmodel %s\nsha256 "
      "%s\nreport %s\n",
      results.dataset.c_str(), static_cast<long long>(settings.iterations), end.train_seconds, end.anchors,
      has_test ? "test" : "training", mean_psnr, mean_ssim, measured.size(), run.model.string().c_str(),
      digest->c_str(), (options.out / "report.html").string().c_str());
  if (coded) {
    std::printf("compressed %s: %llu bytes, PSNR %.2f dB, SSIM %.4f\n", (options.out / "model.cmk").string().c_str(),
                static_cast<unsigned long long>(coded->metrics.bytes), coded->metrics.test.psnr,
                coded->metrics.test.ssim);
    if (const std::optional<WatermarkMetrics>& m = coded->metrics.watermark) {
      std::printf("  bits read: %.1f %% in the mean, %.1f %% in the worst view", 100 * m->mean, 100 * m->min);
      if (m->psnr_cost_vs_unmarked)
        std::printf(", %.2f dB lost to the unmarked counterpart", *m->psnr_cost_vs_unmarked);
      std::printf("\n");
    }
  }
  if (measured_mark) {
    std::printf("bits read: %.1f %% in the mean, %.1f %% in the worst view\n%s", 100 * results.watermark->mean,
                100 * results.watermark->min, report_text(measured_mark->report.verification).c_str());
    if (results.watermark->psnr_marked_vs_unmarked) {
      std::printf("against the unmarked counterpart: %.2f dB lost, %.2f dB between the renders\n",
                  *results.watermark->psnr_cost_vs_unmarked, *results.watermark->psnr_marked_vs_unmarked);
    }
  }
  return success;
}

}  // namespace tool
